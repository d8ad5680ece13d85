//! A step of the seeds' hybrid neither allocates nor frees, whatever is touched.
#![allow(clippy::unwrap_used)]
use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use glam::DVec3;
use palpate_physics::{
    TetMesh,
    seed::{AtVertex, LayerSpec, PaperModel, SeedContact, SeedModel, SeedParameters, SeedScratch, SeedSpec, SeedState},
};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

/// Corners of an octahedron of radius 1, x, −x, y, −y, z, −z, and its triangles seen from outside.
const CORNERS: [DVec3; 6] = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
const FACES: [[u32; 3]; 8] = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];

/// The wall between two octahedra, three tets a side.
fn core(inner_m: f64, outer_m: f64) -> TetMesh {
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

#[test]
fn a_step_does_not_allocate() {
    let spec = SeedSpec {
        core: core(0.01, 0.02),
        held_nodes: vec![0],
        layer: Some(LayerSpec {
            skin_m: CORNERS.iter().map(|c| *c * 0.03).collect(),
            skin_triangles: FACES.to_vec(),
            particles: 2000,
        }),
        parameters: SeedParameters { first_neighbours: false, ..SeedParameters::paper_2006(PaperModel::Hybrid) },
    };
    for parameters in [spec.parameters, spec.parameters.as_printed()] {
        let model = SeedModel::build(SeedSpec { parameters, ..spec.clone() }).unwrap();
        let (mut state, mut scratch) = (SeedState::at_rest(&model), SeedScratch::new(&model));
        let force = [AtVertex { vertex: 2, value: DVec3::Y * 1e-6 }];
        let displaced = [AtVertex { vertex: 0, value: DVec3::X * 0.0299 }, AtVertex { vertex: 5, value: DVec3::NAN }];
        let mut touched = 0;
        // Other triangles, none, and back: regions of all sizes wake and sleep.
        for triangle in [Some(0), Some(3), None, Some(7), Some(1), Some(99)] {
            let contact = SeedContact { triangle, forces_n: &force, displaced_m: &displaced };
            assert_no_alloc(|| {
                for _ in 0..5 {
                    touched += model.step(&mut state, &mut scratch, &contact).particles_touched;
                }
            });
        }
        assert!(touched > 1000);
    }
}
