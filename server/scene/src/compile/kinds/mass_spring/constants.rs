//! The constants of springs, from their keys or from the file of a table.
use super::{AGAIN, at};
use crate::{
    compile::{Files, check, exactly_one},
    document::{
        source::{Fault, Where},
        springs::{AnchorLayerTable, ConstantsName, RefineTable, SpringsTable},
    },
};
use palpate_physics::{
    Settings,
    bodies::mass_spring::{
        AnchorLaw,
        anchor::Layer,
        constants_table::{Calibration, ConstantsTable},
        matching,
        region::Constants,
    },
    mesh::Triangulation,
};

fn positive(at: &Where, key: &str, value: f64) -> Result<f64, Fault> {
    check(&at.key(key), value, value > 0.0 && value.is_finite(), "must be finite and larger than 0")?;
    Ok(value)
}

pub(super) fn coarse(table: &SpringsTable, areas_m2: &[f64]) -> Result<Constants, Fault> {
    let at = at();
    let constants = [("mesh_n_per_m", table.mesh_n_per_m), ("anchor_n_per_m", table.anchor_n_per_m)];
    let skin = [
        ("young_modulus_pa", table.young_modulus_pa),
        ("thickness_m", table.thickness_m),
        ("foundation_pa_per_m", table.foundation_pa_per_m),
    ];
    let given = |keys: &[(&str, Option<f64>)]| keys.iter().any(|(_, value)| value.is_some());
    exactly_one(&at, &[("mesh_n_per_m", given(&constants)), ("young_modulus_pa", given(&skin))])?;
    let value = |(key, value): (&str, Option<f64>), with: &str| {
        let value = value
            .ok_or_else(|| Fault::value(at.clone(), format!("[{at}] lacks the key `{key}`, which goes with {with}")))?;
        positive(&at, key, value)
    };
    if given(&constants) {
        let [mesh_n_per_m, anchor_n_per_m] = constants;
        return Ok(Constants {
            mesh_n_per_m: value(mesh_n_per_m, "`anchor_n_per_m`")?,
            anchor_n_per_m: value(anchor_n_per_m, "`mesh_n_per_m`")?,
        });
    }
    let with = "`young_modulus_pa`, `thickness_m` and `foundation_pa_per_m`";
    let [young_pa, thickness_m, foundation_pa_per_m] =
        [value(skin[0], with)?, value(skin[1], with)?, value(skin[2], with)?];
    let mean_area_m2 = areas_m2.iter().sum::<f64>() / areas_m2.len() as f64;
    Ok(Constants {
        // K_m = (√3/2) E t, K_h = foundation times a vertex's area
        mesh_n_per_m: 0.75_f64.sqrt() * young_pa * thickness_m,
        anchor_n_per_m: foundation_pa_per_m * mean_area_m2,
    })
}

pub(super) fn masses(table: &SpringsTable, areas_m2: &[f64]) -> Result<Vec<f64>, Fault> {
    let at = at();
    let keys = [("area_density_kg_per_m2", table.area_density_kg_per_m2), ("vertex_mass_kg", table.vertex_mass_kg)];
    let key = exactly_one(&at, &keys.map(|(key, value)| (key, value.is_some())))?;
    let value = keys.iter().find_map(|(_, value)| *value).unwrap_or_default();
    let value = positive(&at, key, value)?;
    let each = |area_m2: &f64| if table.vertex_mass_kg.is_some() { value } else { value * area_m2 };
    Ok(areas_m2.iter().map(each).collect())
}

pub(super) fn damping(table: &SpringsTable, mass_kg: &[f64], settings: &mut Settings) -> Result<(), Fault> {
    let Some(damping) = table.damping_n_s_per_m else { return Ok(()) };
    let at = at().key("damping_n_s_per_m");
    if settings.mass_damping_per_s != 0.0 {
        let message = format!("{at} and numerics.mass_damping_per_s say the same in two ways");
        return Err(Fault::value(at, message).help("remove one of the two"));
    }
    check(&at, damping, damping >= 0.0 && damping.is_finite(), "must be finite and not negative")?;
    let mean_kg = mass_kg.iter().sum::<f64>() / mass_kg.len() as f64;
    settings.mass_damping_per_s = damping / mean_kg;
    Ok(())
}

pub(super) fn anchor_law(table: &SpringsTable) -> Result<AnchorLaw, Fault> {
    let law = match (table.anchor_cubic_per_m2, &table.anchor_layer) {
        (None, None) => return Ok(AnchorLaw::Linear),
        (Some(per_m2), None) => AnchorLaw::cubic(per_m2),
        (None, Some(layers)) => {
            let layer = |layer: &AnchorLayerTable| Layer {
                thickness_m: layer.thickness_m,
                stiffness_ratio: layer.stiffness_ratio,
            };
            AnchorLaw::layers(&layers.iter().map(layer).collect::<Vec<_>>())
        }
        (Some(_), Some(_)) => {
            let message = "`anchor_cubic_per_m2` and `anchor_layer` are two laws of one spring";
            return Err(Fault::value(at().key("anchor_layer"), message).help("remove one of the two"));
        }
    };
    let key = if table.anchor_layer.is_some() { "anchor_layer" } else { "anchor_cubic_per_m2" };
    law.map_err(|error| Fault::value(at().key(key), error.to_string()).cause(error))
}

/// Constants where the surface is refined, and their table.
pub(super) fn fine(
    refine: &RefineTable,
    (coarse, surface): (&Constants, &Triangulation),
    files: &Files<'_>,
) -> Result<(Constants, Option<ConstantsTable>), Fault> {
    let at = at().key("refine");
    let own = refine.mesh_n_per_m.is_some() || refine.anchor_n_per_m.is_some();
    exactly_one(
        &at,
        &[
            ("constants", refine.constants.is_some()),
            ("table_file", refine.table_file.is_some()),
            ("mesh_n_per_m", own),
        ],
    )?;
    if let Some(file) = &refine.table_file {
        let at = at.key("table_file");
        let table = table(file, &at, files)?;
        table
            .fits(surface, &Calibration { coarse: *coarse, rings: refine.rings, ..table.of })
            .map_err(|error| Fault::value(at, format!("{file}: {error}")).help(AGAIN).cause(error))?;
        return Ok((*coarse, Some(table)));
    }
    if let Some(constants) = refine.constants {
        let fine = match constants {
            ConstantsName::Unchanged => *coarse,
            ConstantsName::Area => matching::area_consistent(coarse),
        };
        return Ok((fine, None));
    }
    let (Some(mesh_n_per_m), Some(anchor_n_per_m)) = (refine.mesh_n_per_m, refine.anchor_n_per_m) else {
        let message = format!("[{at}] gives one of `mesh_n_per_m` and `anchor_n_per_m`, which go together");
        return Err(Fault::value(at, message));
    };
    let mesh_n_per_m = positive(&at, "mesh_n_per_m", mesh_n_per_m)?;
    Ok((Constants { mesh_n_per_m, anchor_n_per_m: positive(&at, "anchor_n_per_m", anchor_n_per_m)? }, None))
}

fn table(file: &str, at: &Where, files: &Files<'_>) -> Result<ConstantsTable, Fault> {
    let path = files.resolve(at, file)?;
    let text = files.limits.read_text(&path).map_err(|error| {
        Fault::value(at.clone(), format!("cannot read {}: {error}", path.display())).help(AGAIN).cause(error)
    })?;
    serde_json::from_str(&text).map_err(|error| {
        Fault::value(at.clone(), format!("{} is no table of spring constants: {error}", path.display()))
            .help(AGAIN)
            .cause(error)
    })
}
