//! What is told of a tool that starts in the body.
use super::{body::Body, located::Located};
use crate::wording::short;
use glam::DVec3;
use palpate_physics::contact::ToolSpec;

/// Points along the axis of a capsule, as parts of its half length.
const ALONG: [f64; 5] = [0.0, -1.0, -0.5, 0.5, 1.0];
/// Depth (m) that is none, but for rounding.
const NO_DEPTH_M: f64 = 1e-9;

/// A point of a tool's axis.
struct AxisPoint {
    /// Distance (m) from the body's surface.
    from_surface_m: f64,
    /// Whether it is inside the body, or behind a surface that has nothing inside.
    is_inside: bool,
}

impl AxisPoint {
    fn at(point_m: DVec3, body: &Body) -> Self {
        let positions_m = body.surface_positions_m();
        let nearest = Located::nearest(positions_m, body.triangles(), point_m);
        let is_inside = if body.mesh.tets().is_some() {
            body.locate(point_m).distance_m == 0.0
        } else {
            let [a, b, c] = [0, 1, 2].map(|corner| positions_m[nearest.nodes[corner] as usize]);
            (b - a).cross(c - a).dot(point_m - nearest.of(positions_m)) < 0.0
        };
        Self { from_surface_m: nearest.distance_m, is_inside: is_inside && nearest.distance_m > NO_DEPTH_M }
    }
}

/// Returns what is to be told of a tool's start: that nothing presses what is inside, that what overlaps is pushed hard.
pub(super) fn warnings(tool: &ToolSpec, body: &Body) -> Vec<String> {
    let (name, half_length_m) = (&tool.name, tool.shape.half_length_m());
    let half_m = tool.start().orientation * (DVec3::Z * half_length_m);
    let (middle, parts) = if half_length_m == 0.0 { ("centre", &ALONG[..1]) } else { ("axis", &ALONG[..]) };
    let points: Vec<AxisPoint> =
        parts.iter().map(|part| AxisPoint::at(tool.start_position_m + half_m * *part, body)).collect();
    let is_solid = body.mesh.tets().is_some();
    // A surface with nothing inside says nothing of a tool that is far behind it.
    let within = points.iter().filter(|point| point.is_inside && (is_solid || point.from_surface_m < tool.radius_m));
    let inside_m = within.map(|point| point.from_surface_m).fold(0.0, f64::max);
    let outside = points.iter().filter(|point| !point.is_inside);
    let overlap_m = tool.radius_m - outside.map(|point| point.from_surface_m).fold(f64::INFINITY, f64::min);
    let mut told = Vec::new();
    if inside_m > 0.0 {
        let place = if is_solid { "inside the body" } else { "behind the surface" };
        let depth_mm = short(inside_m * 1e3);
        told.push(format!(
            "the tool \"{name}\" starts with its {middle} {place}, up to {depth_mm} mm deep: nothing presses it where its {middle} \
             is {place}, until that has come out; let it start outside"
        ));
    }
    if overlap_m > NO_DEPTH_M {
        let depth_mm = short(overlap_m * 1e3);
        told.push(format!("the tool \"{name}\" starts {depth_mm} mm deep in the body: the first tick pushes hard"));
    }
    told
}
