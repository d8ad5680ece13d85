//! Random presses.
//!
//! Found by it: at 1.3 tool radii the force of a slow press fell from 2.3 N to nothing and the tool was buried; of thirty
//! quick ones twelve ended in quarantine.
use super::{
    BODIES,
    hand::Press,
    spec,
    watch::{self, Found, watch},
};
use crate::stress::{Measured, Options, Outcome, random::Random};
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
            if let Some(tick) = found.quarantined {
                outcome.broken.push(format!("{}: quarantined at tick {tick}", at()));
            }
            outcome.demand(!found.is_inside, || format!("{}: the tool is inside the body", at()));
            outcome.demand(!found.lets_go, || format!("{}: no force at {:.1} mm of depth", at(), 1e3 * found.depth_m));
            outcome.demand(found.fall_in_a_tick <= watch::MOST_IN_A_TICK, || {
                format!("{}: the force fell by {:.0} % in a tick", at(), 100.0 * found.fall_in_a_tick)
            });
            outcome.demand(found.fall_in_20_ms <= watch::MOST_IN_20_MS, || {
                format!("{}: the force fell by {:.0} % in 20 ms", at(), 100.0 * found.fall_in_20_ms)
            });
            outcome.demand(found.imbalance <= watch::MOST_IMBALANCE, || {
                format!("{}: {:.3} of what moved came from nowhere or went there", at(), found.imbalance)
            });
            worst = worst.worse(&found);
        }
        let name = |what: &str| format!("{}: {what}", body.name);
        outcome.push(Measured::value(name("largest force"), worst.force_n, "N"));
        outcome.push(Measured::value(name("ticks taken back"), f64::from(worst.repeated), "ticks"));
        outcome.push(Measured::value(name("most substeps over the model's"), worst.substeps, "1"));
        outcome.push(Measured::bounded(
            name("error of the ledger over what moved"),
            worst.imbalance,
            "1",
            watch::MOST_IMBALANCE,
        ));
    }
    Ok(outcome)
}
