//! A mass-spring ball, touched, rubbed and left by a tool that the scene moves.
use palpate_scene::{Limits, Scene, parse};

/// Not all of its vertices are awake at once; two rings are refined.
pub const SPRINGS: &str = r#"[scene]
name = "ball"
[body.sphere_shell]
inner_radius_mm = 30
outer_radius_mm = 40
target_tets = 4000
[body.springs]
part = "outer"
mesh_n_per_m = 60
anchor_n_per_m = 12
area_density_kg_per_m2 = 12
damping_n_s_per_m = 0.02
most_awake = 120
[body.springs.refine]
rings = 2
constants = "area"
[[tool]]
name = "tip"
radius_mm = 5
coupling = "rigid"
friction_coefficient = 0.3
driver = "script"
keyframe = [
    { time_s = 0, position_mm = [0, 0, 60] },
    { time_s = 0.1, position_mm = [0, 0, 43] },
    { time_s = 0.4, position_mm = [12, 0, 41] },
    { time_s = 0.5, position_mm = [15, 0, 60] },
]
"#;

/// The scene.
pub fn springs_scene() -> Scene {
    parse(SPRINGS, "ball", None, &Limits::local(), &mut |_, _| ()).unwrap()
}
