//! What a mass-spring surface holds.
use super::{
    body::SpringBody,
    motion::{SpringMotion, SpringScratch},
};
use glam::DVec3;

impl SpringBody {
    /// Kinetic and elastic energy (J) of its springs, of all that are on awake nodes. Allocates; for who asks now and then.
    pub fn energies_j(&self, motion: &SpringMotion, x_m: &[DVec3], v_m_per_s: &[DVec3]) -> [f64; 2] {
        let model = self.model();
        let mut scratch = SpringScratch::new(model);
        scratch.follow(model, motion);
        let of_levels_j = scratch.changing_energy_j(model, motion, x_m);
        let (surface, rest_m) = (model.surface(), model.rest_m());
        let place = |node: u32| scratch.place(node).map_or(rest_m[node as usize], |place| x_m[place]);
        let vertices = motion.ids.iter().copied().take_while(|id| *id < model.vertices());
        let mut of_edges_j = 0.0;
        for vertex in vertices {
            for &edge in surface.edges_at(vertex) {
                let other = surface.other_end(edge, vertex);
                // Of two ends that are awake the first one counts.
                if scratch.place(other).is_some() && other < vertex {
                    continue;
                }
                let rest_length_m = rest_m[vertex as usize].distance(rest_m[other as usize]);
                let longer_m = place(vertex).distance(place(other)) - rest_length_m;
                of_edges_j += 0.5 * model.spec().coarse.mesh_n_per_m * longer_m * longer_m;
            }
        }
        let masses = scratch.mass_kg().iter().zip(v_m_per_s).filter(|(mass, _)| mass.is_finite());
        let kinetic_j: f64 = masses.map(|(mass, v)| 0.5 * mass * v.length_squared()).sum();
        [kinetic_j, of_edges_j + of_levels_j]
    }

    /// `−Σ m g·(x − X)` (J).
    pub fn gravitational_j(&self, motion: &SpringMotion, x_m: &[DVec3], gravity_m_per_s2: DVec3) -> f64 {
        let model = self.model();
        let mut scratch = SpringScratch::new(model);
        scratch.follow(model, motion);
        let nodes = motion.ids.iter().zip(x_m).zip(scratch.mass_kg()).filter(|(_, mass)| mass.is_finite());
        let fallen: f64 =
            nodes.map(|((id, x), mass)| mass * gravity_m_per_s2.dot(*x - model.rest_m()[*id as usize])).sum();
        0.0 - fallen
    }
}
