//! Pressing walls that meet: forces, energy, and what they ask of the step.
use super::{
    gap::Gap,
    lists::NearWalls,
    query::WallScratch,
    response::Response,
    rest::{NodeAtRest, SelfContact, twice_area_m2},
};
use glam::DVec3;

/// The walls of a body that meet, at the last evaluation of a tick.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MeetingWalls {
    /// Number of the skin's vertices that are pressed.
    pub vertices: u32,
    /// The least gap (m) between the walls there, negative where they overlap; 0 where none meet.
    pub least_gap_m: f64,
    /// What they store (J).
    pub energy_j: f64,
    /// Number of pairs that could not be looked at, as there was no room or the skin was torn, so that walls may pass there.
    pub missed: u32,
}

impl MeetingWalls {
    fn add(&mut self, gap_m: f64, energy_j: f64) {
        self.least_gap_m = if self.vertices == 0 { gap_m } else { self.least_gap_m.min(gap_m) };
        self.vertices += 1;
        self.energy_j += energy_j;
    }
}

/// A vertex that is pressed. With the part `C` of its stiffness that it and the wall bear
/// (`1/C = ½/c + ½ Σ w_i/c_i`), `Φ = κ C F φ`.
struct Pressed {
    gap: Gap,
    /// `Φ` (J).
    energy_j: f64,
    /// Force (N) along the gap's direction: `κ C (φ' F + 2 h φ ∂F/∂δ²)`.
    force_n: f64,
    /// Force (N) along the way to the nearest point: `−2 κ C φ ∂F/∂δ² (y − p)`.
    beside_n: DVec3,
    /// `∂Φ/∂w_i` (J).
    by_weight_j: [f64; 3],
    /// `κ C φ'' F` (N/m).
    stiffness_n_per_m: f64,
}

impl Pressed {
    /// Makes what a gap smaller than the vertex's margin gives. `bears` is `c` of the corners.
    fn of(gap: Gap, at: &NodeAtRest, bears: [f64; 3]) -> Self {
        let softness: f64 = 0.5 / at.bears + gap.at.iter().zip(bears).map(|(w, c)| 0.5 * w / c).sum::<f64>();
        let (k, of) = (at.stiffness_n_per_m / softness, Response::of(at.margin_m - gap.distance_m, at.margin_m));
        let fading_n_per_m = 2.0 * k * of.energy_m2 * gap.slope_per_m2;
        let energy_j = k * of.energy_m2 * gap.fade;
        Self {
            energy_j,
            force_n: k * of.force_m * gap.fade + gap.distance_m * fading_n_per_m,
            beside_n: gap.way * -fading_n_per_m,
            by_weight_j: bears.map(|c| -0.5 * energy_j / (softness * c)),
            stiffness_n_per_m: k * of.stiffness * gap.fade,
            gap,
        }
    }

    /// Returns the forces (N) on the vertex and on the corners, which are at `corners` (m). They sum to zero.
    fn forces_n(&self, corners: [DVec3; 3]) -> [DVec3; 4] {
        let Self { gap, force_n, beside_n, .. } = self;
        let along = gap.direction * *force_n;
        let [on_vertex, a, b, c] = self.forces_by_weights_n(corners);
        let on_corner =
            |corner: usize, by_weights: DVec3| by_weights - along * gap.weights[corner] - *beside_n * gap.at[corner];
        [on_vertex + along + *beside_n, on_corner(0, a), on_corner(1, b), on_corner(2, c)]
    }

    /// Returns the forces (N) that come from the nearest point's motion over a wall that bears more in one place than in
    /// another. Over a face, and over an edge `e = x_j − x_i` with `w_j = t`,
    /// ```text
    /// ∂w_i = ∇N_i·(∂y − Σ w_j ∂x_j) + g Σ_j (∇N_i·∇N_j) n̂·∂x_j,     ∇N_i = n̂ × e_i/2A
    /// ∂t = (e·(∂y − ∂x_i) + (y − p − t e)·(∂x_j − ∂x_i))/e²
    /// ```
    fn forces_by_weights_n(&self, corners: [DVec3; 3]) -> [DVec3; 4] {
        let (Gap { at, way, .. }, by) = (self.gap, self.by_weight_j);
        let mut forces_n = [DVec3::ZERO; 4];
        let used: [bool; 3] = at.map(|weight| weight > 0.0);
        match used.iter().filter(|used| **used).count() {
            3 => {
                let area = twice_area_m2(corners);
                let [a, b, c] = corners;
                let slopes = [c - b, a - c, b - a].map(|edge| area.cross(edge) / area.length_squared());
                let along: DVec3 = slopes.iter().zip(by).map(|(slope, by)| *slope * by).sum();
                forces_n[0] = -along;
                for corner in 0..3 {
                    forces_n[corner + 1] = along * at[corner] - way * along.dot(slopes[corner]);
                }
            }
            2 => {
                let first = used.iter().position(|used| *used).unwrap_or(0);
                let last = used.iter().rposition(|used| *used).unwrap_or(0);
                let edge = corners[last] - corners[first];
                let slope = (by[last] - by[first]) / edge.length_squared();
                let turning = way - edge * at[last];
                forces_n[0] = edge * -slope;
                forces_n[first + 1] = (edge + turning) * slope;
                forces_n[last + 1] = turning * -slope;
            }
            _ => {}
        }
        forces_n
    }
}

impl SelfContact {
    /// Adds the forces (N) of walls that meet to nodes at `x` (m), and notes in the buffers what they are and ask of the
    /// step.
    pub(in crate::contact) fn press(
        &self,
        x: &[DVec3],
        near: &NearWalls,
        forces_n: &mut [DVec3],
        scratch: &mut WallScratch,
    ) {
        scratch.seen = MeetingWalls { missed: near.missed, ..MeetingWalls::default() };
        let WallScratch { rows_n_per_m, most_frequency_sq, seen, .. } = scratch;
        let mut touched = false;
        self.for_each_pressed(x, near, |node, pressed| {
            touched = true;
            let Pressed { gap, energy_j, stiffness_n_per_m, .. } = pressed;
            let corners = self.triangles.nodes[gap.triangle as usize];
            let ends = [node, corners[0], corners[1], corners[2]];
            let of_ends = pressed.forces_n(corners.map(|n| x[n as usize]));
            let weights = [1.0, gap.weights[0], gap.weights[1], gap.weights[2]].map(f64::abs);
            let row = stiffness_n_per_m * weights.iter().sum::<f64>();
            for ((end, force), weight) in ends.into_iter().zip(of_ends).zip(weights) {
                forces_n[end as usize] += force;
                rows_n_per_m[end as usize] += row * weight;
            }
            seen.add(gap.distance_m, *energy_j);
        });
        if !touched {
            return;
        }
        for pair in near.pairs() {
            for node in self.triangles.nodes[pair.triangle as usize].into_iter().chain([pair.node]) {
                let row = std::mem::take(&mut rows_n_per_m[node as usize]);
                *most_frequency_sq = most_frequency_sq.max(row / self.nodes[node as usize].bearing_kg);
            }
        }
    }

    /// Returns which walls meet with nodes at `x` (m), for those who have no list of what is near. It allocates.
    pub(crate) fn meeting(&self, x: &[DVec3]) -> MeetingWalls {
        let near = self.near_at(x);
        let mut seen = MeetingWalls { missed: near.missed, ..MeetingWalls::default() };
        self.for_each_pressed(x, &near, |_, pressed| seen.add(pressed.gap.distance_m, pressed.energy_j));
        seen
    }

    /// Calls `visit` for every vertex that is pressed, in ascending order. Pairs that cannot be within reach yet are passed
    /// over.
    fn for_each_pressed(&self, x: &[DVec3], near: &NearWalls, mut visit: impl FnMut(u32, &Pressed)) {
        let moved_m = near.moved_m();
        for of_vertex in near.pairs().chunk_by(|one, next| one.node == next.node) {
            let node = of_vertex[0].node;
            let within = of_vertex.iter().filter(|pair| pair.free_m <= moved_m).map(|pair| pair.triangle);
            let at = &self.nodes[node as usize];
            let Some(gap) = self.gap(node, at.margin_m, &within, x) else { continue };
            if gap.distance_m < at.margin_m {
                let bears = self.triangles.nodes[gap.triangle as usize].map(|n| self.nodes[n as usize].bears);
                visit(node, &Pressed::of(gap, at, bears));
            }
        }
    }
}
