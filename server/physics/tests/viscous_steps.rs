//! The substeps of viscous bodies: enough to be stable, and hardly more.
#![allow(clippy::unwrap_used)]
use crate::rig;
use crate::support;
use palpate_physics::{
    BodySpec, Energies, ModelSpec, Precision, Settings, Substeps,
    bodies::{hybrid::Waking, tet::TetElements},
    material::{Law, Viscosity},
};
use rig::{Drive, Rig, body, bricks, even, hybrid_block, material, solid_mut, wake_nearest};
use support::Random;

/// Ticks of these bodies last so long that one substep more or less hardly matters.
const SUBSTEPS_ABOUT: f64 = 60.0;

fn tets(elements: TetElements) -> ModelSpec {
    let side = even(-0.02, 0.02, 4);
    let mut spec = body(bricks(&side, &side, &even(-0.02, 0.0, 2)), material(Law::StableNeoHookean, 10e3, 0.45));
    let BodySpec::Tet(tets) = &mut spec.body else { panic!("no tets") };
    tets.elements = elements;
    spec
}

fn hybrid(most_active: usize) -> ModelSpec {
    hybrid_block((0.02, 1, 6), 0.45, most_active, Waking::ByHand)
}

/// A viscous body whose substeps are as long as the rule allows, for itself at rest.
fn with_viscosity(mut spec: ModelSpec, viscosity: Viscosity) -> ModelSpec {
    for region in &mut solid_mut(&mut spec).regions {
        region.material.viscosity = viscosity;
    }
    spec.settings.precision = Precision::Double;
    spec.settings.stretch_allowance = 1.0;
    spec.settings.step_safety = 1.0;
    spec.settings.subcycle_unstable = false;
    spec.settings.long_coarse_steps = false;
    spec.settings.tick_period_s *= SUBSTEPS_ABOUT / f64::from(Rig::new(spec.clone()).model.substeps()).max(1.0);
    spec
}

/// Returns the number of substeps, and the energy after some ticks over that at the start: infinite where the body was
/// given up.
fn growth(spec: &ModelSpec, substeps: Substeps, wake: bool) -> (u32, f64) {
    let mut rig = Rig::new(ModelSpec { settings: Settings { substeps, ..spec.settings }, ..spec.clone() });
    if wake {
        wake_nearest(&mut rig, 200);
    }
    let mut random = Random(5);
    for v in &mut rig.state.mechanical.v {
        *v = random.vector() * 1e-6;
    }
    let (still, substeps) = (Drive::default(), rig.model.substeps());
    let start_j = Energies::of(&rig.model, &rig.state).held_j();
    for _ in 0..40 {
        if rig.tick(&still).quarantined.is_some() {
            return (substeps, f64::INFINITY);
        }
    }
    (substeps, Energies::of(&rig.model, &rig.state).held_j() / start_j)
}

/// The rule adds the largest eigenvalues of stiffness and of damping, which no mode need have both; and it is made for
/// all particles awake, of which the hybrid body has a part. So it is above the edge, by less than a tenth and a fifth.
#[test]
fn a_viscous_body_is_stable_in_its_substeps_and_not_in_a_few_less() {
    for (what, spec, wake) in [
        ("linear tets", tets(TetElements::Linear), false),
        ("smoothed tets", tets(TetElements::Smoothed), false),
        ("hybrid", hybrid(200), true),
    ] {
        for [phi, psi] in [[0.0, 2.0], [0.0, 20.0], [20.0, 0.0], [5.0, 5.0]] {
            let spec = with_viscosity(spec.clone(), Viscosity::new(phi, psi).unwrap());
            let (substeps, at_limit) = growth(&spec, Substeps::Measured, wake);
            let fewer = |part: f64| Substeps::Fixed((f64::from(substeps) * part) as u32);
            let [below, far_below] = [0.9, 0.8].map(|part| growth(&spec, fewer(part), wake).1);
            println!(
                "{what}, {phi}, {psi} Pa s: {substeps} substeps {at_limit:.1e}, 0.9 {below:.1e}, 0.8 {far_below:.1e}"
            );
        }
    }
}
