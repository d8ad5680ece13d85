//! Pressing walls that meet: forces, energy, and what they ask of the step.
use super::{gap::Gap, lists::NearWalls, query::WallScratch, response::Response, rest::{NodeAtRest, SelfContact}};
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
    /// Number of pairs of a vertex and a triangle for which there was no room, so that walls may pass there.
    pub missed: u32,
}

impl MeetingWalls {
    fn add(&mut self, gap_m: f64, energy_j: f64) {
        self.least_gap_m = if self.vertices == 0 { gap_m } else { self.least_gap_m.min(gap_m) };
        self.vertices += 1;
        self.energy_j += energy_j;
    }
}

/// A vertex that is pressed.
struct Pressed {
    gap: Gap,
    /// `κ φ F` (J).
    energy_j: f64,
    /// Force (N) along the gap's direction: `κ φ' F`, or `κ (φ' F + 2 h φ ∂F/∂δ²)` at a rim.
    force_n: f64,
    /// Force (N) along the way to the rim: `−2 κ φ ∂F/∂δ² (y − p)`.
    beside_n: DVec3,
    /// `κ φ'' F` (N/m).
    stiffness_n_per_m: f64,
}

impl Pressed {
    /// Makes what a gap smaller than the vertex's margin gives.
    fn of(gap: Gap, at: &NodeAtRest) -> Self {
        let (k, of) = (at.stiffness_n_per_m, Response::of(at.margin_m - gap.gap_m, at.margin_m));
        let (fade, slope_per_m2, way) =
            gap.beside.map_or((1.0, 0.0, DVec3::ZERO), |beside| (beside.fade, beside.slope_per_m2, beside.way));
        let fading_n_per_m = 2.0 * k * of.energy_m2 * slope_per_m2;
        Self {
            gap,
            energy_j: k * of.energy_m2 * fade,
            force_n: k * of.force_m * fade + gap.gap_m * fading_n_per_m,
            beside_n: way * -fading_n_per_m,
            stiffness_n_per_m: k * of.stiffness * fade,
        }
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
            let Pressed { gap, energy_j, force_n, beside_n, stiffness_n_per_m } = pressed;
            let force = gap.direction * *force_n;
            let row = stiffness_n_per_m * (1.0 + gap.weights.iter().map(|weight| weight.abs()).sum::<f64>());
            forces_n[node as usize] += force + *beside_n;
            rows_n_per_m[node as usize] += row;
            let corners = self.triangles.nodes[gap.triangle as usize];
            for (corner, weight) in corners.into_iter().zip(gap.weights) {
                forces_n[corner as usize] -= force * weight;
                rows_n_per_m[corner as usize] += row * weight.abs();
            }
            if let Some(beside) = gap.beside {
                for (corner, weight) in corners.into_iter().zip(beside.weights) {
                    forces_n[corner as usize] -= *beside_n * weight;
                }
            }
            seen.add(gap.gap_m, *energy_j);
        });
        if !touched {
            return;
        }
        for &[node, triangle] in near.pairs() {
            for node in self.triangles.nodes[triangle as usize].into_iter().chain([node]) {
                let row = std::mem::take(&mut rows_n_per_m[node as usize]);
                *most_frequency_sq = most_frequency_sq.max(row / self.nodes[node as usize].mass_kg);
            }
        }
    }

    /// Returns which walls meet with nodes at `x` (m), for those who have no list of what is near. It allocates.
    pub(crate) fn meeting(&self, x: &[DVec3]) -> MeetingWalls {
        let near = self.near_at(x);
        let mut seen = MeetingWalls { missed: near.missed, ..MeetingWalls::default() };
        self.for_each_pressed(x, &near, |_, pressed| seen.add(pressed.gap.gap_m, pressed.energy_j));
        seen
    }

    /// Calls `visit` for every vertex that is pressed, in ascending order.
    fn for_each_pressed(&self, x: &[DVec3], near: &NearWalls, mut visit: impl FnMut(u32, &Pressed)) {
        for of_vertex in near.pairs().chunk_by(|one, next| one[0] == next[0]) {
            let node = of_vertex[0][0];
            let Some(gap) = self.gap(node, of_vertex.iter().map(|pair| pair[1]), x) else { continue };
            let at = &self.nodes[node as usize];
            if gap.gap_m < at.margin_m {
                visit(node, &Pressed::of(gap, at));
            }
        }
    }
}
