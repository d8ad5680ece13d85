//! Hands on pans: hollow surfaces of springs so flat that a tool reaches the far wall through the near one.
//!
//! Found by a hand like these: the near wall passed the far one beneath the tool, which was then held by the far wall's outer side for ever.
use super::{
    hand::{LARGEST_FORCE_N, random_coupling, told},
    watch::{LOOK_EVERY, LedgerSeen, MOST_IMBALANCE},
};
use crate::{
    random::Random,
    stress::{
        Measured, Options, Outcome,
        rig::{Drive, Rig},
    },
};
use glam::DVec3;
use miette::Result;
use palpate_physics::{
    ModelSpec,
    contact::{ToolShape, ToolSpec, ToolTarget, is_inside},
};
use palpate_scene::Limits;
use std::fmt;

pub(in crate::stress) const CRITERION: &str = "random hands at 0.05 to 1 m/s through hollow pans of springs 4 to 16 mm thick: finite, no quarantine, no tool inside \
     or where one wall has passed another, ledger within 5 %";

/// Corners of a hand's way beside its start.
const CORNERS: usize = 5;
/// Within this of the pan's middle (m), sideways and upwards, lowest and highest.
const ASIDE_M: f64 = 34e-3;
const HEIGHT_M: [f64; 2] = [-14e-3, 16e-3];

/// A pan and the hand that goes through it.
struct Reach {
    half_height_mm: f64,
    tool: ToolSpec,
    corners_m: Vec<DVec3>,
    speed_m_per_s: f64,
}

impl Reach {
    fn random(random: &mut Random) -> Self {
        let (half_height_mm, radius_m) = (random.within(2.0, 8.0), random.within(3e-3, 8e-3));
        let coupling = random_coupling(0.7, random);
        let shape = if random.chance(0.7) {
            ToolShape::Sphere
        } else {
            ToolShape::capsule(coupling, radius_m, radius_m * random.within(0.5, 1.5), random.vector())
        };
        let above_m = 1e-3 * half_height_mm + radius_m + shape.half_length_m();
        let start_position_m = DVec3::new(random.within(-0.01, 0.01), random.within(-0.01, 0.01), above_m + 5e-3);
        let corner = |_| {
            DVec3::new(
                random.within(-ASIDE_M, ASIDE_M),
                random.within(-ASIDE_M, ASIDE_M),
                random.within(HEIGHT_M[0], HEIGHT_M[1]),
            )
        };
        let corners_m = (0..CORNERS).map(corner).collect();
        let friction_coefficient = random.within(0.0, 0.6);
        let name = "hand".to_owned();
        let tool = ToolSpec { name, shape, radius_m, coupling, friction_coefficient, start_position_m };
        Self { half_height_mm, tool, corners_m, speed_m_per_s: random.log_within(0.05, 1.0) }
    }

    fn spec(&self) -> Result<ModelSpec> {
        let (outer_mm, inner_mm) = (self.half_height_mm, 0.6 * self.half_height_mm);
        let text = format!(
            "[scene]\nname = \"pan\"\n[body.ellipsoid_shell]\ninner_semi_axes_mm = [28, 28, {inner_mm}]\n\
             outer_semi_axes_mm = [30, 30, {outer_mm}]\ntarget_tets = 4000\n[body.springs]\npart = \"outer\"\nmesh_n_per_m = 60\n\
             anchor_n_per_m = 12\narea_density_kg_per_m2 = 15\ndamping_n_s_per_m = 0.02\n[body.springs.refine]\nrings = 2\n\
             mesh_n_per_m = 36\nanchor_n_per_m = 6.2\n"
        );
        let scene = palpate_scene::parse(&text, "pan", None, &Limits::local(), &mut |_, _| {})?;
        Ok(ModelSpec { tools: vec![self.tool.clone()], ..scene.model })
    }
}

impl fmt::Display for Reach {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.1} mm thick, {}, {:.2} m/s", 2.0 * self.half_height_mm, told(&self.tool), self.speed_m_per_s)
    }
}

#[derive(Debug, Clone, Copy, Default)]
struct Found {
    quarantined: Option<u64>,
    /// Tick in which the tool's centre was inside the surface, or where a wall has passed another.
    enclosed: Option<u64>,
    imbalance: f64,
    force_n: f64,
}

pub(in crate::stress) fn run(options: &Options) -> Result<Outcome> {
    let (mut outcome, mut imbalance, mut force_n) = (Outcome::passing(), 0.0_f64, 0.0_f64);
    for number in 0..options.pick(3, 25, 1000) {
        let seed = options.seed.wrapping_add(number);
        let reach = Reach::random(&mut Random::new(seed));
        let found = watch(&reach)?;
        let at = || format!("seed {seed} ({reach})");
        if let Some(tick) = found.quarantined {
            outcome.broken.push(format!("{}: quarantined at tick {tick}", at()));
        }
        if let Some(tick) = found.enclosed {
            outcome.broken.push(format!("{}: the tool is enclosed at tick {tick}", at()));
        }
        outcome.demand(found.imbalance <= MOST_IMBALANCE, || {
            format!("{}: {:.3} of what moved came from nowhere or went there", at(), found.imbalance)
        });
        (imbalance, force_n) = (imbalance.max(found.imbalance), force_n.max(found.force_n));
    }
    outcome.push(Measured::value("largest force", force_n, "N"));
    outcome.push(Measured::bounded("error of the ledger over what moved", imbalance, "1", MOST_IMBALANCE));
    Ok(outcome)
}

/// Goes through the corners, and watches.
fn watch(reach: &Reach) -> Result<Found> {
    let mut rig = Rig::new(reach.spec()?)?;
    let mut drive = Drive::still(&rig.model);
    let period_s = rig.model.settings().tick_period_s;
    let triangles = rig.model.surface().triangles.clone();
    let (mut found, mut surface_m, mut ledger) = (Found::default(), Vec::new(), LedgerSeen::NOTHING);
    let mut at_m = reach.tool.start_position_m;
    for corner_m in &reach.corners_m {
        while at_m != *corner_m {
            // Where its arm can render no more, a hand goes on to the next corner.
            if rig.state.mechanical.tools[0].device_force_n.length() > LARGEST_FORCE_N {
                break;
            }
            at_m = at_m.move_towards(*corner_m, reach.speed_m_per_s * period_s);
            drive.tools[0] = ToolTarget { orientation: reach.tool.start().orientation, ..ToolTarget::at(at_m) };
            if let Some(quarantine) = rig.tick(&drive).quarantined {
                found.quarantined = Some(quarantine.tick);
                return Ok(found);
            }
            let tool = &rig.state.mechanical.tools[0];
            found.force_n = found.force_n.max(tool.contact_force_n.length());
            let tick = rig.state.mechanical.tick;
            if tick.is_multiple_of(LOOK_EVERY.into()) {
                ledger.look(&rig.energies());
                rig.model.surface_positions_m(&rig.state, &mut surface_m);
                if is_inside(tool.centre_m, &triangles, &surface_m) {
                    found.enclosed = found.enclosed.or(Some(tick));
                }
            }
        }
    }
    found.imbalance = ledger.imbalance();
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_physics::contact::Coupling;

    /// They stretched triangles of 1.8 mm to 10 and 17 mm, and passed between the samples of one into the pan.
    #[test]
    fn rigid_tools_do_not_pass_between_the_samples_of_a_stretched_surface() {
        for seed in [59, 94] {
            let reach = Reach::random(&mut Random::new(seed));
            assert_eq!(reach.tool.coupling, Coupling::Rigid);
            let found = watch(&reach).unwrap();
            assert_eq!((found.quarantined, found.enclosed), (None, None), "{seed}");
        }
    }
}
