//! A body that rings undamped for up to ten million ticks: no drift of its energy, no allocation, the same bits again.
//!
//! The energy `K + U` of the moment oscillates by O((ω dt)²), so drift is of means: over the last hundredth of the run, or second, against
//! the first. Beside it stands the same of the energy that leapfrog conserves, `K + U − ⅛ dt² Σ f²/m`.
use super::{Extent, Measured, Options, Outcome, meshes, rig, rig::Drive, rig::Rig};
use crate::bodies::material;
use crate::random::Random;
use assert_no_alloc::assert_no_alloc;
use glam::DVec3;
use indicatif::{ProgressBar, ProgressStyle};
use miette::Result;
use palpate_physics::{Substeps, material::Law, snapshot};
use std::time::{Duration, Instant};

pub(super) const CRITERION: &str =
    "10^7 ticks (short: 10^5): undamped drift of energy < 1e-6 (f64), no allocation, bit-identical repeat";

/// Ticks between two looks at the clock.
const CHUNK: u64 = 1_000;
const REPORT_EVERY: Duration = Duration::from_secs(10);

/// Gradient of the velocity at the start (1/s): strains of about 1e-4.
const RATE_PER_S: f64 = 0.1;
/// Substeps over those of the spectrum.
const FINER: [u32; 2] = [1, 4];
const SECOND_ORDER: &str = "at the default step the energy of the moment is off by O((omega dt)^2), 4e-3, and the mean over a second still carries a \
                            part of that; the long form's means over 100 s do not, nor does the finer step";

/// Energies of a run, over the energy at its start, less 1.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Drift {
    largest: f64,
    of_mean: f64,
    /// Of the conserved energy.
    conserved_largest: f64,
    conserved_of_mean: f64,
    quarantined: bool,
}

pub(super) fn run(options: &Options) -> Result<Outcome> {
    let ticks = options.pick(10_000, 100_000, 10_000_000);
    let mut outcome = Outcome::passing();
    outcome.push(Measured::value("ticks", ticks as f64, "ticks"));
    for finer in FINER {
        let mut first = ringing(options, finer)?;
        let started = Instant::now();
        let drift = soak(&mut first, ticks, options.extent, "first run");
        let elapsed_s = started.elapsed().as_secs_f64();
        let mut second = ringing(options, finer)?;
        soak(&mut second, ticks, options.extent, "second run");
        let name = |what: &str| format!("{what}, {} substeps", first.model.substeps());
        outcome.push(Measured::value(name("time per tick"), 1e6 * elapsed_s / ticks as f64, "us"));
        outcome.push(Measured::value(name("energy of the moment off by at most"), drift.largest, "1"));
        let of_mean = Measured::bounded(name("drift of its mean, start to end"), drift.of_mean.abs(), "1", 1e-6);
        // Only the default step is known to be too coarse for a mean over a second.
        outcome.push(if finer == 1 { of_mean.known_to_exceed(SECOND_ORDER, 1e-3) } else { of_mean });
        outcome.push(Measured::value(name("energy leapfrog conserves off by at most"), drift.conserved_largest, "1"));
        let of_mean = Measured::bounded(name("drift of its mean"), drift.conserved_of_mean.abs(), "1", 1e-6);
        outcome.push(if finer == 1 { of_mean.known_to_exceed(SECOND_ORDER, 1e-3) } else { of_mean });
        outcome.demand(!drift.quarantined, || name("a tick was refused"));
        let hashes = [&first, &second].map(|rig| snapshot::state_hash(&rig.state));
        outcome.demand(first.state == second.state && hashes[0] == hashes[1], || {
            name(&format!("the repeat ended in other bits: {:016x} and {:016x}", hashes[0], hashes[1]))
        });
    }
    outcome.push(Measured::bounded("allocations (one would have ended the program)", 0.0, "1", 0.0));
    Ok(outcome)
}

/// A free block that spins slowly and rings in all its modes, with `finer` times the substeps of its spectrum.
fn ringing(options: &Options, finer: u32) -> Result<Rig> {
    let mut spec = rig::body(options, meshes::block(3)?, material(Law::StableNeoHookean, 10e3, 0.4)?);
    let measured = Rig::new(spec.clone())?.model.substeps();
    spec.settings.substeps = Substeps::Fixed(finer * measured);
    let mut rig = Rig::new(spec)?;
    let mut random = Random::new(options.seed);
    for (v, x) in rig.state.mechanical.v.iter_mut().zip(&rig.state.mechanical.x) {
        let rates = DVec3::new(0.3, -0.2, 0.5).cross(*x) + DVec3::new(x.y, -x.z, x.x) + random.vector() * 1e-3;
        *v = rates * RATE_PER_S;
    }
    Ok(rig)
}

fn soak(rig: &mut Rig, ticks: u64, extent: Extent, name: &'static str) -> Drift {
    let progress = Progress::new(ticks, extent, name);
    let drive = Drive::still(&rig.model);
    let start = energies_j(rig);
    // Shorter than a second the body's slowest motion would not average out.
    let window = (ticks / 100).max(CHUNK);
    let (mut drift, mut sums) = (Drift::default(), [[0.0; 2]; 2]);
    for from in (0..ticks).step_by(CHUNK as usize) {
        assert_no_alloc(|| {
            for tick in from..(from + CHUNK).min(ticks) {
                drift.quarantined |= rig.tick(&drive).quarantined.is_some();
                let (begins, ends) = (tick < window, tick >= ticks - window);
                if begins || ends || tick % 100 == 0 {
                    let [energy, conserved] = energies_j(rig);
                    let off = [energy / start[0] - 1.0, conserved / start[1] - 1.0];
                    drift.largest = drift.largest.max(off[0].abs());
                    drift.conserved_largest = drift.conserved_largest.max(off[1].abs());
                    for (sums, _) in sums.iter_mut().zip([begins, ends]).filter(|(_, part)| *part) {
                        sums.iter_mut().zip(off).for_each(|(sum, off)| *sum += off);
                    }
                }
            }
        });
        progress.report(from, &drift);
    }
    drift.of_mean = (sums[1][0] - sums[0][0]) / window as f64;
    drift.conserved_of_mean = (sums[1][1] - sums[0][1]) / window as f64;
    drift
}

/// Energy of the moment, and the one that leapfrog conserves (J).
fn energies_j(rig: &Rig) -> [f64; 2] {
    let energies = rig.energies();
    let held_j = energies.held_j() - energies.external_work_j;
    [held_j, held_j - rig.leapfrog_excess_j()]
}

/// A bar where there is a terminal, and a line every ten seconds where there is none.
struct Progress {
    bar: ProgressBar,
    name: &'static str,
    last: std::cell::Cell<Instant>,
    ticks: u64,
}

impl Progress {
    fn new(ticks: u64, extent: Extent, name: &'static str) -> Self {
        let bar = if extent == Extent::Long { ProgressBar::new(ticks) } else { ProgressBar::hidden() };
        if let Ok(style) = ProgressStyle::with_template("{msg} {bar:40} {human_pos} of {human_len} ticks, {eta} left") {
            bar.set_style(style);
        }
        bar.set_message(format!("soak, {name}"));
        Self { bar, name, last: Instant::now().into(), ticks }
    }

    fn report(&self, done: u64, drift: &Drift) {
        self.bar.set_position(done);
        if self.bar.is_hidden() && self.last.get().elapsed() > REPORT_EVERY {
            self.last.set(Instant::now());
            let (name, ticks) = (self.name, self.ticks);
            eprintln!("soak, {name}: {done} of {ticks} ticks, energy off by at most {:.2e}", drift.largest);
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
