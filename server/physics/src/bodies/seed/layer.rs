//! The layer Ω_p: particles on the voxels between the core and the outer surface (2006, section 6).
//!
//! "For a uniform initial grid, the mass associated with a node can be computed from the total number of particles
//! within a known mass volume": with N voxel centres in a layer of volume V every particle has `ΔV = V/N` and
//! `m = ρ V/N`. The papers do not say how the layer is filled. Here it is filled with the voxels in which they embed
//! its regions.
use super::{
    LayerSpec, SeedError, SeedParameters,
    kernel::{Cone, Stencil},
    radial::{Attachment, Radial},
    voxels::{NONE, Voxels},
};
use glam::DVec3;

/// Largest number of rounds in which the spacing that gives the wanted number of particles is sought.
const ROUNDS: usize = 40;
/// Largest number of particles of a layer.
const MOST: u32 = 4_000_000;

/// What a voxel holds at rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Holds {
    /// The voxel lies outside the body.
    Nothing,
    /// The voxel holds a particle.
    Particle,
    /// The voxel lies in the core, or in its cavity.
    Core,
}

/// All particles of the layer at rest. Nothing of it changes in time.
#[derive(Debug, Clone)]
pub struct Layer {
    /// Voxels around the body.
    pub voxels: Voxels,
    /// What each voxel holds.
    pub holds: Vec<Holds>,
    /// Voxel of each particle; particles are in the order of their voxels.
    pub voxel_of: Vec<u32>,
    /// Particle of each voxel, or [`NONE`].
    pub particle_at: Vec<u32>,
    /// Volume ΔV (m³) of a particle.
    pub volume_m3: f64,
    /// Mass (kg) of a particle.
    pub mass_kg: f64,
    /// The particles' weight.
    pub cone: Cone,
    /// Neighbours of a particle.
    pub stencil: Stencil,
    /// Triangle of the skin over each particle.
    pub triangle_over: Vec<u32>,
    /// Attachment point of each particle on the core, where its ray to the mass centre meets it.
    pub core_attachment: Vec<Attachment>,
}

/// The two surfaces that enclose a layer.
pub(super) struct Walls<'a> {
    pub(super) core_m: &'a [DVec3],
    pub(super) core_triangles: &'a [[u32; 3]],
    pub(super) core: &'a Radial,
    pub(super) skin: &'a Radial,
}

impl Layer {
    pub(super) fn new(spec: &LayerSpec, walls: &Walls<'_>, parameters: &SeedParameters) -> Result<Self, SeedError> {
        let wanted = spec.particles;
        let volume_m3 =
            enclosed_m3(&spec.skin_m, &spec.skin_triangles) - enclosed_m3(walls.core_m, walls.core_triangles);
        let none = |found| SeedError::NoLayer { found, wanted, volume_m3 };
        if !(volume_m3 > 0.0 && (1..=MOST).contains(&wanted)) {
            return Err(none(0));
        }
        let first_m = spec.skin_m[0];
        let (low_m, high_m) = spec.skin_m.iter().fold((first_m, first_m), |(a, b), &p| (a.min(p), b.max(p)));
        // Boxes of regions reach as far beyond their particles as a neighbour may be.
        let margin = (2.0 * parameters.smoothing_ratio).ceil() as usize;
        let mut spacing_m = (volume_m3 / f64::from(wanted)).cbrt();
        let mut best: Option<(usize, Voxels, Vec<Holds>)> = None;
        for _ in 0..ROUNDS {
            let voxels = Voxels::covering(low_m, high_m, spacing_m, margin);
            let holds = held_by(&voxels, spec, walls);
            let found = holds.iter().filter(|&&h| h == Holds::Particle).count();
            let miss = found.abs_diff(wanted as usize);
            if best.as_ref().is_none_or(|(least, ..)| miss < *least) {
                best = Some((miss, voxels, holds));
            }
            if miss == 0 {
                break;
            }
            spacing_m *= ((found.max(1)) as f64 / f64::from(wanted)).cbrt();
        }
        let Some((_, voxels, holds)) = best else { return Err(none(0)) };
        let voxel_of: Vec<u32> =
            (0..holds.len() as u32).filter(|&voxel| holds[voxel as usize] == Holds::Particle).collect();
        let count = voxel_of.len();
        if count == 0 || count.abs_diff(wanted as usize) * 10 > wanted as usize {
            return Err(none(count));
        }
        let mut particle_at = vec![NONE; holds.len()];
        for (particle, &voxel) in voxel_of.iter().enumerate() {
            particle_at[voxel as usize] = particle as u32;
        }
        let cone = Cone::of_smoothing_length(parameters.smoothing_ratio * voxels.spacing_m);
        let particle_m3 = volume_m3 / count as f64;
        let rest_m = |&voxel: &u32| voxels.centre_m(voxel as usize);
        Ok(Self {
            holds,
            particle_at,
            volume_m3: particle_m3,
            mass_kg: parameters.density_kg_per_m3 * particle_m3,
            stencil: Stencil::new(&cone, voxels.spacing_m, particle_m3),
            cone,
            triangle_over: voxel_of.iter().map(|voxel| walls.skin.attachment(rest_m(voxel)).triangle).collect(),
            core_attachment: voxel_of.iter().map(|voxel| walls.core.attachment(rest_m(voxel))).collect(),
            voxel_of,
            voxels,
        })
    }

    /// Returns the number of particles, asleep or awake.
    pub fn particle_count(&self) -> usize {
        self.voxel_of.len()
    }

    /// Returns the rest position (m) of a particle.
    pub fn rest_m(&self, particle: u32) -> DVec3 {
        self.voxels.centre_m(self.voxel_of[particle as usize] as usize)
    }
}

fn held_by(voxels: &Voxels, spec: &LayerSpec, walls: &Walls<'_>) -> Vec<Holds> {
    let skin = voxels.enclosed(&spec.skin_m, &spec.skin_triangles);
    let core = voxels.enclosed(walls.core_m, walls.core_triangles);
    let holds = |(skin, core): (bool, bool)| match (skin, core) {
        (_, true) => Holds::Core,
        (true, false) => Holds::Particle,
        (false, false) => Holds::Nothing,
    };
    skin.into_iter().zip(core).map(holds).collect()
}

/// Returns the volume `∮ x·n dA/3` (m³) that a closed surface encloses.
pub(super) fn enclosed_m3(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
    triangles.iter().map(|t| signed_m3(positions_m, *t)).sum()
}

/// Returns `∫ x dV` (m⁴) over the volume that a closed surface encloses. The tet from the origin to a triangle has its
/// centre at a quarter of the sum of the triangle's corners.
pub(super) fn enclosed_moment_m4(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> DVec3 {
    let moment = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|n| positions_m[n as usize]);
        (a + b + c) * (0.25 * signed_m3(positions_m, *t))
    };
    triangles.iter().map(moment).sum()
}

fn signed_m3(positions_m: &[DVec3], triangle: [u32; 3]) -> f64 {
    let [a, b, c] = triangle.map(|n| positions_m[n as usize]);
    a.dot(b.cross(c)) / 6.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::seed::{SeedModel, testing::ball_spec};

    #[test]
    fn the_layer_holds_about_the_wanted_particles_and_all_of_its_volume() {
        let spec = ball_spec();
        let model = SeedModel::build(spec.clone()).unwrap();
        let layer = model.layer().unwrap();
        let count = layer.particle_count();
        println!("{count} particles, {:.3} mm apart", layer.voxels.spacing_m * 1e3);
        assert!(count.abs_diff(8000) <= 40, "{count}");
        let skin = spec.layer.unwrap();
        let volume = enclosed_m3(&skin.skin_m, &skin.skin_triangles)
            - enclosed_m3(spec.core.positions_m(), model.core().outer_triangles());
        assert!((layer.volume_m3 * count as f64 / volume - 1.0).abs() < 1e-12);
        // A voxel's volume is a particle's, but for the voxels that the walls cut.
        assert!((layer.voxels.spacing_m.powi(3) / layer.volume_m3 - 1.0).abs() < 0.02);
        for particle in 0..count as u32 {
            let r = layer.rest_m(particle).length();
            assert!(r < 0.03 && r > 0.016, "{r}");
        }
    }

    #[test]
    fn layers_without_room_are_refused() {
        let mut spec = ball_spec();
        if let Some(layer) = &mut spec.layer {
            for p in &mut layer.skin_m {
                *p *= 0.5;
            }
        }
        assert!(SeedModel::build(spec).unwrap_err().to_string().contains("larger than"));
    }
}
