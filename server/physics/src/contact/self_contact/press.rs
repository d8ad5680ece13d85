//! Pressing walls that meet: forces, energy, and what they ask of the step.
use super::{gap::Gap, lists::NearWalls, query::WallScratch, response::Response, rest::SelfContact};
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
    /// `κ φ` (J).
    energy_j: f64,
    /// `κ φ'` (N).
    force_n: f64,
    /// `κ φ''` (N/m).
    stiffness_n_per_m: f64,
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
            let Pressed { gap, energy_j, force_n, stiffness_n_per_m } = pressed;
            let force = gap.direction * *force_n;
            let row = 2.0 * stiffness_n_per_m;
            forces_n[node as usize] += force;
            rows_n_per_m[node as usize] += row;
            for (corner, weight) in self.triangles.nodes[gap.triangle as usize].into_iter().zip(gap.weights) {
                forces_n[corner as usize] -= force * weight;
                rows_n_per_m[corner as usize] += row * weight;
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
            let depth_m = at.margin_m - gap.gap_m;
            if depth_m > 0.0 {
                let (k, of) = (at.stiffness_n_per_m, Response::of(depth_m, at.margin_m));
                let (energy_j, force_n) = (k * of.energy_m2, k * of.force_m);
                visit(node, &Pressed { gap, energy_j, force_n, stiffness_n_per_m: k * of.stiffness });
            }
        }
    }
}
