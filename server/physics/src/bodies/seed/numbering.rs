//! The numbers and masses of nodes that the core and the skin of a seed body have in the loop, and the masses that
//! contact counts on.
//!
//! Nodes are those of the core, then the vertices of the skin. The skin carries the mass of the whole layer, as it does
//! while particles sleep.
//!
//! The papers displace what the user touches. Here tools press as on every body, with forces on vertices, which act on
//! awake particles by the weights of eq. 25 (`seed::step`). Contact is explicit, so it must not be stiffer than the
//! step can bear ([`SeedModel::contact_mass_kg`]).
use super::{SeedModel, SeedState, region::Region};
use crate::mesh::Surface;
use glam::DVec3;

impl SeedModel {
    /// Returns the rest positions (m) of the nodes.
    pub fn node_rest_m(&self) -> Vec<DVec3> {
        let skin: &[DVec3] = if self.layer().is_some() { self.surface_rest_m() } else { &[] };
        self.core().rest_m().iter().chain(skin).copied().collect()
    }

    /// Returns the masses (kg) of the nodes, which are those of the whole body while its layer sleeps.
    pub fn node_mass_kg(&self) -> Vec<f64> {
        let skin = self.links().map_or(&[][..], |links| &links.mass_kg);
        self.core().mass_kg().iter().chain(skin).copied().collect()
    }

    /// Returns the touchable surface with its vertices numbered as nodes.
    pub fn node_surface(&self) -> Surface {
        if self.layer().is_none() {
            return self.core().boundary().clone();
        }
        let (first, count) = (self.core().rest_m().len() as u32, self.surface_rest_m().len() as u32);
        Surface {
            nodes: (first..first + count).collect(),
            triangles: self.surface_triangles().to_vec(),
            vertex_of_node: std::iter::repeat_n(u32::MAX, first as usize).chain(0..count).collect(),
        }
    }

    /// Returns the masses (kg) of the nodes that contact may count on; for the skin these are the smallest that a
    /// pressure on it ever meets.
    ///
    /// A pressure `k_f g` on vertices of areas `A_v` is the stiffness `k_f A_v` there, and over awake particles, with
    /// the weights of eq. 25, at most `k_f Σ_v A_v w_vs` (row sum, `Σ_s w_vs = 1`) at particle s. So a vertex counts as
    /// `m_p A_v/max_s Σ_v A_v w_vs`, or as its own mass where that is smaller.
    pub fn contact_mass_kg(&self) -> Vec<f64> {
        let mut mass_kg = self.node_mass_kg();
        let Some(layer) = self.layer() else { return mass_kg };
        let skin = &mut mass_kg[self.core().rest_m().len()..];
        let area_m2 = self.vertex_areas_m2();
        for region in self.regions() {
            let mut pressed_m2 = vec![0.0; region.len()];
            for carried in &region.carried {
                for &(slot, weight) in region.terms_of(carried) {
                    pressed_m2[slot as usize] += area_m2[carried.vertex as usize] * weight;
                }
            }
            for carried in &region.carried {
                let vertex = carried.vertex as usize;
                let most_m2 =
                    region.terms_of(carried).iter().map(|term| pressed_m2[term.0 as usize]).fold(0.0, f64::max);
                skin[vertex] = skin[vertex].min(layer.mass_kg * area_m2[vertex] / most_m2);
            }
        }
        mass_kg
    }

    /// Returns the triangle whose touch wakes the most particles.
    pub fn largest_region(&self) -> Option<u32> {
        let sizes = self.regions().iter().map(Region::len).zip(0..);
        sizes.max_by_key(|(size, _)| *size).map(|(_, triangle)| triangle)
    }

    /// Returns the tributary area (m²) of each vertex of the surface, a third of that of its triangles.
    fn vertex_areas_m2(&self) -> Vec<f64> {
        let mut area_m2 = vec![0.0; self.surface_rest_m().len()];
        for triangle in self.surface_triangles() {
            let [a, b, c] = triangle.map(|vertex| self.surface_rest_m()[vertex as usize]);
            for &vertex in triangle {
                area_m2[vertex as usize] += (b - a).cross(c - a).length() / 6.0;
            }
        }
        area_m2
    }

    /// Returns the kinetic energy (J) of the core, the awake particles, and the skin without its carried vertices.
    pub fn kinetic_energy_j(&self, state: &SeedState) -> f64 {
        let of = |mass_kg: &f64, v: &DVec3| 0.5 * mass_kg * v.length_squared();
        let mut energy_j: f64 = self.core().mass_kg().iter().zip(&state.core.v).map(|(m, v)| of(m, v)).sum();
        if let (Some(links), Some(layer)) = (self.links(), self.layer()) {
            energy_j += links.mass_kg.iter().zip(&state.skin.v).map(|(m, v)| of(m, v)).sum::<f64>();
            if let Some(region) = self.awake(state) {
                let carried = region.carried.iter().map(|carried| carried.vertex as usize);
                energy_j -= carried.map(|vertex| of(&links.mass_kg[vertex], &state.skin.v[vertex])).sum::<f64>();
                energy_j += state.particles.v[..region.len()].iter().map(|v| of(&layer.mass_kg, v)).sum::<f64>();
            }
        }
        energy_j
    }
}
