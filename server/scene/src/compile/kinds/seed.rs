//! `[body.seed]`: the papers' hybrid around a body's tets.
use super::{BodyKind, Compiled, Ingredients, mass_kg};
use crate::{
    compile::{Files, body::Body, check, located::Located, material},
    document::{
        Document, NumericsTable,
        body::BodyTable,
        seed::{SeedLayerTable, SeedTable},
        source::{Fault, Where},
    },
    limits::Limits,
    shapes::seeds::ellipsoid_surface,
    skin::FineSurface,
};
use glam::DVec3;
use palpate_physics::{
    BodySpec, Settings,
    bodies::seed::{LayerSpec, PaperModel, SeedBodySpec, SeedParameters},
    contact::is_inside,
    material::Law,
};

const FEWEST_TRIANGLES: u32 = 20;

fn at() -> Where {
    Where::root("body").key("seed")
}

/// The papers' own hybrid.
#[derive(Debug)]
pub(super) struct Seed;

impl BodyKind for Seed {
    /// Puts the layer's surface on the body: parts go over to it, and what acts on its surface acts there.
    fn put_surface_on(
        &self,
        body: &mut Body,
        table: &BodyTable,
        _: &Where,
        files: &Files<'_>,
        progress: &mut dyn FnMut(f64, &str),
    ) -> Result<(), Fault> {
        let Some(layer) = table.seed.as_ref().and_then(|seed| seed.layer.as_ref()) else { return Ok(()) };
        progress(0.75, "making the skin");
        demand_layer(layer, files.limits)?;
        let (positions_m, triangles) = ellipsoid_surface(layer.outer_semi_axes_m.into(), layer.triangles);
        let outer = body.parts.iter().position(|part| part.name == "outer").map_or(u32::MAX, |number| number as u32);
        let skin = FineSurface { origins: vec![outer; triangles.len()], positions_m, triangles };
        for (number, part) in (0..).zip(&mut body.parts) {
            part.go_over_to(&skin, |origin| origin == number);
        }
        body.first_vertex = Some(body.mesh.positions_m().len() as u32);
        body.skin = Some(skin);
        Ok(())
    }

    fn compile(&self, ingredients: Ingredients<'_>, _: &mut Settings) -> Result<Compiled, Fault> {
        let core = ingredients.solid()?;
        let Ingredients { document, body, .. } = ingredients;
        let Some(table) = &document.body.seed else {
            return Err(Fault::value(at(), "there is no [body.seed]".to_owned()));
        };
        demand(document)?;
        let parameters = parameters(document, table)?;
        let layer = table.layer.as_ref().zip(body.skin.as_ref()).map(|(layer, skin)| LayerSpec {
            skin_m: skin.positions_m.clone(),
            skin_triangles: skin.triangles.clone(),
            particles: layer.particles,
        });
        let spec = SeedBodySpec { core, layer, parameters };
        let volume_m3 = spec.volume_m3(&body.surface);
        Ok(Compiled {
            mass_kg: mass_kg(&spec.core, volume_m3),
            volume_m3,
            spec: BodySpec::Seed(spec),
            warnings: Vec::new(),
        })
    }

    /// In the core, or the nearest of the skin: nothing is known between them.
    fn locate(&self, body: &Body, point_m: DVec3) -> Located {
        let Some(skin) = &body.skin else { return body.mesh.locate(body.triangles(), point_m) };
        body.mesh.inside(point_m).unwrap_or_else(|| {
            let nearest = Located::nearest(&skin.positions_m, skin.triangles.iter().copied(), point_m);
            let is_inside = is_inside(point_m, &skin.triangles, &skin.positions_m);
            Located {
                nodes: nearest.nodes.map(|vertex| vertex + body.first_vertex.unwrap_or_default()),
                distance_m: if is_inside { 0.0 } else { nearest.distance_m },
                ..nearest
            }
        })
    }

    fn no_capsules(&self) -> Option<&'static str> {
        Some("a capsule does not press a seed body, which is touched at one triangle")
    }
}

fn demand_layer(layer: &SeedLayerTable, limits: &Limits) -> Result<(), Fault> {
    let at = at().key("layer");
    let axes_ok = layer.outer_semi_axes_m.iter().all(|axis| *axis > 0.0);
    check(&at.key("outer_semi_axes_m"), DVec3::from(layer.outer_semi_axes_m), axes_ok, "all must be larger than 0")?;
    let most = limits.tets;
    let triangles_ok = (FEWEST_TRIANGLES..=most).contains(&layer.triangles);
    check(&at.key("triangles"), layer.triangles, triangles_ok, &format!("must be {FEWEST_TRIANGLES} to {most} here"))?;
    let particles_ok = (1..=most).contains(&layer.particles);
    check(&at.key("particles"), layer.particles, particles_ok, &format!("must be 1 to {most} here"))
}

fn parameters(document: &Document, table: &SeedTable) -> Result<SeedParameters, Fault> {
    let constants = material::constants(&document.material[0], &Where::root("material").index(0))?;
    let dt_s = table.step_s.unwrap_or(document.scene.tick_period_s);
    check(&at().key("step_s"), dt_s, dt_s > 0.0, "must be larger than 0")?;
    let parameters = SeedParameters {
        convention: constants.convention,
        lame: constants.lame,
        viscosity: constants.viscosity,
        density_kg_per_m3: constants.density_kg_per_m3,
        dt_s,
        ..SeedParameters::paper_2006(PaperModel::Hybrid)
    };
    Ok(if table.repairs { parameters } else { parameters.as_printed() })
}

/// What seed bodies cannot have, at its key.
fn demand(document: &Document) -> Result<(), Fault> {
    let refuse = |at: Where, message: &str, help: &str| Err(Fault::value(at, message).help(help));
    if document.body.particles.is_some() {
        let message = "[body.particles] and [body.seed] are two kinds of hybrid body";
        return refuse(at(), message, "leave one of them out; the papers' particles are in [body.seed.layer]");
    }
    let materials = Where::root("material");
    match document.material.as_slice() {
        [one] if one.law.0 != Law::StVenantKirchhoff => {
            return refuse(
                materials.index(0).key("law"),
                "a seed body is of St. Venant-Kirchhoff material",
                "write law = \"stvk\"",
            );
        }
        [_] => {}
        _ => {
            let message = "a seed body has one material, of core and layer";
            return refuse(materials.index(1), message, "leave one [[material]]");
        }
    }
    if document.scene.gravity_m_per_s2 != [0.0; 3] {
        let message = "a seed body has no gravity: its particles are made without";
        return refuse(Where::root("scene").key("gravity_m_per_s2"), message, "leave it out");
    }
    if !document.prescribed.is_empty() {
        let message = "what holds a seed body does not move";
        return refuse(Where::root("prescribed").index(0), message, "use [[fixed]]");
    }
    for (index, fixed) in document.fixed.iter().enumerate() {
        if ["x", "y", "z"].iter().any(|axis| !fixed.axes.0.contains(axis)) {
            let message = "nodes of a seed body are held along all axes or none";
            return refuse(Where::root("fixed").index(index).key("axes"), message, "leave `axes` out");
        }
    }
    if document.numerics != NumericsTable::default() {
        let message = "a seed body is integrated as the papers do: particles by their Verlet, the core by their semi-implicit scheme";
        return refuse(Where::root("numerics"), message, "leave [numerics] out; the step is body.seed.step_s");
    }
    Ok(())
}
