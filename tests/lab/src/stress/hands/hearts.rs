//! Random presses of irregular hearts: each heart is another one, and a hand that is down is dragged along its wall.
//!
//! Written after hearts of a script like it: those that were pressed beside the held base flew apart, since particles outside the coarse tets took mass
//! from nodes by negative weights; and light nodes far outside of the body were faster than the substeps.
use super::{
    Body,
    hand::Press,
    watch::{Found, watch},
};
use crate::{
    hearts::Heart,
    random::Random,
    stress::{Options, Outcome},
};
use miette::{IntoDiagnostic, Result, WrapErr};
use palpate_physics::Model;

pub(in crate::stress) const CRITERION: &str = "random presses of irregular hearts (any axis, thin apex, papillary muscles, noisy voxels; nu 0.3 to 0.49) at \
     0.05 to 5 m/s, dragged 5 to 30 mm: finite, no quarantine, no tool inside, force where there is depth, ledger within 5 %";

/// Presses of each heart.
const PRESSES: usize = 3;
/// Lengths (m) of a drag.
const DRAG_M: [f64; 2] = [5e-3, 30e-3];
/// A heart's wall is some 10 mm thick; its force may fall, for it may give way as a whole.
const HEART: Body = Body { name: "heart", slow_m_per_s: 0.0, edge_m: 0.04, rigid_depth_m: 0.005, is_closed: true };

pub(in crate::stress) fn run(options: &Options) -> Result<Outcome> {
    let (hearts, presses) = (options.pick(1, 4, 100), options.pick(1, PRESSES, PRESSES));
    let (mut outcome, mut worst) = (Outcome::passing(), Found::default());
    for number in 0..hearts {
        let seed = options.seed.wrapping_add(number);
        let heart = Heart::random(seed).wrap_err_with(|| format!("the heart of seed {seed}"))?;
        let bare = Model::build(heart.spec.clone()).into_diagnostic()?;
        let mut random = Random::new(!seed);
        for _ in 0..presses {
            let (direction, length_m) = (random.vector(), random.within(DRAG_M[0], DRAG_M[1]));
            let press = Press::random(&bare, &HEART, &mut random)?.dragged(direction, length_m);
            let found = watch(&heart.spec, &HEART, &press)?;
            found.judge(false, &mut outcome, &|| format!("seed {seed} ({}; {press})", heart.told));
            worst = worst.worse(&found);
        }
    }
    worst.push(HEART.name, &mut outcome);
    Ok(outcome)
}
