//! The region RV(ps) of a touched point (2006, sections 6 and 6.1): which particles are awake, and where their
//! interface is.
//!
//! The papers project the boundary of nv(ps) — the touched triangle's corners and their first neighbours — towards the
//! mass centre onto the core and take the particles between. A particle lies there exactly when its own ray from the
//! mass centre leaves through a triangle of nv(ps). So a region is the union of the particles under some triangles, and
//! the polygon C(ps) is not needed.
//!
//! RV is embedded in a box of voxels B(ps). Its *interface* (the papers' border) consists of the voxels of RV beside a
//! voxel of the body outside RV: at the sides these hold other particles, below they hold the core. Towards the skin
//! there is no interface ("inner boundaries"). Every voxel of B knows the nearest interface voxel; the vector to it is
//! the gradient field.
//!
//! The *interface force as printed* ([`InterfaceForce::NearestVoxel`]) is k times the gradient at the particle's voxel;
//! it acts on particles that started at the interface and on those beyond it. It is constant within a voxel, jumps
//! between voxels, and changes its direction where another interface voxel becomes the nearest: it has no potential and
//! pumps energy, at any step. The *repaired* force ([`InterfaceForce::OwnVoxel`]) draws a particle of the interface to
//! its own voxel by `k (c − x)`, where c is the voxel's point nearest to x: it is zero within the voxel, continuous,
//! and has the potential `½k|x − c|²`. It does not act on other particles, which have no voxel at the interface.
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
    /// The voxel is in the region, and not at its interface.
    Inside,
    /// The voxel is in the region, at its interface.
    Interface,
    /// The voxel is in the body, outside the region.
    Beyond,
    /// The voxel is outside the body.
    Free,
}

/// A particle of the interface beside the core.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnCore {
    /// Its slot in the region.
    pub slot: u32,
    /// Its attachment point on the face below it.
    pub attachment: Attachment,
}

/// A vertex of the skin that awake particles carry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CarriedVertex {
    /// The vertex.
    pub vertex: u32,
    /// First entry of its terms in [`Region::terms`], and their end.
    pub terms: [u32; 2],
}

/// The particles that are awake while one triangle of the skin is touched. A *slot* is an index in the list of
/// particles.
#[derive(Debug, Clone)]
pub struct Region {
    /// The particles, ascending.
    pub particles: Vec<u32>,
    /// The box B(ps).
    pub voxels: Voxels,
    /// Slot of each voxel of B, or [`NONE`].
    pub slot_at: Vec<u32>,
    /// Voxel of B of each slot.
    pub voxel_of: Vec<u32>,
    /// What each voxel of B is to the region.
    pub places: Vec<Place>,
    /// Interface voxel of B nearest to each voxel, or [`NONE`] where there is no interface.
    pub nearest_interface: Vec<u32>,
    /// Particles of the interface beside the core.
    pub on_core: Vec<OnCore>,
    /// Carried vertices: those of nv(ps).
    pub carried: Vec<CarriedVertex>,
    /// Slots with weights, of all carried vertices.
    pub terms: Vec<(u32, f64)>,
    /// Steps of the stencil as differences of the numbers of B's voxels.
    pub steps: Vec<i32>,
}

impl Region {
    /// Returns the region of `particles`, which are ascending and at least one, that carries the vertices `carried`,
    /// given by their numbers and rest positions (m).
    pub(super) fn new(layer: &Layer, particles: Vec<u32>, carried: &[(u32, DVec3)]) -> Self {
        let place = |particle: &u32| layer.voxels.place(layer.voxel_of[*particle as usize] as usize);
        let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
        for at in particles.iter().map(place) {
            for axis in 0..3 {
                (low[axis], high[axis]) = (low[axis].min(at[axis]), high[axis].max(at[axis]));
            }
        }
        // The layer's box has the same margin, so this box stays within it.
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

    /// Returns the number of particles.
    pub fn len(&self) -> usize {
        self.particles.len()
    }

    /// Returns whether there are no particles, which is never so.
    pub fn is_empty(&self) -> bool {
        self.particles.is_empty()
    }

    /// Returns the rest position (m) of a slot's particle.
    pub fn rest_m(&self, slot: usize) -> DVec3 {
        self.voxels.centre_m(self.voxel_of[slot] as usize)
    }

    /// Returns the slots and weights of a carried vertex.
    pub fn terms_of(&self, carried: &CarriedVertex) -> &[(u32, f64)] {
        &self.terms[carried.terms[0] as usize..carried.terms[1] as usize]
    }

    /// Returns the carried vertex with this number, if the region carries it.
    pub fn carried_vertex(&self, vertex: u32) -> Option<&CarriedVertex> {
        self.carried.iter().find(|carried| carried.vertex == vertex)
    }

    /// Returns the force (N) of the interface on a slot's particle at `x_m` (m).
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

    /// Returns the gradient field at a voxel: the vector (m) to the nearest voxel of the interface.
    pub fn gradient_m(&self, voxel: usize) -> DVec3 {
        match self.nearest_interface[voxel] {
            NONE => DVec3::ZERO,
            nearest => self.voxels.centre_m(nearest as usize) - self.voxels.centre_m(voxel),
        }
    }

    /// Adds a carried vertex, by eq. 25 over awake particles only and with weights that sum to one: `W_j ΔV_j / Σ W ΔV`
    /// (as printed, they sum to about ½ on the surface). Where the support holds no awake particle, the nearest one
    /// alone carries the vertex.
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

/// Returns the interface voxel nearest to each voxel, by the distance between centres; of two as near it is the one
/// with the lower number.
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
