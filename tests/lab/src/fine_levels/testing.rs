//! Bodies and fields for tests.
use super::methods::{CONTROL, Kernel, Method, PointPatch};
use crate::stress::random::Random;
use glam::{DMat3, DVec3};
use palpate_physics::{
    Surface, TetMesh,
    bodies::hybrid::{
        Skin, composite::Composite, moments::integrate, partition::Partition, patch::Field, sites::Sites,
    },
    material::{Convention, Lame, Law, Material, Viscosity},
};
use palpate_scene::shapes::{box_mesh, sphere_shell};
use std::collections::BTreeSet;

/// Methods that reproduce no affine motion.
pub(super) const RAW: [Method; 2] = [Method::RawSph(Kernel::Cone), Method::RawSph(Kernel::WendlandC2)];
/// Methods that do.
pub(super) const CORRECTED: [Method; 5] = [
    Method::CorrectedSph { kernel: Kernel::Cone, control: CONTROL },
    Method::CorrectedSph { kernel: Kernel::WendlandC2, control: CONTROL },
    Method::MovingLeastSquares { control: CONTROL },
    Method::ElementFreeGalerkin,
    Method::NodalSmoothing { gamma: 0.5 },
];

/// A box of `cells` of six tets each, its lowest corner at `low_m`.
fn tet_box(low_m: DVec3, size_m: DVec3, cells: [u32; 3]) -> TetMesh {
    let mesh = box_mesh(size_m, cells).unwrap().mesh;
    TetMesh::new(mesh.positions_m().iter().map(|p| low_m + *p).collect(), mesh.tets().to_vec()).unwrap()
}

/// The skin of a ball of 10 mm radius, off the lattice of [`ball_in_cage`].
pub(super) fn ball() -> Skin {
    let shell = sphere_shell(0.005, 0.01, 4000).unwrap();
    let outer = shell.region("outer").unwrap();
    let nodes = outer.nodes();
    let vertex = |node: u32| nodes.binary_search(&node).unwrap() as u32;
    let off_m = DVec3::new(0.2e-3, -0.3e-3, 0.1e-3);
    let positions_m = nodes.iter().map(|&node| shell.mesh.positions_m()[node as usize] + off_m).collect();
    Skin::new(positions_m, outer.triangles.iter().map(|triangle| triangle.map(vertex)).collect()).unwrap()
}

/// That ball in a box of coarse tets that reaches past it.
pub(super) fn ball_in_cage() -> Partition {
    let skin = ball();
    let sites = Sites::covering(skin.bounds_m(), 1.1e-3, DVec3::splat(0.4e-3));
    let cage = tet_box(DVec3::splat(-0.0125), DVec3::splat(0.025), [3; 3]);
    let moments = integrate(&skin, &sites, &mut |_| {});
    Partition::new(sites, Composite::new(&cage), &moments)
}

/// A block of full cells of spacing 1 mm, in a box of coarse tets.
pub(super) fn block_in_cage(cells: [u32; 3]) -> Partition {
    let mesh = tet_box(DVec3::ZERO, DVec3::from(cells.map(f64::from)) * 1e-3, [1; 3]);
    let surface = Surface::of(&mesh).unwrap();
    let corners_m = surface.nodes.iter().map(|&node| mesh.positions_m()[node as usize]).collect();
    let skin = Skin::new(corners_m, surface.triangles).unwrap();
    let sites = Sites::covering(skin.bounds_m(), 1e-3, DVec3::ZERO);
    let moments = integrate(&skin, &sites, &mut |_| {});
    Partition::new(sites, Composite::new(&mesh), &moments)
}

/// One material of each law, nearly incompressible and viscous.
pub(super) fn tissue() -> [Material; 3] {
    let lame = Lame::from_young_poisson(10e3, 0.45).unwrap();
    let viscosity = Viscosity::new(3.0, 2.0).unwrap();
    [Law::StVenantKirchhoff, Law::StableNeoHookean, Law::FixedCorotated]
        .map(|law| Material::new(law, lame, viscosity, Convention::Consistent))
}

/// Every position mapped.
pub(super) fn moved(field: &Field, map: impl Fn(DVec3) -> DVec3) -> Field {
    Field {
        nodes: field.nodes.iter().map(|p| map(*p)).collect(),
        particles: field.particles.iter().map(|p| map(*p)).collect(),
    }
}

/// Random vectors in place of a field's.
pub(super) fn random_like(field: &Field, size: f64, random: &mut Random) -> Field {
    let mut shaken = |list: &[DVec3]| list.iter().map(|_| random.vector() * size).collect::<Vec<_>>();
    Field { nodes: shaken(&field.nodes), particles: shaken(&field.particles) }
}

/// `a + s b`.
pub(super) fn plus(a: &Field, b: &Field, s: f64) -> Field {
    let sum = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| *a + *b * s).collect();
    Field { nodes: sum(&a.nodes, &b.nodes), particles: sum(&a.particles, &b.particles) }
}

/// Half of the particles of [`ball_in_cage`].
pub(super) fn half(partition: &Partition) -> BTreeSet<u32> {
    (0..partition.particle_count() as u32).filter(|&p| partition.particle_m(p).x > 0.2e-3).collect()
}

/// That half awake.
pub(super) fn half_awake(partition: &Partition, method: Method) -> PointPatch {
    let active = half(partition);
    PointPatch::new(partition, &active, &method.points(partition, &active))
}

/// A matrix not far from the identity.
pub(super) fn stretch(random: &mut Random) -> DMat3 {
    DMat3::IDENTITY + DMat3::from_cols(random.vector(), random.vector(), random.vector()) * 0.1
}
