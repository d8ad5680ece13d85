//! A body that has come to rest, left alone or computed on.
use super::{Found, pair};
use crate::{press::Press, timing::interleaved};
use miette::{IntoDiagnostic, Result, ensure};
use palpate_physics::{Model, Skips};

pub(super) const TOLERANCE_M: f64 = 1e-7;
const TETS: u32 = 1_352;
const AWAY_M: f64 = 20e-3;
const DAMPING_PER_S: f64 = 40.0;
/// Not asleep after so many ticks: it never will be.
const MOST_TICKS: usize = 20_000;

pub(super) fn run(rounds: usize) -> Result<Found> {
    let model = |sleep_tolerance_m: f64| -> Result<Model> {
        let mut spec = pair::scene(TETS, AWAY_M, Skips::default())?;
        spec.settings.mass_damping_per_s = DAMPING_PER_S;
        spec.settings.sleep_tolerance_m = sleep_tolerance_m;
        Model::build(spec).into_diagnostic()
    };
    let models = [model(TOLERANCE_M)?, model(0.0)?];
    let [mut sleepy, mut awake] = models.each_ref().map(|model| Press::new(model, 0.0, 1));
    let mut ticks = 0;
    while !sleepy.state().sleep.asleep {
        ensure!(ticks < MOST_TICKS, "the body did not fall asleep in {MOST_TICKS} ticks");
        ticks += 1;
        sleepy.tick();
        awake.tick();
    }
    let times = interleaved(&mut [Box::new(|| _ = sleepy.tick()), Box::new(|| _ = awake.tick())], rounds);
    ensure!(sleepy.state().sleep.asleep, "the body woke while it was timed");
    let farthest_m = pair::farthest_m(sleepy.state(), awake.state());
    Ok(Found { with: times[0], without: times[1], same_bits: sleepy.state() == awake.state(), farthest_m })
}
