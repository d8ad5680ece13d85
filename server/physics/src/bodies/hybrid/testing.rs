//! Shapes for tests.
use super::{
    Hybrid, ParticleSpec, Waking,
    cell::RestCell,
    composite::Composite,
    methods::{CONTROL, Method},
    moments::integrate,
    partition::Partition,
    patch::{Field, Patch},
    sites::{CORNERS, Sites},
    sizes,
    skin::Skin,
    smoothing_kernels::Kernel,
};
pub(crate) use crate::random::Random;
use crate::{
    material::{Convention, Lame, Law, Material, Viscosity},
    mesh::{Surface, TetMesh},
    settings::PrescribedSpec,
};
use glam::{DMat3, DVec3};
use std::collections::{BTreeMap, BTreeSet};

/// A sphere: an icosahedron whose triangles are split in four `rounds` times.
pub(crate) fn ball(radius_m: f64, centre_m: DVec3, rounds: u32) -> Skin {
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
    for _ in 0..rounds {
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
    let on_sphere = points.iter().map(|p| centre_m + p.normalize() * radius_m).collect();
    Skin::new(on_sphere, triangles).unwrap()
}

/// A box of `cells` of six tets each.
pub(crate) fn tet_box(low: DVec3, size: DVec3, cells: [usize; 3]) -> TetMesh {
    let count = cells.map(|n| n + 1);
    let number = |[i, j, k]: [usize; 3]| ((k * count[1] + j) * count[0] + i) as u32;
    let places =
        |n: [usize; 3]| (0..n[2]).flat_map(move |k| (0..n[1]).flat_map(move |j| (0..n[0]).map(move |i| [i, j, k])));
    let positions: Vec<DVec3> = places(count)
        .map(|at| low + size * DVec3::from(std::array::from_fn(|axis| at[axis] as f64 / cells[axis] as f64)))
        .collect();
    let mut tets = Vec::new();
    for place in places(cells) {
        for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            let mut at = place;
            let mut tet = [number(at); 4];
            for (step, axis) in order.into_iter().enumerate() {
                at[axis] += 1;
                tet[step + 1] = number(at);
            }
            let [a, b, c, d] = tet.map(|n| positions[n as usize]);
            if (b - a).cross(c - a).dot(d - a) < 0.0 {
                tet.swap(2, 3);
            }
            tets.push(tet);
        }
    }
    TetMesh::new(positions, tets).unwrap()
}

/// 80 × 80 × 40 mm in 2 × 2 × 1 cells.
pub(crate) fn slab() -> TetMesh {
    tet_box(DVec3::ZERO, DVec3::new(0.08, 0.08, 0.04), [2, 2, 1])
}

/// A ball of 10 mm radius off the lattice, in a box of coarse tets that reaches past it.
pub(crate) fn ball_in_cage() -> Partition {
    balls_in_cage()[0].clone()
}

/// The same, and with cells merged that its surface does not cut.
pub(crate) fn balls_in_cage() -> [Partition; 2] {
    let skin = ball(0.01, DVec3::new(0.2e-3, -0.3e-3, 0.1e-3), 3);
    let sites = Sites::covering(skin.bounds_m(), 1.1e-3, DVec3::splat(0.4e-3));
    let cage = tet_box(DVec3::splat(-0.0125), DVec3::splat(0.025), [3, 3, 3]);
    let moments = integrate(&skin, &sites, &mut |_| {});
    let composite = Composite::new(&cage);
    let two_sizes = sizes::merge(&sites, moments.clone(), 1, |_| true);
    [moments, two_sizes].map(|moments| Partition::new(sites, composite.clone(), &moments))
}

/// That ball as a body of two materials; the coarse nodes below −9 mm are held along two axes, those beyond 9 mm along y along all.
pub(crate) fn hybrid_ball(materials: &[Material; 2]) -> Hybrid {
    hybrid_ball_of(materials, 1.1e-3, None)
}

/// The same of another spacing, or with cells that are merged deeper than that (m).
pub(crate) fn hybrid_ball_of(materials: &[Material; 2], spacing_m: f64, fine_depth_m: Option<f64>) -> Hybrid {
    let cage = tet_box(DVec3::splat(-0.0125), DVec3::splat(0.025), [3, 3, 3]);
    let spec = ParticleSpec {
        skin: ball(0.01, DVec3::new(0.2e-3, -0.3e-3, 0.1e-3), 3),
        spacing_m,
        fine_depth_m,
        lattice_through_m: DVec3::splat(0.4e-3),
        most_active: 2000,
        waking: Waking::ByHand,
    };
    let middle = |tet: usize| cage.corners_m(tet).iter().sum::<DVec3>() / 4.0;
    let of_tet: Vec<u16> = (0..cage.tets().len()).map(|tet| u16::from(middle(tet).y > 0.0)).collect();
    let nodes = |of: &dyn Fn(DVec3) -> bool| -> Vec<u32> {
        (0..cage.positions_m().len() as u32).filter(|&n| of(cage.positions_m()[n as usize])).collect()
    };
    let low = PrescribedSpec { name: "low".into(), nodes: nodes(&|p| p.z < -9e-3), axes: [true, false, true] };
    let far = PrescribedSpec { name: "far".into(), nodes: nodes(&|p| p.y > 9e-3), axes: [true; 3] };
    let surface = Surface::of(&cage).unwrap();
    let densities = [1000.0, 1200.0];
    let built =
        Hybrid::build(&spec, (&cage, &surface), &[low, far], (materials, &densities), &of_tet, &mut |_| {}).unwrap();
    built.hybrid
}

/// A block of full cells of spacing 1 mm, in a box of coarse tets.
pub(crate) fn block_in_cage(cells: [usize; 3]) -> Partition {
    let size = DVec3::from(cells.map(|n| n as f64)) * 1e-3;
    let corners = CORNERS.map(|corner| corner * size).to_vec();
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let skin = Skin::new(corners, triangles).unwrap();
    let sites = Sites::covering(skin.bounds_m(), 1e-3, DVec3::ZERO);
    let moments = integrate(&skin, &sites, &mut |_| {});
    Partition::new(sites, Composite::new(&tet_box(DVec3::ZERO, size, [1, 1, 1])), &moments)
}

/// One material of each law, nearly incompressible and viscous.
pub(crate) fn tissue() -> [Material; 3] {
    let lame = Lame::from_young_poisson(10e3, 0.45).unwrap();
    let viscosity = Viscosity::new(3.0, 2.0).unwrap();
    [Law::StVenantKirchhoff, Law::StableNeoHookean, Law::FixedCorotated]
        .map(|law| Material::new(law, lame, viscosity, Convention::Consistent))
}

/// Every position mapped.
pub(crate) fn moved(field: &Field, map: impl Fn(DVec3) -> DVec3) -> Field {
    Field {
        nodes: field.nodes.iter().map(|p| map(*p)).collect(),
        particles: field.particles.iter().map(|p| map(*p)).collect(),
    }
}

/// Random vectors in place of a field's.
pub(crate) fn random_like(field: &Field, size: f64, random: &mut Random) -> Field {
    let mut shaken = |list: &[DVec3]| list.iter().map(|_| random.vector() * size).collect::<Vec<_>>();
    Field { nodes: shaken(&field.nodes), particles: shaken(&field.particles) }
}

/// `a + s b`.
pub(crate) fn plus(a: &Field, b: &Field, s: f64) -> Field {
    let sum = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| *a + *b * s).collect();
    Field { nodes: sum(&a.nodes, &b.nodes), particles: sum(&a.particles, &b.particles) }
}

/// Those that do not.
pub(crate) const RAW: [Method; 2] = [Method::RawSph(Kernel::Cone), Method::RawSph(Kernel::WendlandC2)];
/// Methods that reproduce affine motion.
pub(crate) const CORRECTED: [Method; 5] = [
    Method::CorrectedSph { kernel: Kernel::Cone, control: CONTROL },
    Method::CorrectedSph { kernel: Kernel::WendlandC2, control: CONTROL },
    Method::MovingLeastSquares { control: CONTROL },
    Method::ElementFreeGalerkin,
    Method::NodalSmoothing { gamma: 0.5 },
];

/// Half of a ball.
pub(crate) fn half(partition: &Partition) -> BTreeSet<u32> {
    (0..partition.particle_count() as u32).filter(|&p| partition.particle_m(p).x > 0.2e-3).collect()
}

/// And that half awake.
pub(crate) fn half_awake(partition: &Partition, method: Method) -> Patch {
    let active = half(partition);
    Patch::with_points(partition, &active, &method.points(partition, &active))
}

/// A matrix not far from the identity.
pub(crate) fn stretch(random: &mut Random) -> DMat3 {
    DMat3::IDENTITY + DMat3::from_cols(random.vector(), random.vector(), random.vector()) * 0.1
}

/// The cells of that ball, all awake, and their particles at rest (m).
pub(crate) fn ball_cells() -> (Vec<([u32; 8], RestCell)>, Vec<DVec3>) {
    let partition = ball_in_cage();
    let rest = (0..partition.particle_count() as u32).map(|p| partition.particle_m(p)).collect();
    let cell = |c: usize| (partition.corners(c), partition.rest_cell(c, 0.98));
    ((0..partition.cells().len()).map(cell).collect(), rest)
}
