//! Steps that are given, too long, or not judged; conventions of papers; what is switched off; two materials; equilibria and modes.
use super::{
    BLOCK, GRAVITY, HEAD, RIGID, SPRING,
    grid::{ACTIONS, pushes},
    material, pressing, sphere, tissue,
};
use crate::hashes::case::Case;

pub(super) fn cases() -> Vec<Case> {
    let block = |name: &str, ticks: u64, material: &str, more: &str| {
        Case::of_text(name, ticks, [HEAD, GRAVITY, BLOCK, material, ACTIONS, &pressing(RIGID), more].concat())
    };
    let stiff = tissue().replace("10e3", "200e3");
    let thin = material("stable-neo-hookean", 0.4, 0.0);
    let mut cases = vec![
        block("block/substeps-fixed", 130, &tissue(), "[numerics]\nsubsteps = 7\n"),
        block("block/one-substep", 130, &thin, "[numerics]\nsubsteps = 1\nmass_damping_per_s = 5\n"),
        block("block/one-substep-too-long", 200, &stiff, "[numerics]\nsubsteps = 1\n"),
        block("block/two-substeps-too-long", 200, &stiff, "[numerics]\nsubsteps = 2\nprecision = \"double\"\n"),
        block("block/short-steps", 130, &tissue(), "[numerics]\nstep_safety = 0.4\nstretch_allowance = 1.5\n"),
        block("block/not-judged", 130, &tissue(), "[numerics]\nsubcycle_unstable = false\n"),
        block("block/skips-off", 130, &thin, "[numerics]\nmass_damping_per_s = 10\n").changed(|scene| {
            scene.model.settings.skips.viscous_terms = false;
            scene.model.settings.skips.distant_contact = false;
        }),
        block("block/skips-on", 130, &thin, "[numerics]\nmass_damping_per_s = 10\n"),
        block(
            "block/few-iterations",
            130,
            &tissue(),
            "[numerics]\nintegrator = \"backward-euler\"\nsolver_iterations = 3\nsubsteps = 2\n",
        ),
        block(
            "block/tight-solver",
            130,
            &tissue(),
            "[numerics]\nintegrator = \"backward-euler\"\nsolver_tolerance = 1e-9\n",
        ),
        block("block/two-materials", 130, &two_materials(), "[numerics]\nprecision = \"single\"\n"),
    ];
    for convention in ["paper-2005", "paper-2006"] {
        for integrator in ["leapfrog", "seed-semi-implicit"] {
            let material = material("stvk", 0.4, 0.1) + &format!("convention = \"{convention}\"\n");
            let numerics = format!("[numerics]\nintegrator = \"{integrator}\"\nprecision = \"double\"\n");
            cases.push(block(&format!("block/{convention}-{integrator}"), 130, &material, &numerics));
        }
    }
    let mut cases: Vec<Case> = cases.into_iter().map(|case| case.acting(pushes)).collect();
    for law in ["stvk", "stable-neo-hookean", "fixed-corotated"] {
        let material = material(law, 0.3, 0.0);
        let rests = block(&format!("block/rests-{law}"), 20, &material, "").resting_at(0.06).with_modes(5);
        cases.push(rests);
    }
    let coupled = [HEAD, GRAVITY, BLOCK, &tissue(), &pressing(SPRING)].concat();
    cases.push(Case::of_text("block/rests-on-a-spring", 20, coupled).resting_at(0.07));
    let free = [HEAD, GRAVITY, &BLOCK.replace("z_min", "x_min"), &tissue(), &sphere("sphere", RIGID)].concat();
    cases.push(Case::of_text("block/hangs", 100, free).resting_at(f64::INFINITY).with_modes(3));
    cases
}

/// The upper half is another law, without viscosity, and denser.
fn two_materials() -> String {
    let upper = material("fixed-corotated", 0.2, 0.0).replace("1000", "1500");
    format!(
        "{}{upper}region = \"upper\"\n[[region]]\nname = \"upper\"\nselect.half_space = {{ point_mm = [0, 0, 10], normal = [0, 0, 1] }}\n",
        tissue()
    )
}
