//! Shapes for tests.
use super::{
    HybridBody, ParticleSpec, Waking, cell::RestCell, composite::Composite, moments::integrate, partition::Partition,
    patch::Field, sites::Sites, sizes, skin::Skin,
};
pub(crate) use crate::testing::{Random, slab, tet_box};
use crate::{
    Region, Solid,
    material::{Convention, Lame, Law, Material, Viscosity},
    mesh::Surface,
    settings::PrescribedSpec,
    testing::sphere,
};
use glam::DVec3;
use std::collections::BTreeSet;

/// Returns the skin of a ball: an icosahedron whose triangles are split in four `rounds` times.
pub(crate) fn ball(radius_m: f64, centre_m: DVec3, rounds: u32) -> Skin {
    let (directions, triangles) = sphere(rounds);
    Skin::new(directions.iter().map(|&direction| centre_m + direction * radius_m).collect(), triangles).unwrap()
}

/// Returns a ball of 10 mm radius, its centre off the lattice, in a box of coarse tets that holds it.
pub(crate) fn embedded_ball() -> Partition {
    embedded_balls()[0].clone()
}

/// Returns the same ball, and one with cells merged that its surface does not cut.
pub(crate) fn embedded_balls() -> [Partition; 2] {
    let skin = ball(0.01, DVec3::new(0.2e-3, -0.3e-3, 0.1e-3), 3);
    let sites = Sites::covering(skin.bounds_m(), 1.1e-3, DVec3::splat(0.4e-3));
    let coarse = tet_box(DVec3::splat(-0.0125), DVec3::splat(0.025), [3, 3, 3]);
    let moments = integrate(&skin, &sites, &mut |_| {});
    let composite = Composite::new(&coarse);
    let two_sizes = sizes::merge(&sites, moments.clone(), 1, |_| true);
    [moments, two_sizes].map(|moments| Partition::new(sites, composite.clone(), &moments))
}

/// Returns a ball in boxes of coarse tets that are too small for it, and its particles that are inside.
pub(crate) fn balls_sticking_out() -> Vec<(Partition, BTreeSet<u32>)> {
    let skin = ball(0.01, DVec3::new(0.2e-3, -0.3e-3, 0.1e-3), 3);
    let of = |size_m: f64| {
        let sites = Sites::covering(skin.bounds_m(), 1.1e-3, DVec3::splat(0.4e-3));
        let coarse = Composite::new(&tet_box(DVec3::splat(-0.5 * size_m), DVec3::splat(size_m), [3, 3, 3]));
        let moments = integrate(&skin, &sites, &mut |_| {});
        let partition = Partition::new(sites, coarse, &moments);
        let all = 0..partition.particle_count() as u32;
        let inside: BTreeSet<u32> = all.clone().filter(|&p| partition.anchor(p).is_inside()).collect();
        assert!(inside.len() < all.len() && inside.len() > 500, "{} of {}", inside.len(), all.len());
        (partition, inside)
    };
    [0.012, 0.014, 0.016].map(of).into()
}

/// Returns the embedded ball as a body of two materials; the coarse nodes below z = −9 mm are held along two axes, those beyond
/// y = 9 mm along all.
pub(crate) fn hybrid_ball(materials: &[Material; 2]) -> HybridBody {
    hybrid_ball_of(materials, 1.1e-3, None)
}

/// Returns the same body with another spacing, or with cells that are merged below a depth (m).
pub(crate) fn hybrid_ball_of(materials: &[Material; 2], spacing_m: f64, fine_depth_m: Option<f64>) -> HybridBody {
    let coarse = tet_box(DVec3::splat(-0.0125), DVec3::splat(0.025), [3, 3, 3]);
    let spec = ParticleSpec {
        skin: ball(0.01, DVec3::new(0.2e-3, -0.3e-3, 0.1e-3), 3),
        spacing_m,
        fine_depth_m,
        smooth_skin: false,
        lattice_through_m: DVec3::splat(0.4e-3),
        most_active: 2000,
        waking: Waking::ByHand,
    };
    let middle = |tet: usize| coarse.corners_m(tet).iter().sum::<DVec3>() / 4.0;
    let of_tet: Vec<u16> = (0..coarse.tets().len()).map(|tet| u16::from(middle(tet).y > 0.0)).collect();
    let nodes = |of: &dyn Fn(DVec3) -> bool| -> Vec<u32> {
        (0..coarse.positions_m().len() as u32).filter(|&n| of(coarse.positions_m()[n as usize])).collect()
    };
    let low = PrescribedSpec {
        name: "low".into(),
        nodes: nodes(&|p| p.z < -9e-3),
        axes: [true, false, true],
        is_fixed: false,
    };
    let far = PrescribedSpec { name: "far".into(), nodes: nodes(&|p| p.y > 9e-3), axes: [true; 3], is_fixed: false };
    let surface = Surface::of(&coarse).unwrap();
    let region = |(material, density_kg_per_m3)| Region { name: "half".into(), material, density_kg_per_m3 };
    let regions = materials.iter().copied().zip([1000.0, 1200.0]).map(region).collect();
    let coarse = Solid { mesh: coarse, regions, tet_region: of_tet };
    HybridBody::lay_out(&coarse, &surface, spec, &[low, far], &mut |_| {}).unwrap().body
}

/// Returns a material of each law, nearly incompressible and viscous.
pub(crate) fn tissue() -> [Material; 3] {
    let lame = Lame::from_young_poisson(10e3, 0.45).unwrap();
    let viscosity = Viscosity::new(3.0, 2.0).unwrap();
    [Law::StVenantKirchhoff, Law::StableNeoHookean, Law::FixedCorotated]
        .map(|law| Material::new(law, lame, viscosity, Convention::Consistent))
}

/// Returns a field with every position mapped.
pub(crate) fn moved(field: &Field, map: impl Fn(DVec3) -> DVec3) -> Field {
    Field {
        nodes: field.nodes.iter().map(|p| map(*p)).collect(),
        particles: field.particles.iter().map(|p| map(*p)).collect(),
    }
}

/// Returns a field of random vectors, of the lengths of another field's lists.
pub(crate) fn random_like(field: &Field, size: f64, random: &mut Random) -> Field {
    let mut shaken = |list: &[DVec3]| list.iter().map(|_| random.vector() * size).collect::<Vec<_>>();
    Field { nodes: shaken(&field.nodes), particles: shaken(&field.particles) }
}

/// Returns `a + s b`.
pub(crate) fn plus(a: &Field, b: &Field, s: f64) -> Field {
    let sum = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| *a + *b * s).collect();
    Field { nodes: sum(&a.nodes, &b.nodes), particles: sum(&a.particles, &b.particles) }
}

/// Returns the cells of the embedded ball, all awake, and the rest positions (m) of their particles.
pub(crate) fn ball_cells() -> (Vec<([u32; 8], RestCell)>, Vec<DVec3>) {
    let partition = embedded_ball();
    let rest = (0..partition.particle_count() as u32).map(|p| partition.particle_m(p)).collect();
    let cell = |c: usize| (partition.corners(c), partition.rest_cell(c, 0.98));
    ((0..partition.cells().len()).map(cell).collect(), rest)
}
