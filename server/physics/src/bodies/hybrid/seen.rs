//! Whether particles see how the coarse level moves.
//!
//! The coarse level has no geometry of its own: all that it knows of a motion is what its particles do, `y_p = Σ_i ζ_pi
//! x_i`. Of more nodes than particles some motions move no particle (there are fewer equations than unknowns). Nothing
//! resists them, neither while particles sleep nor when they wake: equilibria are not stable, and what wakes makes them
//! grow until a state is refused.
use super::{composite::NO_WEIGHT, partition::Partition, spec::HybridError};
use crate::mesh::{TetMesh, tet::EDGES};
use glam::BVec3;

/// Refuses a coarse level with more nodes that may move than there are particles that follow them.
///
/// # Errors
/// [`HybridError::CoarseTooFine`].
pub(super) fn demand_seen(partition: &Partition, mesh: &TetMesh, free: &[BVec3]) -> Result<(), HybridError> {
    let mut is_followed = vec![false; free.len()];
    let mut particles = 0;
    for particle in 0..partition.particle_count() as u32 {
        let anchor = partition.anchor(particle);
        let followed = anchor.nodes.iter().zip(anchor.weights).filter(|(_, weight)| weight.abs() >= NO_WEIGHT);
        let mut follows = false;
        for node in followed.map(|(node, _)| *node as usize).filter(|&node| free[node].any()) {
            is_followed[node] = true;
            follows = true;
        }
        particles += usize::from(follows);
    }
    let nodes = is_followed.into_iter().filter(|followed| *followed).count();
    if nodes <= particles {
        return Ok(());
    }
    Err(HybridError::CoarseTooFine {
        nodes,
        particles,
        edge_mm: 1e3 * mean_edge_m(mesh),
        spacing_mm: 1e3 * partition.sites().spacing_m(),
    })
}

fn mean_edge_m(mesh: &TetMesh) -> f64 {
    let of_tet = |tet: usize| EDGES.map(|[a, b]| mesh.corners_m(tet)[a].distance(mesh.corners_m(tet)[b]));
    let count = mesh.tets().len() * EDGES.len();
    (0..mesh.tets().len()).flat_map(of_tet).sum::<f64>() / count as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bodies::hybrid::{HybridBody, ParticleSpec, Skin, Waking, sites::CORNERS, testing::tissue},
        elements::solid::{Region, Solid},
        mesh::Surface,
        testing::tet_box,
    };
    use glam::DVec3;

    /// A box of 40 x 40 x 20 mm with particles 4 mm apart, in cells of this size (mm) along each axis.
    fn laid_out(cells: [usize; 3]) -> Result<(), HybridError> {
        let size = DVec3::new(0.04, 0.04, 0.02);
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let mesh = tet_box(DVec3::ZERO, size, cells);
        let surface = Surface::of(&mesh).unwrap();
        let region = Region { name: "all".into(), material: tissue()[1], density_kg_per_m3: 1000.0 };
        let coarse = Solid { tet_region: vec![0; mesh.tets().len()], mesh, regions: vec![region] };
        let particles = ParticleSpec {
            skin: Skin::new(CORNERS.map(|corner| corner * size).to_vec(), triangles).unwrap(),
            spacing_m: 4e-3,
            fine_depth_m: None,
            smooth_skin: false,
            lattice_through_m: DVec3::ZERO,
            most_active: 600,
            waking: Waking::ByHand,
        };
        HybridBody::lay_out(&coarse, &surface, particles, &[], &mut |_| {}).map(|_| ())
    }

    /// With nodes closer than particles a load made it not finite within ten ticks; with cells of 8 mm, whose nodes are
    /// as far apart as particles, all was well.
    #[test]
    fn coarse_nodes_closer_than_particles_are_refused_by_name() {
        for cells in [[2, 2, 1], [4, 4, 2], [5, 5, 2]] {
            assert_eq!(laid_out(cells), Ok(()), "{cells:?}");
        }
        for cells in [[6, 6, 3], [8, 8, 4]] {
            let refused = laid_out(cells).unwrap_err();
            let HybridError::CoarseTooFine { nodes, particles, .. } = refused else { panic!("{refused}") };
            assert!(nodes > particles && particles <= 11 * 11 * 6, "{cells:?}: {nodes} {particles}");
            println!("{refused}");
            assert!(refused.to_string().contains("fewer, larger tets, with edges of at least 8.00 mm"), "{refused}");
        }
    }
}
