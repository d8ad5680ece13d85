//! Tests of the whole model on a ball of two layers.
mod exchange;
mod forces;
mod press;
mod region;

use super::{AtVertex, SeedContact, SeedModel, SeedScratch, SeedSpec, SeedState, region::Region, testing::ball_spec};
use glam::DVec3;

fn ball() -> SeedModel {
    SeedModel::build(ball_spec()).unwrap()
}

fn ball_with(change: impl Fn(&mut SeedSpec)) -> SeedModel {
    let mut spec = ball_spec();
    change(&mut spec);
    SeedModel::build(spec).unwrap()
}

/// Returns the triangle of the surface whose middle lies farthest along a direction.
fn triangle_towards(model: &SeedModel, direction: DVec3) -> u32 {
    let along = |t: &[u32; 3]| t.iter().map(|&v| model.surface_rest_m()[v as usize]).sum::<DVec3>().dot(direction);
    let triangles = model.surface_triangles();
    (0..triangles.len()).max_by(|&a, &b| along(&triangles[a]).total_cmp(&along(&triangles[b]))).unwrap() as u32
}

/// Direction from the centre in which the tests touch the ball, off all axes.
const TOUCHED: DVec3 = DVec3::new(0.3, 0.2, -1.0);

fn touched(model: &SeedModel) -> (u32, &Region) {
    let triangle = triangle_towards(model, TOUCHED);
    (triangle, &model.regions()[triangle as usize])
}

/// Presses a triangle inwards evenly to `depth_m` (m) in `steps` steps. Returns the means of the outward reaction (N)
/// over tenths of the time, and the last state.
fn press(model: &SeedModel, depth_m: f64, steps: u32) -> (Vec<f64>, SeedState) {
    try_press(model, depth_m, steps).unwrap()
}

/// Does the same as [`press`], or returns after how many steps the state was no longer finite.
fn try_press(model: &SeedModel, depth_m: f64, steps: u32) -> Result<(Vec<f64>, SeedState), u32> {
    let triangle = triangle_towards(model, TOUCHED);
    let corners = model.surface_triangles()[triangle as usize];
    let rest = corners.map(|v| model.surface_rest_m()[v as usize]);
    let outwards = (rest[1] - rest[0]).cross(rest[2] - rest[0]).normalize();
    let (mut state, mut scratch) = (SeedState::at_rest(model), SeedScratch::new(model));
    let mut means = vec![0.0; 10];
    for step in 0..steps {
        let depth = depth_m * f64::from(step + 1) / f64::from(steps);
        let goals: Vec<AtVertex> =
            (0..3).map(|i| AtVertex { vertex: corners[i], value: rest[i] - outwards * depth }).collect();
        let contact = SeedContact { triangle: Some(triangle), displaced_m: &goals, ..SeedContact::default() };
        let report = model.step(&mut state, &mut scratch, &contact);
        if !report.is_finite {
            return Err(step);
        }
        means[(step * 10 / steps) as usize] += report.reaction_n.dot(outwards) * 10.0 / f64::from(steps);
    }
    Ok((means, state))
}
