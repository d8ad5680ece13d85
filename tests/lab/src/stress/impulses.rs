//! Random impulses on random nodes of a free body, in bursts and pauses.
use super::{Measured, Options, Outcome, meshes, rig, rig::Drive, rig::Rig};
use crate::bodies::material;
use crate::random::Random;
use miette::Result;
use palpate_physics::{PointForce, Substeps, material::Law};

pub(super) const CRITERION: &str = "10^4 random impulses: energy held <= work done (1 + 1e-6)";

const SECOND_ORDER: &str = "leapfrog holds K + U - dt^2/8 f_i.f/m (of a linear body exactly), not K + U: the energy of the moment exceeds \
                            the work by that term, O(dt^2), with no drift";

/// Substeps per tick and size of the forces (N).
const CASES: [(u32, f64); 4] = [(10, 0.2), (40, 0.2), (10, LINEAR_N), (40, LINEAR_N)];
/// Strains of about 1e-4: linear to 1e-6, and large enough that energies are not rounding.
const LINEAR_N: f64 = 2e-4;

pub(super) fn run(options: &Options) -> Result<Outcome> {
    let count = options.pick(1_000, 10_000, 100_000);
    let mut outcome = Outcome::passing();
    for (substeps, force_n) in CASES {
        let excess = excess(options, substeps, force_n, count, &mut outcome)?;
        let name = |what: &str| format!("{what}, {substeps} substeps, {force_n} N");
        outcome.push(
            Measured::bounded(name("energy above work / work"), excess.stated, "1", 1e-6)
                .known_to_exceed(SECOND_ORDER, 3e-3),
        );
        // The remainder is of third order: strain times the second-order term.
        let limit = 1e-6 + 0.01 * excess.stated;
        let own = Measured::bounded(name("of it not leapfrog's own"), excess.unexplained, "1", limit);
        // At large strain the trapezoid of the internal forces is not their work.
        outcome.push(if force_n == LINEAR_N { own } else { Measured { limit: Some(0.5 * excess.stated), ..own } });
    }
    Ok(outcome)
}

/// Largest excess of held energy over work, over the largest work until then.
struct Excess {
    stated: f64,
    /// Less what leapfrog is known to hold in the moment.
    unexplained: f64,
}

fn excess(options: &Options, substeps: u32, force_n: f64, count: u32, outcome: &mut Outcome) -> Result<Excess> {
    let mut spec = rig::body(options, meshes::block(4)?, material(Law::StableNeoHookean, 10e3, 0.4)?);
    spec.settings.substeps = Substeps::Fixed(substeps);
    let mut rig = Rig::new(spec)?;
    let mut random = Random::new(options.seed);
    let mut drive = Drive::still(&rig.model);
    let (mut work_j, mut stated, mut unexplained) = (0.0_f64, f64::NEG_INFINITY, f64::NEG_INFINITY);
    let (mut done, mut tick) = (0, 0);
    while done < count {
        drive.point_forces.clear();
        // Every fifth tick rests.
        if tick % 5 != 0 {
            let node = random.below(rig.state.mechanical.x.len()) as u32;
            drive.point_forces.push(PointForce { node, force_n: random.vector() * force_n });
            done += 1;
        }
        tick += 1;
        let report = rig.tick(&drive);
        if report.quarantined.is_some() {
            outcome.demand(false, || format!("{substeps} substeps, {force_n} N: quarantined after {done} impulses"));
            break;
        }
        let energies = rig.energies();
        work_j = work_j.max(energies.external_work_j);
        let over_j = energies.held_j() - energies.external_work_j;
        // The first tick has done nothing yet.
        if work_j > 0.0 {
            stated = stated.max(over_j / work_j);
            unexplained = unexplained.max((over_j - rig.leapfrog_excess_j()) / work_j);
        }
    }
    Ok(Excess { stated, unexplained })
}
