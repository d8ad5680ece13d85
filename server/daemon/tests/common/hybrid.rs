//! Scenes with hybrid bodies.
use palpate_scene::{Limits, Scene, builtin, parse};

/// A block with particles, touched, pressed and left by a tool that the scene moves.
pub const HYBRID: &str = r#"
[scene]
name = "hybrid"
[body.box]
size_mm = [40, 40, 20]
cells = [2, 2, 1]
[body.particles]
spacing_mm = 2.5
most_active = 200
[[material]]
law = "stable-neo-hookean"
young_modulus_pa = 10e3
poisson_ratio = 0.4
density_kg_per_m3 = 1000
[[fixed]]
region = "z_min"
[[tool]]
name = "indenter"
radius_mm = 6
coupling = "rigid"
driver = "script"
keyframe = [
    { time_s = 0, position_mm = [20, 20, 30] },
    { time_s = 0.2, position_mm = [20, 20, 25] },
    { time_s = 0.4, position_mm = [22, 20, 24] },
    { time_s = 0.6, position_mm = [20, 20, 45] },
]
[[probe]]
name = "table"
measure = "reaction"
region = "z_min"
[numerics]
mass_damping_per_s = 40
"#;

/// The scene of [`HYBRID`].
pub fn hybrid_scene() -> Scene {
    parse(HYBRID, "hybrid", None, &Limits::wire(), &mut |_, _| ()).unwrap()
}

/// The papers' hybrid, which is built in.
pub const SEED: &str = "seed-hybrid";

/// The scene of [`SEED`].
pub fn seed_scene() -> Scene {
    parse(builtin(SEED).unwrap(), SEED, None, &Limits::wire(), &mut |_, _| ()).unwrap()
}
