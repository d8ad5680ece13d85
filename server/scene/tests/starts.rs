//! What is told of tools that start in the body or touching it.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use palpate_scene::{Limits, parse};

/// The warnings of a block, or of its upper face alone, whose top is at z = 0, with a tool of 5 mm at this height (mm).
fn warnings(particles: &str, shape: &str, z_mm: f64) -> Vec<String> {
    const MATERIAL: &str = "[[material]]\nlaw = \"stable-neo-hookean\"\nyoung_modulus_pa = 1e4\npoisson_ratio = 0.3\ndensity_kg_per_m3 = 1000\n";
    let (held, material) = if particles.contains("springs") { ("z_max", "") } else { ("z_min", MATERIAL) };
    let text = format!(
        "[scene]\nname = \"t\"\n[body]\noffset_mm = [-20, -20, -20]\n[body.box]\nsize_mm = [40, 40, 20]\ncells = [4, 4, 2]\n{particles}\n\
         {material}[[fixed]]\nregion = \"{held}\"\n[[tool]]\nname = \"finger\"\nradius_mm = 5\n{shape}\ncoupling = \"rigid\"\ndriver = \"script\"\n\
         keyframe = [{{ time_s = 0, position_mm = [0, 0, {z_mm}] }}]\n"
    );
    parse(&text, "t.toml", None, &Limits::local(), &mut |_, _| {})
        .unwrap_or_else(|e| panic!("{}", e.one_line()))
        .warnings
}

#[test]
fn how_deep_a_tool_starts_and_whether_anything_presses_it_there() {
    let deep = |warnings: Vec<String>| warnings.into_iter().find(|warning| warning.contains("starts"));
    for particles in ["", "[body.particles]\nspacing_mm = 2.5"] {
        assert_eq!(deep(warnings(particles, "", 5.5)), None);
        let touching = deep(warnings(particles, "", 3.75)).unwrap();
        assert!(touching.contains("starts 1.25 mm deep in the body: the first tick pushes hard"), "{touching}");
        let inside = deep(warnings(particles, "", -2.0)).unwrap();
        assert!(inside.contains("with its centre inside the body, up to 2 mm deep: nothing presses it"), "{inside}");
        // On the surface but for rounding, it overlaps by its radius.
        let on = deep(warnings(particles, "", 1e-12)).unwrap();
        assert!(on.contains("starts 5 mm deep"), "{on}");
        // A capsule stands on end: its axis, 20 mm long, is half in the body.
        let capsule = warnings(particles, "shape = \"capsule\"\nhalf_length_mm = 10", 0.0);
        let told = |part: &str| assert!(capsule.iter().any(|warning| warning.contains(part)), "{part}: {capsule:?}");
        told("with its axis inside the body, up to 10 mm deep");
    }
    // A surface of springs has nothing inside; from behind it presses nothing either.
    let springs = "[body.springs]\npart = \"z_max\"\nmesh_n_per_m = 60\nanchor_n_per_m = 12\nvertex_mass_kg = 2e-4\n\
                   damping_n_s_per_m = 0.01";
    assert!(deep(warnings(springs, "", 3.75)).unwrap().contains("starts 1.25 mm deep"));
    assert!(deep(warnings(springs, "", -2.0)).unwrap().contains("with its centre behind the surface, up to 2 mm deep"));
    assert_eq!(deep(warnings(springs, "", -6.0)), None);
}
