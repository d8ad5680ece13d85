//! Where the first tool of a scene would touch a hybrid body first.
use crate::bodies::FirstTouch;
use glam::DVec3;
use palpate_physics::{
    bodies::hybrid::{HybridBody, Waking},
    contact::{ToolShape, ToolTarget},
};
use palpate_scene::Scene;

/// Returns the touch of the first tool where it is nearest to particles that may wake; `None` where it wakes none.
pub(super) fn first_touch(hybrid: &HybridBody, scene: &Scene) -> Option<FirstTouch> {
    let Waking::ByTools { .. } = hybrid.particles().waking else { return None };
    let tool = scene.model.tools.first()?;
    let partition = hybrid.partition();
    let particles = (0..partition.particle_count() as u32).filter(|&particle| hybrid.may_wake(particle));
    let particle_m = nearest(particles.map(|particle| partition.particle_m(particle)), tool.start_position_m)?.1;
    let (vertex, vertex_m) = nearest(hybrid.skin_rest_m().iter().copied(), particle_m)?;
    let outward = outward(hybrid, vertex as u32)?;
    let turn = tool.start().orientation;
    // The axis of a capsule reaches down to the skin by this.
    let half_m = match tool.shape {
        ToolShape::Sphere => 0.0,
        ToolShape::Capsule(capsule) => capsule.half_length_m * (turn * DVec3::Z).dot(outward).abs(),
    };
    let position_m = vertex_m + outward * (tool.radius_m + half_m);
    let touching = ToolTarget { orientation: turn, ..ToolTarget::at(position_m) };
    Some(FirstTouch { touching, outward, radius_m: tool.radius_m })
}

/// Returns the nearest of these points (m) to another, and its number; `None` where there is none.
fn nearest(points: impl Iterator<Item = DVec3>, to_m: DVec3) -> Option<(usize, DVec3)> {
    points.enumerate().min_by(|(_, a), (_, b)| a.distance_squared(to_m).total_cmp(&b.distance_squared(to_m)))
}

/// Returns the outward unit normal of the skin at a vertex, by the areas of the triangles there.
fn outward(hybrid: &HybridBody, vertex: u32) -> Option<DVec3> {
    let rest_m = hybrid.skin_rest_m();
    let around = hybrid.particles().skin.triangles().iter().filter(|corners| corners.contains(&vertex));
    let sum_m2: DVec3 =
        around.map(|corners| corners.map(|corner| rest_m[corner as usize])).map(|[a, b, c]| (b - a).cross(c - a)).sum();
    sum_m2.try_normalize()
}
