//! The region RV(ps) of a touched point (2006, sections 6 and 6.1): which particles are awake, and where its interface is.
//!
//! The papers project the boundary of nv(ps) — the touched triangle's corners and their first neighbours — towards the mass centre onto
//! the core and take the particles between. A particle lies there exactly when its own ray from the mass centre leaves through a
//! triangle of nv(ps): so a region is the union of the particles under some triangles, and needs no polygon C(ps).
//!
//! RV is embedded in a box of voxels B(ps). Its *interface* are the voxels of RV beside a voxel of the body outside RV: at the sides other
//! particles, below the core. Towards the skin it has none ("inner boundaries"). Every voxel of B knows the nearest interface voxel; the
//! vector there is the gradient field.
//!
//! *Border force, as printed* ([`InterfaceForce::NearestVoxel`]): k times the gradient at the particle's voxel, on particles that started at
//! the interface and on those beyond it. It is constant within a voxel, jumps between voxels and changes its aim where another interface
//! voxel becomes the nearest: it has no potential and pumps energy, at any step. *Repaired* ([`InterfaceForce::OwnVoxel`]): a particle of the
//! interface is drawn to its own voxel, `k (c − x)` with c the voxel's point nearest to x: zero within, continuous, of potential
//! `½k|x − c|²`. Nothing draws the others, which no interface voxel is proper to.
use super::{
    InterfaceForce,
    kernel::Stencil,
    layer::{Holds, Layer},
    radial::Attachment,
    voxels::{NONE, Voxels},
};
use glam::DVec3;

/// What a voxel of B(ps) is to the region.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Of the region, within.
    Inside,
    /// Of the region, at its interface.
    Interface,
    /// Of the body, outside the region.
    Beyond,
    /// Outside the body.
    Free,
}

/// A particle of the interface beside the core.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnCore {
    /// Its slot in the region.
    pub slot: u32,
    /// The face below it.
    pub attachment: Attachment,
}

/// A vertex of the skin that follows awake particles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CarriedVertex {
    /// The vertex.
    pub vertex: u32,
    /// Where its terms begin and end.
    pub terms: [u32; 2],
}

/// What is awake while one triangle of the skin is touched. A *slot* is a place in its list of particles.
#[derive(Debug, Clone)]
pub struct Region {
    /// Its particles, ascending.
    pub particles: Vec<u32>,
    /// B(ps).
    pub voxels: Voxels,
    /// Slot of each of B's voxels, or [`NONE`].
    pub slot_at: Vec<u32>,
    /// Voxel of B of each slot.
    pub voxel_of: Vec<u32>,
    /// What each voxel of B is.
    pub places: Vec<Place>,
    /// Interface voxel of B nearest to each voxel, or [`NONE`] when there is no interface.
    pub nearest_interface: Vec<u32>,
    /// Particles of the interface beside the core.
    pub on_core: Vec<OnCore>,
    /// Vertices of nv(ps).
    pub carried: Vec<CarriedVertex>,
    /// Slots and weights of the carried.
    pub terms: Vec<(u32, f64)>,
    /// Steps of the stencil as differences of B's voxel numbers.
    pub steps: Vec<i32>,
}

impl Region {
    /// Of particles, ascending and at least one, under vertices at `carried` (numbers and rest positions in metres).
    pub(super) fn new(layer: &Layer, particles: Vec<u32>, carried: &[(u32, DVec3)]) -> Self {
        let place = |particle: &u32| layer.voxels.place(layer.voxel_of[*particle as usize] as usize);
        let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
        for at in particles.iter().map(place) {
            for axis in 0..3 {
                (low[axis], high[axis]) = (low[axis].min(at[axis]), high[axis].max(at[axis]));
            }
        }
        // The layer's box has the same margin, so this stays within.
        let reach = layer.stencil.reach;
        let (low, high) = (low.map(|n| n - reach), high.map(|n| n + reach));
        let voxels = layer.voxels.part(low, high);
        let in_layer = |voxel: usize| {
            let at = voxels.place(voxel);
            layer.voxels.number(std::array::from_fn(|axis| at[axis] + low[axis]))
        };
        let in_box = |particle: &u32| {
            let at = place(particle);
            voxels.number(std::array::from_fn(|axis| at[axis] - low[axis])) as u32
        };
        let voxel_of: Vec<u32> = particles.iter().map(in_box).collect();
        let mut slot_at = vec![NONE; voxels.count()];
        for (slot, &voxel) in voxel_of.iter().enumerate() {
            slot_at[voxel as usize] = slot as u32;
        }
        let places = places(&voxels, &slot_at, |voxel| layer.holds[in_layer(voxel)]);
        let is_on_core =
            |slot: usize| voxels.beside(voxel_of[slot] as usize).any(|v| layer.holds[in_layer(v)] == Holds::Core);
        let on_core = (0..particles.len())
            .filter(|&slot| is_on_core(slot))
            .map(|slot| OnCore { slot: slot as u32, attachment: layer.core_attachment[particles[slot] as usize] })
            .collect();
        let mut region = Self {
            nearest_interface: nearest_interface(&voxels, &places),
            steps: box_steps(&layer.stencil, &voxels),
            particles,
            voxels,
            slot_at,
            voxel_of,
            places,
            on_core,
            carried: Vec::with_capacity(carried.len()),
            terms: Vec::new(),
        };
        for &(vertex, position_m) in carried {
            region.add_carried(layer, vertex, position_m);
        }
        region
    }

    /// How many particles are awake.
    pub fn len(&self) -> usize {
        self.particles.len()
    }

    /// Never: a region has particles.
    pub fn is_empty(&self) -> bool {
        self.particles.is_empty()
    }

    /// Rest position (m) of a slot's particle.
    pub fn rest_m(&self, slot: usize) -> DVec3 {
        self.voxels.centre_m(self.voxel_of[slot] as usize)
    }

    /// Slots and weights of a carried vertex.
    pub fn terms_of(&self, carried: &CarriedVertex) -> &[(u32, f64)] {
        &self.terms[carried.terms[0] as usize..carried.terms[1] as usize]
    }

    /// The carried vertex with this number, if it is one.
    pub fn carried_vertex(&self, vertex: u32) -> Option<&CarriedVertex> {
        self.carried.iter().find(|carried| carried.vertex == vertex)
    }

    /// Force (N) of the interface on a slot's particle at `x` (m).
    pub fn interface_force_n(&self, law: InterfaceForce, stiffness_n_per_m: f64, slot: usize, x_m: DVec3) -> DVec3 {
        let started_there = self.places[self.voxel_of[slot] as usize] == Place::Interface;
        let away_m = match law {
            InterfaceForce::OwnVoxel if started_there => {
                let (centre, half) = (self.rest_m(slot), DVec3::splat(0.5 * self.voxels.spacing_m));
                x_m.clamp(centre - half, centre + half) - x_m
            }
            InterfaceForce::OwnVoxel => DVec3::ZERO,
            InterfaceForce::NearestVoxel => {
                let voxel = self.voxels.nearest(x_m);
                let crossed = self.places[voxel] == Place::Beyond;
                if started_there || crossed { self.gradient_m(voxel) } else { DVec3::ZERO }
            }
        };
        away_m * stiffness_n_per_m
    }

    /// The gradient field: from a voxel to the nearest of the interface (m).
    pub fn gradient_m(&self, voxel: usize) -> DVec3 {
        match self.nearest_interface[voxel] {
            NONE => DVec3::ZERO,
            nearest => self.voxels.centre_m(nearest as usize) - self.voxels.centre_m(voxel),
        }
    }

    /// Eq. 25 at a vertex, over awake particles only and with weights that sum to one: `W_j ΔV_j / Σ W ΔV` (as printed, they sum to about
    /// ½ on the surface). Where the support holds no awake particle, the nearest one alone.
    fn add_carried(&mut self, layer: &Layer, vertex: u32, position_m: DVec3) {
        let first = self.terms.len();
        let distance = |slot: usize| self.rest_m(slot).distance(position_m);
        let weights: Vec<(u32, f64)> = (0..self.len())
            .map(|slot| (slot as u32, layer.cone.weight_per_m3(distance(slot))))
            .filter(|(_, weight)| *weight > 0.0)
            .collect();
        let sum: f64 = weights.iter().map(|(_, weight)| weight).sum();
        if sum > 0.0 {
            self.terms.extend(weights.iter().map(|&(slot, weight)| (slot, weight / sum)));
        } else {
            let nearest = (0..self.len()).min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap_or(0);
            self.terms.push((nearest as u32, 1.0));
        }
        self.carried.push(CarriedVertex { vertex, terms: [first as u32, self.terms.len() as u32] });
    }
}

fn places(voxels: &Voxels, slot_at: &[u32], holds: impl Fn(usize) -> Holds) -> Vec<Place> {
    let is_beyond = |voxel: usize| slot_at[voxel] == NONE && holds(voxel) != Holds::Nothing;
    let place = |voxel: usize| match slot_at[voxel] {
        NONE if is_beyond(voxel) => Place::Beyond,
        NONE => Place::Free,
        _ if voxels.beside(voxel).any(is_beyond) => Place::Interface,
        _ => Place::Inside,
    };
    (0..voxels.count()).map(place).collect()
}

/// Nearest by distance between centres; of two as near the one with the lower number.
fn nearest_interface(voxels: &Voxels, places: &[Place]) -> Vec<u32> {
    let interface: Vec<(u32, [i32; 3])> = (0..places.len())
        .filter(|&voxel| places[voxel] == Place::Interface)
        .map(|voxel| (voxel as u32, voxels.place(voxel).map(|n| n as i32)))
        .collect();
    let nearest = |voxel: usize| {
        let at = voxels.place(voxel).map(|n| n as i32);
        let squared = |there: &[i32; 3]| (0..3).map(|axis| (there[axis] - at[axis]).pow(2)).sum::<i32>();
        interface.iter().min_by_key(|(_, there)| squared(there)).map_or(NONE, |(number, _)| *number)
    };
    (0..places.len()).map(nearest).collect()
}

fn box_steps(stencil: &Stencil, voxels: &Voxels) -> Vec<i32> {
    let [nx, ny, _] = voxels.size.map(|n| n as i32);
    stencil.steps.iter().map(|[i, j, k]| (k * ny + j) * nx + i).collect()
}
