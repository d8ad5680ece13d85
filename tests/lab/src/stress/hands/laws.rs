//! Random presses of blocks of every law, with Poisson's ratios from 0.3 to 0.4999.
use super::{
    BODIES,
    presses::{Pressed, press_all},
};
use crate::random::Random;
use crate::{
    bodies::material,
    stress::{Options, Outcome},
};
use miette::{Result, miette};
use palpate_physics::{
    ModelSpec,
    material::{Law, Material},
};

pub(in crate::stress) const CRITERION: &str = "the presses of `presses`, on blocks of a random law and Poisson's ratio from 0.3 to 0.4999: the same; \
     the force may fall where the law bears less the more it is compressed";

/// Poisson's ratio is so far below ½.
const BELOW_HALF: [f64; 2] = [1e-4, 0.2];
const YOUNG_MODULUS_PA: f64 = 10e3;

pub(in crate::stress) fn run(options: &Options) -> Result<Outcome> {
    let blocks = BODIES.iter().filter(|shipped| shipped.body.slow_m_per_s > 0.0);
    press_all(blocks, options.pick(1, 8, 1000), options.seed, &of_any_law)
}

/// The same body of another material, with the viscosity that it has.
fn of_any_law(spec: &ModelSpec, random: &mut Random) -> Result<Pressed> {
    let law = Law::ALL[random.below(Law::ALL.len())];
    let poisson_ratio = 0.5 - random.log_within(BELOW_HALF[0], BELOW_HALF[1]);
    let made = material(law, YOUNG_MODULUS_PA, poisson_ratio)?;
    let mut spec = spec.clone();
    let solid = spec.body.solid_mut().ok_or_else(|| miette!("a block is not made of tets"))?;
    for region in &mut solid.regions {
        region.material = Material { viscosity: region.material.viscosity, ..made };
    }
    let told = format!("{law:?}, Poisson's ratio {poisson_ratio:.4}, ");
    Ok(Pressed { spec, may_not_fall: law.weakens_below().is_none(), told })
}
