//! The papers' hybrid: every convention, with the repairs, with none, and with each left out alone.
use super::farthest_node;
use crate::hashes::case::{Case, Moment};
use glam::DVec3;
use palpate_physics::{
    BodySpec, PointForce,
    bodies::seed::{Exchange, InterfaceForce, PairStress},
};
use palpate_scene::Scene;

const TICKS: u64 = 150;

fn shell(name: &str, convention: &str, (seed, layer): (&str, bool)) -> Case {
    let layer = if layer {
        "[body.seed.layer]\nouter_semi_axes_mm = [34, 32, 50]\ntriangles = 320\nparticles = 4000\n"
    } else {
        ""
    };
    let start = if layer.is_empty() { 30.6 } else { 40.4 };
    let text = format!(
        "[scene]\nname = \"own\"\ntick_period_s = 7e-3\n\
        [body.ellipsoid_shell]\ninner_semi_axes_mm = [18, 17, 30]\nouter_semi_axes_mm = [27, 25, 39]\ntarget_tets = 188\n\
        [body.seed]\n{seed}{layer}\
        [[material]]\nlaw = \"stvk\"\nconvention = \"{convention}\"\nlambda_pa = 5.0\nmu_pa = 2.0\n\
        viscosity_phi_pa_s = 9e-5\nviscosity_psi_pa_s = 9e-5\ndensity_kg_per_m3 = 1000\n\
        [[region]]\nname = \"upper end\"\nselect.half_space = {{ point_mm = [0, 0, 29.25], normal = [0, 0, 1] }}\n\
        [[fixed]]\nregion = \"upper end\"\n\
        [[load]]\nregion = \"surface\"\npressure_pa = 0.001\nfollower = true\namplitude.ramp.duration_s = 0.3\n\
        [[tool]]\nname = \"finger\"\nradius_mm = 6\ncoupling = \"rigid\"\nfriction_coefficient = 0.2\ndriver = \"script\"\n\
        keyframe = [{{ time_s = 0, position_mm = [{start}, 0, 0] }}, {{ time_s = 0.5, position_mm = [{}, 0, 0] }},\n\
        {{ time_s = 0.8, position_mm = [{}, 3, 6] }}, {{ time_s = 1, position_mm = [{start}, 3, 6] }}]\n",
        start - 2.5,
        start - 2.5
    );
    Case::of_text(name, TICKS, text).acting(pushes)
}

fn without(name: &str, change: fn(&mut Scene)) -> Case {
    shell(name, "paper-2006", ("", true)).changed(change)
}

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for convention in ["paper-2005", "paper-2006", "consistent"] {
        cases.push(shell(&format!("seed/{convention}"), convention, ("", true)));
        cases.push(shell(&format!("seed/{convention}-as-printed"), convention, ("repairs = false\n", true)));
        cases.push(shell(&format!("seed/{convention}-core"), convention, ("", false)));
    }
    cases.push(shell("seed/two-steps", "paper-2006", ("step_s = 3.5e-3\n", true)));
    cases.push(without("seed/displacements", |scene| {
        if let BodySpec::Seed(seed) = &mut scene.model.body {
            seed.parameters.exchange = Exchange::Displacements;
        }
    }));
    cases.push(without("seed/neighbours", |scene| {
        if let BodySpec::Seed(seed) = &mut scene.model.body {
            seed.parameters.pair_stress = PairStress::Neighbour;
        }
    }));
    cases.push(without("seed/nearest-voxels", |scene| {
        if let BodySpec::Seed(seed) = &mut scene.model.body {
            seed.parameters.interface_force = InterfaceForce::NearestVoxel;
        }
    }));
    cases
}

fn pushes(moment: &mut Moment<'_>) {
    if (20..25).contains(&moment.tick) {
        let node = farthest_node(moment.model, DVec3::NEG_X);
        moment.drive.point_forces.push(PointForce { node, force_n: DVec3::new(0.0, 1e-6, -2e-6) });
    }
}
