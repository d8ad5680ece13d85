//! Bodies with walls that can be pressed together: a clamp, and two blocks one above the other.
#![allow(dead_code, unreachable_pub, clippy::unwrap_used)] // every test file uses its own part
use super::rig::{Drive, Rig, at, body, bricks, even, hold, material, mesh_of, nodes_where, sphere, with_particles};
use glam::DVec3;
use palpate_physics::{
    ModelSpec, SelfContactChoice, Surface, TetMesh,
    bodies::hybrid::{ParticleSpec, Skin, Waking},
    contact::Coupling,
    material::Law,
};

/// Half of the gap between the arms of a clamp, or between two blocks (m).
pub const HALF_GAP_M: f64 = 2e-3;

/// The tets of a mesh whose middles are wanted, and their nodes.
pub fn carved(mesh: &TetMesh, wanted: impl Fn(DVec3) -> bool) -> TetMesh {
    let at = |tet: &[u32; 4]| tet.iter().map(|&n| mesh.positions_m()[n as usize]).sum::<DVec3>() * 0.25;
    let kept: Vec<[u32; 4]> = mesh.tets().iter().filter(|tet| wanted(at(tet))).copied().collect();
    let mut nodes: Vec<u32> = kept.iter().flatten().copied().collect();
    nodes.sort_unstable();
    nodes.dedup();
    let number = |node: u32| nodes.binary_search(&node).unwrap() as u32;
    let positions = nodes.iter().map(|&n| mesh.positions_m()[n as usize]).collect();
    TetMesh::new(positions, kept.iter().map(|tet| tet.map(number)).collect()).unwrap()
}

/// A clamp: a back of 12 mm (x from 0) and two arms of 36 mm, 8 mm thick and 4 mm apart, 12 mm wide; `fine` cells in 4 mm.
pub fn clamp_mesh(fine: usize) -> TetMesh {
    let (xs, ys) = (even(0.0, 0.048, 12 * fine), even(0.0, 0.012, 3 * fine));
    let mesh = bricks(&xs, &ys, &even(-0.010, 0.010, 5 * fine));
    carved(&mesh, |p| p.x < 0.012 || p.z.abs() > HALF_GAP_M)
}

/// A clamp of 10 kPa that is held nowhere.
pub fn clamp(self_contact: SelfContactChoice) -> ModelSpec {
    let mut spec = body(clamp_mesh(1), material(Law::StableNeoHookean, 10e3, 0.4));
    spec.settings.self_contact = self_contact;
    spec
}

/// A clamp that is held at its back, and whose arms' outer sides are pushed by two sets: below and above.
pub fn gripped_clamp(self_contact: SelfContactChoice) -> ModelSpec {
    let mut spec = clamp(self_contact);
    let of = |wanted: &dyn Fn(DVec3) -> bool| nodes_where(mesh_of(&spec), wanted);
    let (back, below, above) =
        (of(&|p| p.x < 1e-4), of(&|p| p.x > 0.04 && p.z < -0.0099), of(&|p| p.x > 0.04 && p.z > 0.0099));
    spec.prescribed =
        vec![hold("back", back, [true; 3]), hold("below", below, [true; 3]), hold("above", above, [true; 3])];
    spec.settings.mass_damping_per_s = 40.0;
    spec
}

/// Two blocks of 24 × 24 × 12 mm, 4 mm apart, one above the other; the outer sides are two sets.
pub fn two_blocks() -> ModelSpec {
    let side = even(0.0, 0.024, 6);
    let mesh = carved(&bricks(&side, &side, &even(-0.014, 0.014, 7)), |p| p.z.abs() > HALF_GAP_M);
    let mut spec = body(mesh, material(Law::StableNeoHookean, 10e3, 0.4));
    let of = |wanted: &dyn Fn(DVec3) -> bool| nodes_where(mesh_of(&spec), wanted);
    let (below, above) = (of(&|p| p.z < -0.0139), of(&|p| p.z > 0.0139));
    spec.prescribed = vec![hold("below", below, [true; 3]), hold("above", above, [true; 3])];
    spec.settings.mass_damping_per_s = 60.0;
    spec
}

/// Pairs of nodes of the arms' or blocks' inner sides that are one above the other at rest: below, above.
pub fn facing_nodes(mesh: &TetMesh) -> Vec<[u32; 2]> {
    let at = |z: f64| nodes_where(mesh, |p| (p.z - z).abs() < 1e-6 && p.x > 0.0119);
    let (below, above) = (at(-HALF_GAP_M), at(HALF_GAP_M));
    let x = mesh.positions_m();
    let over = |b: u32| above.iter().find(|&&a| x[a as usize].truncate().distance(x[b as usize].truncate()) < 1e-6);
    below.iter().filter_map(|&b| over(b).map(|&a| [b, a])).collect()
}

/// The least height (m) of a node over the one that is below it at rest.
pub fn least_height_m(rig: &Rig, pairs: &[[u32; 2]]) -> f64 {
    let x = &rig.state.mechanical.x;
    pairs.iter().map(|&[b, a]| x[a as usize].z - x[b as usize].z).fold(f64::INFINITY, f64::min)
}

/// A clamp with particles 4 mm apart in coarse tets as thick as its arms, held at its back, and two rigid spheres outside
/// of the arms.
pub fn hybrid_clamp(self_contact: SelfContactChoice) -> ModelSpec {
    let fine = clamp_mesh(1);
    let surface = Surface::of(&fine).unwrap();
    let positions = surface.nodes.iter().map(|&n| fine.positions_m()[n as usize]).collect();
    let coarse = bricks(&even(0.0, 0.048, 4), &even(0.0, 0.012, 1), &[-0.010, -HALF_GAP_M, HALF_GAP_M, 0.010]);
    let coarse = carved(&coarse, |p| p.x < 0.012 || p.z.abs() > HALF_GAP_M);
    let mut spec = body(coarse, material(Law::StableNeoHookean, 10e3, 0.4));
    let back = nodes_where(mesh_of(&spec), |p| p.x < 1e-4);
    spec.prescribed = vec![hold("back", back, [true; 3])];
    spec.settings.mass_damping_per_s = 40.0;
    spec.settings.self_contact = self_contact;
    spec.tools = [-1.0, 1.0].map(|side| sphere(6e-3, outside(side, 0.0), Coupling::Rigid)).to_vec();
    // Without friction the arms would slip aside.
    spec.tools.iter_mut().for_each(|tool| tool.friction_coefficient = 0.6);
    let particles = ParticleSpec {
        skin: Skin::new(positions, surface.triangles).unwrap(),
        spacing_m: 4e-3,
        fine_depth_m: None,
        smooth_skin: false,
        lattice_through_m: DVec3::new(0.0, 0.0, -0.010),
        most_active: 150,
        waking: Waking::ByTools { reach_m: 9e-3 },
    };
    with_particles(spec, particles)
}

/// Where a tool of the hybrid clamp is, on the lower (−1) or upper (1) side, that has come so far from 1 mm away.
fn outside(side: f64, by_m: f64) -> DVec3 {
    DVec3::new(0.036, 0.006, side * (0.017 - by_m))
}

/// Moves both tools of the hybrid clamp by up to `most_m` in 100 ticks and back.
pub fn squeeze_hybrid(rig: &Rig, most_m: f64, tick: u32) -> Drive {
    let by_m = most_m * (std::f64::consts::PI * (f64::from(tick) / 200.0).min(1.0)).sin();
    Drive { tools: [-1.0, 1.0].map(|side| at(outside(side, by_m))).to_vec(), ..rig.still() }
}
