//! The masses of a body whose particles all sleep, lumped on the coarse nodes that they follow: `M_i = Σ_p m_p ζ_pi`, by which
//! gravity pulls, too.
//!
//! Each cell gives an eighth of its mass to each of its particles. Where the skin lies a little before a plane of particles, the cells between hold
//! next to nothing, and so little mass would bear what presses the skin that contact, whose stiffness over mass is bounded, gives way: a heart
//! was 8 % too soft where a plane lay 0.1 spacings beyond its wall, the fingertip 1.3 mm in it. So a particle has at least an eighth of a whole
//! cell's mass, as at the corner of a box, and what it lacks comes from the particles of its cells that have more. The body's mass stays, and
//! what rests does not know of it; about a tenth of a particle's mass is a spacing farther out.
//!
//! Particles outside the coarse tets have negative weights. They are lumped with others, so that the lumped masses have no
//! less kinetic energy than the particles ([`super::composite::Anchor::bearing_weights`]); gravity pulls by the plain sum.
use super::partition::Partition;
use std::collections::BTreeSet;

/// A coarse node that no particle follows with more weight than this has no mass, and stays: where particles lie in the
/// faces of coarse tets, nodes beside the faces are followed by rounding alone, and the rounding of forces in single
/// precision would throw such masses anywhere.
const NO_FOLLOWER: f64 = 1e-6;

/// Part of a mass that is rounding.
const ROUNDING: f64 = 1e-9;
/// Least mass of a particle, over that of a whole cell.
const LEAST: f64 = 0.125;

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
    /// Gives an eighth of each cell's mass to each of its particles, shares it with those that have next to nothing, and gives the mass of
    /// particles to the coarse nodes.
    /// `density_kg_per_m3` is that of a coarse tet.
    pub fn new(partition: &Partition, density_kg_per_m3: impl Fn(usize) -> f64) -> Self {
        let mut particle_kg = vec![0.0; partition.particle_count()];
        for (number, cell) in partition.cells().iter().enumerate() {
            let density = density_kg_per_m3(cell.tet as usize);
            for (particle, volume_m3) in partition.corners(number).into_iter().zip(partition.particles_m3(number)) {
                particle_kg[particle as usize] += density * volume_m3;
            }
        }
        share(partition, &mut particle_kg, &density_kg_per_m3);
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

/// Gives particles that have less than [`LEAST`] of a whole cell's mass what they lack, from the particles of their cells that have more: of
/// each the same part of what it has more, so that none comes to have less than its least mass itself. Where these have too little it stays at what
/// they have.
fn share(partition: &Partition, particle_kg: &mut [f64], density_kg_per_m3: &impl Fn(usize) -> f64) {
    // A corner that hangs bears nothing of its cell.
    let bearing = |cell: usize| {
        let corners = partition.corners(cell).into_iter().zip(partition.particles_m3(cell));
        corners.filter(|(_, volume_m3)| *volume_m3 > 0.0).map(|(particle, _)| particle)
    };
    let mut least_kg = vec![0.0; particle_kg.len()];
    let mut neighbours: Vec<BTreeSet<u32>> = vec![BTreeSet::new(); particle_kg.len()];
    for (number, cell) in partition.cells().iter().enumerate() {
        let whole_kg = density_kg_per_m3(cell.tet as usize) * partition.edge_m(number).powi(3);
        for particle in bearing(number) {
            let least_kg = &mut least_kg[particle as usize];
            *least_kg = f64::max(*least_kg, LEAST * whole_kg);
        }
    }
    // Of a box's corners rounding alone could make particles that lack something.
    let lacks_kg = |particle: usize, mass_kg: f64| least_kg[particle] * (1.0 - ROUNDING) - mass_kg;
    for number in 0..partition.cells().len() {
        for particle in bearing(number) {
            if lacks_kg(particle as usize, particle_kg[particle as usize]) > 0.0 {
                neighbours[particle as usize].extend(bearing(number).filter(|&other| other != particle));
            }
        }
    }
    for (particle, neighbours) in neighbours.iter().enumerate().filter(|(_, neighbours)| !neighbours.is_empty()) {
        let more_kg =
            |other: u32, particle_kg: &[f64]| (particle_kg[other as usize] - least_kg[other as usize]).max(0.0);
        let available_kg: f64 = neighbours.iter().map(|&other| more_kg(other, particle_kg)).sum();
        let moved_kg = lacks_kg(particle, particle_kg[particle]).min(available_kg);
        if moved_kg <= 0.0 {
            continue;
        }
        for &other in neighbours {
            particle_kg[other as usize] -= moved_kg * (more_kg(other, particle_kg) / available_kg);
        }
        particle_kg[particle] += moved_kg;
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

    /// The lattice's planes lie anywhere beside the skin: without what is shared the lightest particle has less than a thousandth of a cell's mass. A
    /// box whose faces lie in planes has corners of an eighth, and nothing to share.
    #[test]
    fn no_particle_is_much_lighter_than_the_corner_of_a_box() {
        for partition in embedded_balls() {
            let eighths = |number: usize| partition.corners(number).into_iter().zip(partition.particles_m3(number));
            let mut alone_kg = vec![0.0; partition.particle_count()];
            for (particle, volume_m3) in (0..partition.cells().len()).flat_map(eighths) {
                alone_kg[particle as usize] += 1000.0 * volume_m3;
            }
            let masses = Masses::new(&partition, |_| 1000.0).particle_kg;
            let whole_kg = 1000.0 * partition.sites().spacing_m().powi(3);
            let lightest = |masses: &[f64]| masses.iter().copied().fold(f64::INFINITY, f64::min) / whole_kg;
            println!(
                "{} of {} particles: {} {}",
                masses.iter().zip(&alone_kg).filter(|(a, b)| a != b).count(),
                masses.len(),
                lightest(&alone_kg),
                lightest(&masses)
            );
            assert!(lightest(&masses) > 0.9 * LEAST, "{} {}", lightest(&alone_kg), lightest(&masses));
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
