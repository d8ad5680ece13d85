//! Bodies, fields and numbers for tests: those that the figures of `docs/adr/hybrid.md` are from, which depend on the strain and on how the ball lies.
use super::methods::{CONTROL, Kernel, Method, PointPatch};
use glam::{DMat3, DVec3};
use palpate_physics::{
    Surface, TetMesh,
    bodies::hybrid::{
        Skin, composite::Composite, moments::integrate, partition::Partition, patch::Field, sites::Sites,
    },
    material::{Convention, Lame, Law, Material, Viscosity},
};
use palpate_scene::shapes::box_mesh;
use std::collections::{BTreeMap, BTreeSet};

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

/// Numbers without a pattern (xorshift64).
pub(super) struct Random(pub(super) u64);

impl Random {
    /// In [0, 1).
    pub(super) fn unit(&mut self) -> f64 {
        for shift in [13_i32, -7, 17] {
            self.0 ^= if shift > 0 { self.0 << shift } else { self.0 >> -shift };
        }
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Components in (−1, 1).
    pub(super) fn vector(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - DVec3::ONE
    }
}

/// A box of `cells` of six tets each, its lowest corner at `low_m`.
fn tet_box(low_m: DVec3, size_m: DVec3, cells: [u32; 3]) -> TetMesh {
    let mesh = box_mesh(size_m, cells).unwrap().mesh;
    TetMesh::new(mesh.positions_m().iter().map(|p| low_m + *p).collect(), mesh.tets().to_vec()).unwrap()
}

/// The skin of a ball of 10 mm radius, off the lattice of [`ball_in_cage`]: an icosahedron whose triangles are split in four three times.
pub(super) fn ball() -> Skin {
    let golden = f64::midpoint(1.0, 5.0_f64.sqrt());
    let mut points: Vec<DVec3> = Vec::new();
    for (a, b) in [(1.0, golden), (1.0, -golden), (-1.0, golden), (-1.0, -golden)] {
        points.extend([DVec3::new(0.0, a, b), DVec3::new(a, b, 0.0), DVec3::new(b, 0.0, a)]);
    }
    let mut triangles = Vec::new();
    for (i, j) in (0..12).flat_map(|i| (i + 1..12).map(move |j| (i, j))) {
        for k in j + 1..12 {
            let near = |a: usize, b: usize| (points[a].distance(points[b]) - 2.0).abs() < 1e-9;
            if near(i, j) && near(j, k) && near(k, i) {
                let [a, b, c] = [i, j, k].map(|n| points[n]);
                let outward = (b - a).cross(c - a).dot(a) > 0.0;
                triangles.push(if outward { [i, j, k] } else { [i, k, j] }.map(|n| n as u32));
            }
        }
    }
    for _ in 0..3 {
        let mut middle: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        let mut split = Vec::new();
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[u, v]| {
                *middle.entry([u.min(v), u.max(v)]).or_insert_with(|| {
                    points.push((points[u as usize] + points[v as usize]) * 0.5);
                    points.len() as u32 - 1
                })
            });
            split.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = split;
    }
    let centre_m = DVec3::new(0.2e-3, -0.3e-3, 0.1e-3);
    Skin::new(points.iter().map(|p| centre_m + p.normalize() * 0.01).collect(), triangles).unwrap()
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
