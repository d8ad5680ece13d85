//! `[[material]]`: laws and constants, and which tets have them.
use super::{body::Body, regions::Regions};
use crate::document::{
    ConventionName, MaterialTable,
    source::{Fault, Where},
};
use palpate_physics::{
    Region,
    material::{Convention, Lame, Material, ParameterError, Viscosity, parameters},
};

pub(crate) struct Materials {
    pub(crate) regions: Vec<Region>,
    pub(crate) tet_region: Vec<u16>,
    pub(crate) warnings: Vec<String>,
}

/// Materials, the later ones over the earlier; a tet without one is an error.
pub(crate) fn compile(tables: &[MaterialTable], regions: &Regions<'_>, body: &Body) -> Result<Materials, Fault> {
    let mut found = Vec::new();
    let mut owner: Vec<Option<u16>> = vec![None; body.mesh.tet_count()];
    let mut warnings = Vec::new();
    for (index, table) in tables.iter().enumerate() {
        let at = Where::root("material").index(index);
        let name = table.region.as_deref().unwrap_or("whole");
        let number = u16::try_from(index).map_err(|_| Fault::value(at.clone(), "more than 65536 materials"))?;
        for tet in regions.tets(name, &at.key("region"))? {
            owner[tet as usize] = Some(number);
        }
        found.push(material(table, name, &at)?);
    }
    let bare = owner.iter().filter(|tet| tet.is_none()).count();
    if bare > 0 {
        let message = format!("{bare} of {} tets have no material", owner.len());
        return Err(Fault::value(Where::root("material"), message)
            .help("put a [[material]] without `region` first; later ones override it in theirs"));
    }
    for (index, region) in found.iter().enumerate() {
        if !owner.contains(&Some(index as u16)) {
            warnings.push(format!("the material \"{}\" is overridden everywhere by later ones", region.name));
        }
    }
    Ok(Materials { regions: found, tet_region: owner.into_iter().flatten().collect(), warnings })
}

/// A material's constants before its convention's factors.
pub(super) struct Constants {
    pub(super) lame: Lame,
    pub(super) viscosity: Viscosity,
    pub(super) convention: Convention,
    pub(super) density_kg_per_m3: f64,
}

/// The constants, checked.
pub(super) fn constants(table: &MaterialTable, at: &Where) -> Result<Constants, Fault> {
    let refused = |error: ParameterError| parameter_fault(at, error);
    Ok(Constants {
        lame: lame(table, at)?,
        viscosity: Viscosity::new(table.viscosity_phi_pa_s, table.viscosity_psi_pa_s).map_err(refused)?,
        convention: match table.convention {
            ConventionName::Consistent => Convention::Consistent,
            ConventionName::Paper2006 => Convention::Paper2006,
            ConventionName::Paper2005 => Convention::Paper2005,
        },
        density_kg_per_m3: parameters::checked_density(table.density_kg_per_m3).map_err(refused)?,
    })
}

fn material(table: &MaterialTable, region: &str, at: &Where) -> Result<Region, Fault> {
    let Constants { lame, viscosity, convention, density_kg_per_m3 } = constants(table, at)?;
    let material = Material::new(table.law.0, lame, viscosity, convention);
    if material.prefers_collapse() {
        let (key, value) = match (table.poisson_ratio, table.lambda_pa) {
            (Some(ratio), _) => ("poisson_ratio", ratio),
            (None, lambda_pa) => ("lambda_pa", lambda_pa.unwrap_or_default()),
        };
        let message = format!(
            "{} = {value}: with less than 0 a body of the law \"{}\" stores less energy crushed to a point than at rest, and would collapse",
            at.key(key),
            table.law.0.name()
        );
        return Err(Fault::value(at.key(key), message).help("give 0 or more, or another law"));
    }
    Ok(Region { name: table.name.clone().unwrap_or_else(|| region.to_owned()), material, density_kg_per_m3 })
}

fn lame(table: &MaterialTable, at: &Where) -> Result<Lame, Fault> {
    let MaterialTable { young_modulus_pa, poisson_ratio, lambda_pa, mu_pa, .. } = table;
    match (young_modulus_pa, poisson_ratio, lambda_pa, mu_pa) {
        (Some(e), Some(nu), None, None) => Lame::from_young_poisson(*e, *nu),
        (None, None, Some(lambda), Some(mu)) => Lame::new(*lambda, *mu),
        _ => {
            let message =
                "a material needs young_modulus_pa with poisson_ratio, or lambda_pa with mu_pa, and not both pairs";
            return Err(Fault::value(at.clone(), message));
        }
    }
    .map_err(|error| parameter_fault(at, error))
}

/// The error at the key it speaks of.
fn parameter_fault(at: &Where, error: ParameterError) -> Fault {
    let key = match &error {
        ParameterError::YoungModulus(_) => "young_modulus_pa",
        ParameterError::PoissonRatio(_) => "poisson_ratio",
        ParameterError::Lame { .. } => "lambda_pa",
        ParameterError::Density(_) => "density_kg_per_m3",
        ParameterError::Viscosity { name, .. } => name,
    };
    Fault::value(at.key(key), error.to_string()).cause(error)
}
