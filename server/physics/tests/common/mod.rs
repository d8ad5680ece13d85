//! Bodies for the tests: simple meshes and models, made without the scene crate.
#![allow(dead_code, clippy::unwrap_used)] // every test file uses its own part
use glam::DVec3;
use palpate_physics::{
    BodySpec, LoadSpec, Model, ModelSpec, Precision, PrescribedSpec, Region, Settings, Solid, Substeps, Surface,
    TetMesh,
    material::{Convention, Lame, Law, Material, Viscosity},
    statics::{Goal, StaticSettings, StaticSolution, solve_static},
};
use std::{collections::BTreeMap, ops::ControlFlow};

/// A pseudo-random sequence in (−1, 1), the same every time (splitmix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub(crate) fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
}

/// A block from the origin to `size_m`, six tets a cell, neighbouring cells mirrored.
pub(crate) fn block(size_m: DVec3, cells: [usize; 3]) -> TetMesh {
    let [nx, ny, nz] = cells;
    let node = |i: usize, j: usize, k: usize| ((k * (ny + 1) + j) * (nx + 1) + i) as u32;
    let mut positions = Vec::new();
    for k in 0..=nz {
        for j in 0..=ny {
            for i in 0..=nx {
                let at = DVec3::new(i as f64 / nx as f64, j as f64 / ny as f64, k as f64 / nz as f64);
                positions.push(at * size_m);
            }
        }
    }
    let mut tets = Vec::new();
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                // Corner of the cell with each axis mirrored in odd cells, so that diagonals meet.
                let corner = |bits: usize| {
                    let bit = |axis: usize, cell: usize| cell + (((bits >> axis) & 1) ^ (cell & 1));
                    node(bit(0, i), bit(1, j), bit(2, k))
                };
                for [a, b] in [[1, 3], [1, 5], [2, 3], [2, 6], [4, 5], [4, 6]] {
                    tets.push([corner(0), corner(a), corner(b), corner(7)]);
                }
            }
        }
    }
    oriented(positions, tets)
}

/// An octant of a spherical shell about the origin, `x, y, z ≥ 0`: `cells` along each arc, `layers` through the wall.
pub(crate) fn shell_octant(inner_m: f64, outer_m: f64, cells: usize, layers: usize) -> TetMesh {
    let mut number = BTreeMap::new();
    let mut directions = Vec::new();
    for i in 0..=cells {
        for j in 0..=cells - i {
            number.insert((i, j), directions.len());
            directions.push(DVec3::new(i as f64, j as f64, (cells - i - j) as f64).normalize());
        }
    }
    let mut triangles = Vec::new();
    for i in 0..cells {
        for j in 0..cells - i {
            triangles.push([number[&(i, j)], number[&(i + 1, j)], number[&(i, j + 1)]]);
            if i + j + 1 < cells {
                triangles.push([number[&(i + 1, j)], number[&(i + 1, j + 1)], number[&(i, j + 1)]]);
            }
        }
    }
    let count = directions.len();
    let radius = |layer: usize| inner_m + (outer_m - inner_m) * layer as f64 / layers as f64;
    let positions = (0..=layers).flat_map(|layer| directions.iter().map(move |d| *d * radius(layer))).collect();
    let mut tets = Vec::new();
    for layer in 0..layers {
        for triangle in &triangles {
            // A prism in three tets: diagonals of its sides go from the lower number below to the higher above.
            let mut base = *triangle;
            base.sort_unstable();
            let low = base.map(|v| (layer * count + v) as u32);
            let high = base.map(|v| ((layer + 1) * count + v) as u32);
            tets.push([low[0], low[1], low[2], high[2]]);
            tets.push([low[0], low[1], high[1], high[2]]);
            tets.push([low[0], high[0], high[1], high[2]]);
        }
    }
    oriented(positions, tets)
}

fn oriented(positions: Vec<DVec3>, mut tets: Vec<[u32; 4]>) -> TetMesh {
    for tet in &mut tets {
        let [a, b, c, d] = tet.map(|n| positions[n as usize]);
        if (b - a).cross(c - a).dot(d - a) < 0.0 {
            tet.swap(2, 3);
        }
    }
    TetMesh::new(positions, tets).unwrap()
}

/// The mesh with every interior node moved at random by up to `amount_m` along each axis.
pub(crate) fn jittered(mesh: &TetMesh, amount_m: f64, seed: u64) -> TetMesh {
    let surface = Surface::of(mesh).unwrap();
    let mut random = Random(seed);
    let moved = mesh.positions_m().iter().enumerate().map(|(node, p)| {
        let offset = random.vector() * amount_m;
        if surface.vertex_of_node[node] == u32::MAX { *p + offset } else { *p }
    });
    TetMesh::new(moved.collect(), mesh.tets().to_vec()).unwrap()
}

/// Nodes whose rest position satisfies a condition.
pub(crate) fn nodes_where(mesh: &TetMesh, condition: impl Fn(DVec3) -> bool) -> Vec<u32> {
    let all = mesh.positions_m().iter().enumerate();
    all.filter(|(_, p)| condition(**p)).map(|(node, _)| node as u32).collect()
}

/// Surface triangles whose corners all satisfy a condition.
pub(crate) fn triangles_where(mesh: &TetMesh, condition: impl Fn(DVec3) -> bool) -> Vec<u32> {
    let surface = Surface::of(mesh).unwrap();
    let inside = |t: &usize| surface.triangle_nodes(*t).iter().all(|&n| condition(mesh.positions_m()[n as usize]));
    (0..surface.triangles.len()).filter(inside).map(|t| t as u32).collect()
}

/// Prescribed axes of the nodes that satisfy a condition.
pub(crate) fn held(mesh: &TetMesh, name: &str, axes: [bool; 3], condition: impl Fn(DVec3) -> bool) -> PrescribedSpec {
    PrescribedSpec { name: name.into(), nodes: nodes_where(mesh, condition), axes, is_fixed: false }
}

pub(crate) fn material(law: Law, young_pa: f64, poisson: f64) -> Material {
    let lame = Lame::from_young_poisson(young_pa, poisson).unwrap();
    Material::new(law, lame, Viscosity::default(), Convention::Consistent)
}

/// One material of 1000 kg/m³, f64 forces, no gravity, one substep: tests change what they need.
pub(crate) fn spec(
    mesh: TetMesh,
    material: Material,
    prescribed: Vec<PrescribedSpec>,
    loads: Vec<LoadSpec>,
) -> ModelSpec {
    ModelSpec {
        body: BodySpec::Tet(
            Solid {
                tet_region: vec![0; mesh.tets().len()],
                mesh,
                regions: vec![Region { name: "body".into(), material, density_kg_per_m3: 1000.0 }],
            }
            .into(),
        ),
        prescribed,
        loads,
        gravity_m_per_s2: DVec3::ZERO,
        tools: vec![],
        settings: Settings { precision: Precision::Double, substeps: Substeps::Fixed(1), ..Settings::default() },
    }
}

/// Equilibrium with all loads at `factor` and prescribed displacements `moved` (missing ones are zero).
pub(crate) fn equilibrium(model: &Model, factor: f64, moved: &[DVec3]) -> StaticSolution {
    let mut displacements = moved.to_vec();
    displacements.resize(model.prescribed().len(), DVec3::ZERO);
    let factors = vec![factor; model.loads().len()];
    let settings = StaticSettings { relative_residual: 1e-12, ..StaticSettings::default() };
    solve_static(
        model,
        &Goal { load_factors: &factors, prescribed_displacements_m: &displacements, ..Goal::default() },
        &settings,
        &mut |_| ControlFlow::Continue(()),
    )
    .unwrap()
}

/// Mean displacement (m) of nodes.
pub(crate) fn mean_displacement_m(model: &Model, x: &[DVec3], nodes: &[u32]) -> DVec3 {
    let sum: DVec3 = nodes.iter().map(|&n| x[n as usize] - model.rest_positions_m()[n as usize]).sum();
    sum / nodes.len() as f64
}

/// Richardson's limit of a second-order quantity from two meshes, the second twice as fine: `v₂ + (v₂ − v₁)/3`.
pub(crate) fn extrapolated(coarse: f64, fine: f64) -> f64 {
    fine + (fine - coarse) / 3.0
}
