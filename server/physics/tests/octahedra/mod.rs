//! A small seed body of octahedra: what the tests of the papers' hybrid share.
#![allow(dead_code, missing_docs, unreachable_pub, clippy::unwrap_used)]
use glam::DVec3;
use palpate_physics::{
    BodySpec, ModelSpec, PrescribedSpec, Region, Settings, Solid, TetMesh,
    bodies::seed::{LayerSpec, PaperModel, SeedBodySpec, SeedParameters},
    contact::{Coupling, ToolShape, ToolSpec},
    material::{Law, Material},
};

/// Corners of an octahedron of radius 1, x, −x, y, −y, z, −z, and its triangles seen from outside.
pub const CORNERS: [DVec3; 6] = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
pub const FACES: [[u32; 3]; 8] =
    [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];

/// Where the first face is: its distance from the centre (m) along [`OUTWARDS`].
pub const FACE_M: f64 = 0.03 * 0.577_350_269_189_625_8;
/// Outward normal of the first face.
pub const OUTWARDS: DVec3 = DVec3::splat(0.577_350_269_189_625_8);

/// The wall between two octahedra, three tets a side.
pub fn core(inner_m: f64, outer_m: f64) -> TetMesh {
    let positions: Vec<DVec3> =
        CORNERS.iter().map(|c| *c * inner_m).chain(CORNERS.iter().map(|c| *c * outer_m)).collect();
    let mut tets = Vec::new();
    for mut face in FACES {
        face.sort_unstable();
        let [a, b, c] = face;
        for mut tet in [[a, b, c, c + 6], [a, b, b + 6, c + 6], [a, a + 6, b + 6, c + 6]] {
            let [p, q, r, s] = tet.map(|n| positions[n as usize]);
            if (q - p).cross(r - p).dot(s - p) < 0.0 {
                tet.swap(2, 3);
            }
            tets.push(tet);
        }
    }
    TetMesh::new(positions, tets).unwrap()
}

/// 2000 particles out to a radius of 30 mm.
pub fn layer() -> LayerSpec {
    let skin_m = CORNERS.iter().map(|c| *c * 0.03).collect();
    LayerSpec { skin_m, skin_triangles: FACES.to_vec(), particles: 2000 }
}

/// The papers' hybrid, one triangle's particles awake at a time.
pub fn parameters() -> SeedParameters {
    SeedParameters { first_neighbours: false, ..SeedParameters::paper_2006(PaperModel::Hybrid) }
}

/// A body of the loop around the core out to `outer_m`, its inner nodes but two held, a rigid ball of 10 mm above the first face, and ticks
/// of the papers' step.
pub fn body_spec(outer_m: f64, layer: Option<LayerSpec>, parameters: SeedParameters) -> ModelSpec {
    let mesh = core(0.01, outer_m);
    let SeedParameters { lame, viscosity, convention, density_kg_per_m3, dt_s, .. } = parameters;
    let material = Material::new(Law::StVenantKirchhoff, lame, viscosity, convention);
    ModelSpec {
        body: BodySpec::Seed(SeedBodySpec {
            core: Solid {
                tet_region: vec![0; mesh.tets().len()],
                mesh,
                regions: vec![Region { name: "all".into(), material, density_kg_per_m3 }],
            },
            layer,
            parameters,
        }),
        prescribed: vec![PrescribedSpec {
            name: "inner".into(),
            nodes: vec![1, 2, 3, 5],
            axes: [true; 3],
            is_fixed: false,
        }],
        loads: Vec::new(),
        gravity_m_per_s2: DVec3::ZERO,
        tools: vec![ToolSpec {
            name: "ball".into(),
            shape: ToolShape::Sphere,
            radius_m: 0.01,
            coupling: Coupling::Rigid,
            friction_coefficient: 0.2,
            start_position_m: OUTWARDS * (FACE_M + 0.0105),
        }],
        settings: Settings { tick_period_s: dt_s, ..Settings::default() },
    }
}

/// Where the ball is driven to (m) after so many ticks: into the first face, along it over an edge to the next one, and away again.
pub fn device_m(tick: u32) -> DVec3 {
    let part = |from: u32, to: u32| f64::from(tick.clamp(from, to) - from) / f64::from(to - from);
    let depth_m = 2.5e-3 * part(0, 100) - 20e-3 * part(300, 350);
    // Over the edge from +y to +z, into the face beyond.
    let way = DVec3::NEG_X * (0.03 * part(150, 300));
    OUTWARDS * (FACE_M + 0.0105 - depth_m) + way
}
