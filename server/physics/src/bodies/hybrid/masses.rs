//! The masses of a body whose particles all sleep, lumped on the coarse nodes that they follow: `M_i = Σ_p m_p ζ_pi`, by which
//! gravity pulls, too.
//!
//! Particles outside the coarse tets have negative weights. They are lumped with others, so that the lumped masses have no
//! less kinetic energy than the particles ([`super::composite::Anchor::bearing_weights`]); gravity pulls by the plain sum.
use super::partition::Partition;

/// A coarse node that no particle follows with more weight than this has no mass, and stays: where particles lie in the
/// faces of coarse tets, nodes beside the faces are followed by rounding alone, and the rounding of forces in single
/// precision would throw such masses anywhere.
const NO_FOLLOWER: f64 = 1e-6;

/// Masses of a body whose particles all sleep.
#[derive(Debug, Clone, PartialEq)]
pub struct Masses {
    /// `m_p` (kg).
    pub particle_kg: Vec<f64>,
    /// `M_i` (kg).
    pub node_kg: Vec<f64>,
    /// `Σ_p m_p ζ_pi` (kg), by which gravity pulls on the nodes.
    pub node_weight_kg: Vec<f64>,
}

impl Masses {
    /// Gives an eighth of each cell's mass to each of its particles, and that of the particles to the coarse nodes.
    /// `density_kg_per_m3` is that of a coarse tet.
    pub fn new(partition: &Partition, density_kg_per_m3: impl Fn(usize) -> f64) -> Self {
        let mut particle_kg = vec![0.0; partition.particle_count()];
        for (number, cell) in partition.cells().iter().enumerate() {
            let density = density_kg_per_m3(cell.tet as usize);
            for (particle, volume_m3) in partition.corners(number).into_iter().zip(partition.particles_m3(number)) {
                particle_kg[particle as usize] += density * volume_m3;
            }
        }
        let mut node_kg = vec![0.0; partition.coarse().positions_m().len()];
        let mut node_weight_kg = node_kg.clone();
        let mut largest_weights = node_kg.clone();
        for (particle, mass) in particle_kg.iter().enumerate() {
            let anchor = partition.anchor(particle as u32);
            for ((&node, weight), lumped_kg) in anchor.nodes.iter().zip(anchor.weights).zip(anchor.lumped_kg(*mass)) {
                node_weight_kg[node as usize] += mass * weight;
                node_kg[node as usize] += lumped_kg;
                largest_weights[node as usize] = f64::max(largest_weights[node as usize], weight.abs());
            }
        }
        for (node, _) in largest_weights.iter().enumerate().filter(|(_, weight)| **weight <= NO_FOLLOWER) {
            (node_kg[node], node_weight_kg[node]) = (0.0, 0.0);
        }
        Self { particle_kg, node_kg, node_weight_kg }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bodies::hybrid::{
            composite::Composite,
            moments::integrate,
            sites::Sites,
            skin::Skin,
            testing::{Random, balls_sticking_out, embedded_balls, tet_box},
        },
        mesh::Surface,
    };
    use glam::DVec3;

    #[test]
    fn masses_are_the_bodys() {
        for partition in embedded_balls() {
            let (masses, volume_m3) = (Masses::new(&partition, |_| 1000.0), partition.volume_m3());
            for list in [&masses.particle_kg, &masses.node_kg] {
                assert!((list.iter().sum::<f64>() / (1000.0 * volume_m3) - 1.0).abs() < 1e-12);
            }
        }
    }

    /// A plate 8 mm thick in four layers of tets as high as particles are apart: all particles lie in faces of tets.
    #[test]
    fn a_node_that_particles_follow_by_rounding_alone_has_no_mass() {
        let size_m = DVec3::new(0.02, 0.02, 0.008);
        let block = tet_box(DVec3::ZERO, size_m, [1, 1, 1]);
        let surface = Surface::of(&block).unwrap();
        let triangles = (0..surface.triangles.len()).map(|triangle| surface.triangle_nodes(triangle)).collect();
        let skin = Skin::new(block.positions_m().to_vec(), triangles).unwrap();
        let sites = Sites::covering(skin.bounds_m(), 2e-3, DVec3::ZERO);
        let coarse = Composite::new(&tet_box(DVec3::ZERO, size_m, [2, 2, 4]));
        let partition = Partition::new(sites, coarse, &integrate(&skin, &sites, &mut |_| {}));
        let masses = Masses::new(&partition, |_| 1000.0);
        let whole_kg = 1000.0 * partition.volume_m3();
        for list in [&masses.node_kg, &masses.node_weight_kg] {
            assert!((list.iter().sum::<f64>() / whole_kg - 1.0).abs() < 1e-6);
            assert!(list.contains(&0.0));
            assert!(list.iter().all(|&mass| mass == 0.0 || mass > 1e-6 * whole_kg / list.len() as f64), "{list:?}");
        }
    }

    /// That no frequency is higher than with all particles awake rests on this.
    #[test]
    fn lumped_masses_move_with_no_less_energy_than_what_follows_them() {
        let mut random = Random(14);
        for (partition, _) in balls_sticking_out() {
            let masses = Masses::new(&partition, |_| 1000.0);
            for _ in 0..20 {
                let v: Vec<DVec3> = masses.node_kg.iter().map(|_| random.vector() * random.unit().powi(8)).collect();
                let of =
                    |(particle, mass): (usize, &f64)| mass * partition.anchor(particle as u32).of(&v).length_squared();
                let of_particles: f64 = masses.particle_kg.iter().enumerate().map(of).sum();
                let lumped: f64 = masses.node_kg.iter().zip(&v).map(|(mass, v)| mass * v.length_squared()).sum();
                assert!(of_particles <= lumped * (1.0 + 1e-12), "{of_particles} {lumped}");
            }
        }
    }
}
