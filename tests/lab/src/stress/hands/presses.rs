//! Random presses.
//!
//! Found by it: at 1.3 tool radii the force of a slow press fell from 2.3 N to nothing and the tool was buried; of thirty
//! quick ones twelve ended in quarantine.
use super::{
    BODIES,
    hand::Press,
    spec,
    watch::{Found, watch},
};
use crate::stress::{Options, Outcome, random::Random};
use miette::{IntoDiagnostic, Result, WrapErr};
use palpate_physics::{Model, ModelSpec};

pub(in crate::stress) const CRITERION: &str = "random presses of shipped bodies at 0.05 to 5 m/s, to 20 N or 30 mm: finite, no quarantine, no tool inside, \
     force where there is depth; slow ones on blocks: force never down by 5 % in a tick or 20 % in 20 ms while the arm goes deeper";

pub(in crate::stress) fn run(options: &Options) -> Result<Outcome> {
    let presses = options.pick(2, 12, 1000);
    let mut outcome = Outcome::passing();
    for body in &BODIES {
        let spec = spec(body).wrap_err(body.name)?;
        let bare = Model::build(ModelSpec { tools: Vec::new(), ..spec.clone() }).into_diagnostic()?;
        let mut worst = Found::default();
        for number in 0..presses {
            let seed = options.seed.wrapping_add(number);
            let mut random = Random::new(seed);
            let press = Press::random(&bare, body, &mut random)?;
            let found = watch(&spec, body, &press)?;
            let at = || format!("{}, seed {seed} ({press})", body.name);
            found.judge(true, &mut outcome, &at);
            worst = worst.worse(&found);
        }
        worst.push(body.name, &mut outcome);
    }
    Ok(outcome)
}
