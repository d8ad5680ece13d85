//! What particles that sleep cost: blocks of 26 thousand and of 2.8 million particles 2.1 mm apart in 192 coarse tets, of which 200 are awake. Prints the time to
//! load and the memory: `cargo bench -p palpate-physics --bench sleeping`.
#![allow(missing_docs)] // criterion's macros
#![allow(clippy::unwrap_used)] // helpers of a benchmark
#[path = "../tests/rig/mod.rs"]
mod rig;
use criterion::{Criterion, criterion_group, criterion_main};
use glam::DVec3;
use palpate_physics::{
    Settings,
    bodies::hybrid::{ParticleSpec, Skin, Waking},
    contact::Coupling,
    material::Law,
    world::wake_only,
};
use rig::{Rig, body, bricks, even, hold, material, mesh_of, nodes_where, sphere, with_particles};
use std::{collections::BTreeMap, time::Instant};

const SPACING_M: f64 = 2.1e-3;
const ACTIVE: usize = 200;

/// Memory in use (bytes), where the system tells it.
fn resident_bytes() -> f64 {
    let pages = std::fs::read_to_string("/proc/self/statm").ok();
    let pages = pages.and_then(|text| text.split_whitespace().nth(1)?.parse::<f64>().ok());
    pages.map_or(f64::NAN, |pages| pages * 4096.0)
}

/// The surface of a box of lattice cells with a corner at `low_m`, two triangles for each face of a cell.
fn box_skin(cells: [usize; 3], low_m: DVec3) -> Skin {
    let (mut number, mut positions, mut triangles) = (BTreeMap::new(), Vec::new(), Vec::new());
    let mut vertex = |at: [usize; 3]| {
        *number.entry(at).or_insert_with(|| {
            positions.push(low_m + DVec3::from(at.map(|c| c as f64)) * SPACING_M);
            positions.len() as u32 - 1
        })
    };
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for upper in [false, true] {
            for (i, j) in (0..cells[u]).flat_map(|i| (0..cells[v]).map(move |j| (i, j))) {
                let mut at = |i: usize, j: usize| {
                    let mut place = [0; 3];
                    (place[axis], place[u], place[v]) = (if upper { cells[axis] } else { 0 }, i, j);
                    vertex(place)
                };
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                triangles.extend(if upper { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] });
            }
        }
    }
    Skin::new(positions, triangles).unwrap()
}

/// 4n × 4n × 2n cells of the lattice.
fn pressed(n: usize) -> Rig {
    let side_m = 2.0 * n as f64 * SPACING_M;
    let axes = |cells: usize| {
        let side = even(-side_m, side_m, 2 * cells);
        bricks(&side, &side, &even(-side_m, 0.0, cells))
    };
    let skin = box_skin([4 * n, 4 * n, 2 * n], DVec3::new(-side_m, -side_m, -side_m));
    let spec = body(axes(2), material(Law::StableNeoHookean, 10e3, 0.45));
    let before = (Instant::now(), resident_bytes());
    let particles = ParticleSpec {
        skin,
        spacing_m: SPACING_M,
        fine_depth_m: None,
        smooth_skin: false,
        lattice_through_m: DVec3::ZERO,
        most_active: ACTIVE,
        waking: Waking::ByHand,
    };
    let mut spec = with_particles(spec, particles);
    spec.prescribed = vec![hold("bottom", nodes_where(mesh_of(&spec), |p| p.z < 1e-4 - side_m), [true; 3])];
    spec.settings = Settings::for_particles();
    spec.tools = vec![sphere(8e-3, DVec3::Z * 9e-3, Coupling::Rigid)];
    let mut rig = Rig::new(spec);
    let partition = rig.model.body().as_hybrid().unwrap().partition();
    let particles = partition.particle_count();
    println!(
        "{particles} particles, {} vertices of the skin: loaded in {:.1} s, {:.0} bytes a particle, {} substeps",
        rig.model.surface().nodes.len(),
        before.0.elapsed().as_secs_f64(),
        (resident_bytes() - before.1) / particles as f64,
        rig.model.substeps()
    );
    let mut near = Vec::new();
    partition.particles_within(DVec3::ZERO, 20e-3, |particle, distance_sq| near.push((distance_sq, particle)));
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    near.truncate(ACTIVE);
    wake_only(&rig.model, &mut rig.state, &mut rig.scratch, near.into_iter().map(|(_, particle)| particle));
    for tick in 0..200 {
        rig.tick_at(DVec3::Z * (8e-3 - 2e-3 * f64::from(tick) / 200.0));
    }
    println!(
        "{} awake, pressed with {:.4} N",
        rig.state.body.active_particles().len(),
        rig.state.mechanical.tools[0].contact_force_n.z
    );
    rig
}

fn ticks(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("tick beside sleeping particles");
    for n in [9, 44] {
        let mut rig = pressed(n);
        group.bench_function(format!("{} particles", 32 * n * n * n), |b| b.iter(|| rig.tick_at(DVec3::Z * 6e-3)));
    }
}

criterion_group!(benches, ticks);
criterion_main!(benches);
