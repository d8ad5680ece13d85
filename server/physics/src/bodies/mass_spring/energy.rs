//! The energies of a mass-spring surface.
use super::{
    blend::Added,
    body::MassSpringBody,
    motion::{SpringMotion, own_mass_kg},
    state::MassSpringState,
};
use crate::tick::{Energies, MechanicalState};
use glam::DVec3;

impl MassSpringBody {
    /// Returns the energies of a state, with the ledger's work and dissipation.
    pub(crate) fn energies(&self, gravity_m_per_s2: DVec3, own: &MassSpringState, state: &MechanicalState) -> Energies {
        let [kinetic_j, elastic_j] = self.energies_j(&own.motion, &state.x, &state.v);
        Energies {
            kinetic_j,
            elastic_j,
            gravitational_j: self.gravitational_j(&own.motion, &state.x, gravity_m_per_s2),
            external_work_j: state.ledger.external_work_j,
            dissipated_j: state.ledger.dissipated_j,
        }
    }

    /// Returns the kinetic energy (J) of the awake nodes, and the elastic energy (J) of all springs at them. Nothing is
    /// allocated.
    pub fn energies_j(&self, motion: &SpringMotion, x_m: &[DVec3], v_m_per_s: &[DVec3]) -> [f64; 2] {
        let model = self.model();
        let (surface, rest_m, spec) = (model.surface(), model.rest_m(), model.spec());
        let place = |node: u32| motion.ids.binary_search(&node).ok();
        let at = |node: u32| place(node).map_or(rest_m[node as usize], |place| x_m[place]);
        let longer_m = |a: u32, b: u32| at(a).distance(at(b)) - rest_m[a as usize].distance(rest_m[b as usize]);
        let vertices = motion.ids.iter().copied().take_while(|id| *id < model.vertices());
        let mut elastic_j = 0.0;
        for vertex in vertices {
            let away_m = at(vertex).distance(rest_m[vertex as usize]);
            elastic_j += spec.coarse.anchor_n_per_m * spec.anchor_law.at(away_m).integral_m2;
            for &edge in surface.edges_at(vertex) {
                let other = surface.other_end(edge, vertex);
                // A spring between two awake vertices counts at the first one.
                if vertex < other || place(other).is_none() {
                    elastic_j += 0.5 * spec.coarse.mesh_n_per_m * longer_m(vertex, other).powi(2);
                }
            }
        }
        motion.levels.for_each_added(surface, rest_m, &spec.coarse, &motion.fine, |added| {
            elastic_j += match added {
                Added::Spring { nodes: [a, b], stiffness_n_per_m, .. } => {
                    0.5 * stiffness_n_per_m * longer_m(a, b).powi(2)
                }
                Added::Anchor { node, stiffness_n_per_m } => {
                    let away_m = at(node).distance(rest_m[node as usize]);
                    stiffness_n_per_m * spec.anchor_law.at(away_m).integral_m2
                }
                Added::Tie { nodes, stiffness_n_per_m } => {
                    let [own, a, b] = nodes.map(|node| at(node) - rest_m[node as usize]);
                    0.5 * stiffness_n_per_m * own.distance_squared((a + b) * 0.5)
                }
            };
        });
        let masses = motion.ids.iter().map(|&id| own_mass_kg(model, place, id)).zip(v_m_per_s);
        let free = masses.filter(|(mass_kg, _)| mass_kg.is_finite());
        [free.map(|(mass_kg, v)| 0.5 * mass_kg * v.length_squared()).sum(), elastic_j]
    }

    /// Returns the gravitational energy `−Σ m g·(x − X)` (J). Nothing is allocated.
    pub fn gravitational_j(&self, motion: &SpringMotion, x_m: &[DVec3], gravity_m_per_s2: DVec3) -> f64 {
        let model = self.model();
        let place = |node: u32| motion.ids.binary_search(&node).ok();
        let masses = motion.ids.iter().zip(x_m).map(|(&id, x)| (own_mass_kg(model, place, id), id, *x));
        let free = masses.filter(|(mass_kg, ..)| mass_kg.is_finite());
        0.0 - free.map(|(mass, id, x)| mass * gravity_m_per_s2.dot(x - model.rest_m()[id as usize])).sum::<f64>()
    }
}
