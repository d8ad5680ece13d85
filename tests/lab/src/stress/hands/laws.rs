//! Random presses of blocks of every law, with Poisson's ratios from 0.3 to 0.4999.
use super::{
    BODIES,
    hand::Press,
    spec,
    watch::{Found, watch},
};
use crate::{
    bodies::material,
    stress::{Options, Outcome, random::Random},
};
use miette::{IntoDiagnostic, Result, WrapErr};
use palpate_physics::{BodySpec, Model, ModelSpec, Region, material::Law};

pub(in crate::stress) const CRITERION: &str = "the presses of `presses`, on blocks of a random law and Poisson's ratio from 0.3 to 0.4999: the same; \
     the force may fall where the law bears less the more it is compressed";

/// Poisson's ratio is so far below ½.
const BELOW_HALF: [f64; 2] = [1e-4, 0.2];
const YOUNG_MODULUS_PA: f64 = 10e3;

pub(in crate::stress) fn run(options: &Options) -> Result<Outcome> {
    let presses = options.pick(1, 8, 1000);
    let mut outcome = Outcome::passing();
    for body in BODIES.iter().filter(|body| body.slow_m_per_s > 0.0) {
        let spec = spec(body).wrap_err(body.name)?;
        let bare = Model::build(ModelSpec { tools: Vec::new(), ..spec.clone() }).into_diagnostic()?;
        let mut worst = Found::default();
        for number in 0..presses {
            let seed = options.seed.wrapping_add(number);
            let mut random = Random::new(seed);
            let press = Press::random(&bare, body, &mut random)?;
            let law = Law::ALL[random.below(Law::ALL.len())];
            let poisson_ratio = 0.5 - random.log_within(BELOW_HALF[0], BELOW_HALF[1]);
            let found = watch(&of_law(&spec, law, poisson_ratio)?, body, &press)?;
            let at = || format!("{}, seed {seed} ({law:?}, Poisson's ratio {poisson_ratio:.4}, {press})", body.name);
            found.judge(law.weakens_below().is_none(), &mut outcome, &at);
            worst = worst.worse(&found);
        }
        worst.push(body.name, &mut outcome);
    }
    Ok(outcome)
}

/// The same body of another material, with the viscosity that it has.
fn of_law(spec: &ModelSpec, law: Law, poisson_ratio: f64) -> Result<ModelSpec> {
    let mut spec = spec.clone();
    let made = material(law, YOUNG_MODULUS_PA, poisson_ratio)?;
    for region in regions_mut(&mut spec.body) {
        let viscosity = region.material.viscosity;
        region.material = made;
        region.material.viscosity = viscosity;
    }
    Ok(spec)
}

fn regions_mut(body: &mut BodySpec) -> &mut [Region] {
    match body {
        BodySpec::Tet(solid) => &mut solid.regions,
        BodySpec::Hybrid(hybrid) => &mut hybrid.coarse.regions,
        _ => &mut [],
    }
}
