//! A seed body as a body of the loop: how its core and its skin are numbered, weighed and touched.
//!
//! Nodes are the core's, and after them the skin's vertices. The skin carries the whole layer's mass, as it does while particles sleep.
//!
//! The papers displace what the user touches. Here tools press as on every body, with forces on vertices; they act on awake particles by
//! eq. 25's weights (`seed::step`). Contact is explicit, so it must not be stiffer than the step can bear: [`SeedModel::contact_mass_kg`].
use super::{
    LayerSpec, SeedModel, SeedParameters, SeedState, core::outer_part, layer::enclosed_m3, region::Region,
    state::Motion,
};
use crate::mesh::{Surface, TetMesh};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// What makes the tets of a [`crate::ModelSpec`] the core of a seed body.
#[derive(Debug, Clone, PartialEq)]
pub struct SeedBodySpec {
    /// The particles around the core; without them its boundary is touched.
    pub layer: Option<LayerSpec>,
    /// Constants. `dt_s` is the longest step: a tick is taken in equal steps that are no longer.
    pub parameters: SeedParameters,
}

impl SeedBodySpec {
    /// Volume (m³) of core and layer, given the core's boundary.
    pub fn volume_m3(&self, core: &TetMesh, boundary: &Surface) -> f64 {
        let core_m3 = core.total_volume_m3();
        let Some(layer) = &self.layer else { return core_m3 };
        let triangles: Vec<[u32; 3]> = (0..boundary.triangles.len()).map(|t| boundary.triangle_nodes(t)).collect();
        let outer = outer_part(core.positions_m(), &triangles);
        core_m3 + enclosed_m3(&layer.skin_m, &layer.skin_triangles) - enclosed_m3(core.positions_m(), &outer)
    }
}

/// A seed body's part of [`crate::State`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SeedMotion {
    /// What the model's steps change.
    pub now: SeedState,
    /// Triangle of the surface that tools touch, for the next step.
    pub touched: Option<u32>,
    /// Particles that are awake.
    pub awake: u32,
}

impl SeedMotion {
    /// At rest.
    pub(crate) fn at_rest(model: &SeedModel) -> Self {
        Self { now: SeedState::at_rest(model), touched: None, awake: 0 }
    }

    /// Back to rest, in the buffers it has.
    pub(crate) fn reset(&mut self, model: &SeedModel) {
        self.now.core.rest(model.core().rest_m());
        self.now.skin.rest(model.surface_rest_m());
        self.now.particles.rest(&[]);
        (self.now.step, self.now.touched) = (0, None);
        (self.touched, self.awake) = (None, 0);
    }

    /// Copies another of the same model. Allocates nothing.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        let (own, from) = (&mut self.now, &other.now);
        own.core.copy_from(&from.core);
        own.skin.copy_from(&from.skin);
        own.particles.copy_from(&from.particles);
        (own.step, own.touched) = (from.step, from.touched);
        (self.touched, self.awake) = (other.touched, other.awake);
    }

    /// Takes all speed from it.
    pub(crate) fn stop(&mut self) {
        for motion in [&mut self.now.core, &mut self.now.skin, &mut self.now.particles] {
            motion.v.fill(DVec3::ZERO);
        }
    }

    /// Whether awake particles are finite. Nodes are looked at with everybody's.
    pub(crate) fn particles_are_finite(&self) -> bool {
        self.now.particles.is_finite(self.awake as usize)
    }

    /// Whether it is one of a model's, and its nodes are at `x` with velocities `v`: for states that come from elsewhere.
    pub(crate) fn fits(&self, model: &SeedModel, x: &[DVec3], v: &[DVec3]) -> bool {
        let Self { now, touched, awake } = self;
        let same = |nodes: &[DVec3], of: [&[DVec3]; 2]| nodes.iter().eq(of.into_iter().flatten());
        now.fits(model)
            && same(x, [&now.core.x, &now.skin.x])
            && same(v, [&now.core.v, &now.skin.v])
            && touched.is_none_or(|triangle| (triangle as usize) < model.surface_triangles().len())
            && *awake as usize == model.awake(now).map_or(0, Region::len)
    }

    /// Every number of it.
    pub(crate) fn vectors(&self) -> impl Iterator<Item = &DVec3> {
        let SeedState { core, skin, particles, .. } = &self.now;
        [core, skin, particles].into_iter().flat_map(|motion: &Motion| motion.x.iter().chain(&motion.v))
    }
}

impl SeedModel {
    /// Rest positions (m) of nodes.
    pub fn node_rest_m(&self) -> Vec<DVec3> {
        let skin: &[DVec3] = if self.layer().is_some() { self.surface_rest_m() } else { &[] };
        self.core().rest_m().iter().chain(skin).copied().collect()
    }

    /// Mass (kg) of nodes: that of the whole body, its layer asleep.
    pub fn node_mass_kg(&self) -> Vec<f64> {
        let skin = self.links().map_or(&[][..], |links| &links.mass_kg);
        self.core().mass_kg().iter().chain(skin).copied().collect()
    }

    /// The touchable surface over nodes.
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

    /// Mass (kg) of nodes as contact may count on it: of the skin the least that its pressure ever meets.
    ///
    /// A pressure `k_f g` on vertices of areas `A_v` is stiffness `k_f A_v` there, and over awake particles, with eq. 25's weights, at most
    /// `k_f Σ_v A_v w_vs` (row sum, `Σ_s w_vs = 1`) at particle s. So a vertex counts as `m_p A_v/max_s Σ_v A_v w_vs`, or its own mass if that is less.
    pub fn contact_mass_kg(&self) -> Vec<f64> {
        let mut mass_kg = self.node_mass_kg();
        let Some(layer) = self.layer() else { return mass_kg };
        let skin = &mut mass_kg[self.core().rest_m().len()..];
        let area_m2 = self.vertex_areas_m2();
        for region in self.regions() {
            let mut pressed_m2 = vec![0.0; region.len()];
            for rider in &region.riders {
                for &(slot, weight) in region.terms_of(rider) {
                    pressed_m2[slot as usize] += area_m2[rider.vertex as usize] * weight;
                }
            }
            for rider in &region.riders {
                let vertex = rider.vertex as usize;
                let most_m2 = region.terms_of(rider).iter().map(|term| pressed_m2[term.0 as usize]).fold(0.0, f64::max);
                skin[vertex] = skin[vertex].min(layer.mass_kg * area_m2[vertex] / most_m2);
            }
        }
        mass_kg
    }

    /// The triangle whose touch wakes the most particles.
    pub fn largest_region(&self) -> Option<u32> {
        let sizes = self.regions().iter().map(Region::len).zip(0..);
        sizes.max_by_key(|(size, _)| *size).map(|(_, triangle)| triangle)
    }

    /// A third (m²) of the triangles around each vertex of the surface.
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

    /// Kinetic energy (J) of core, awake particles, and skin but for what rides on those.
    pub fn kinetic_energy_j(&self, state: &SeedState) -> f64 {
        let of = |mass_kg: &f64, v: &DVec3| 0.5 * mass_kg * v.length_squared();
        let mut energy_j: f64 = self.core().mass_kg().iter().zip(&state.core.v).map(|(m, v)| of(m, v)).sum();
        if let (Some(links), Some(layer)) = (self.links(), self.layer()) {
            energy_j += links.mass_kg.iter().zip(&state.skin.v).map(|(m, v)| of(m, v)).sum::<f64>();
            if let Some(region) = self.awake(state) {
                let riders = region.riders.iter().map(|rider| rider.vertex as usize);
                energy_j -= riders.map(|vertex| of(&links.mass_kg[vertex], &state.skin.v[vertex])).sum::<f64>();
                energy_j += state.particles.v[..region.len()].iter().map(|v| of(&layer.mass_kg, v)).sum::<f64>();
            }
        }
        energy_j
    }
}
