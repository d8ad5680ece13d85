//! The three models of the seeds' hybrid (Mero & Susín 2005, 2006) with bodies of our own: the papers print neither sizes nor meshes.
//!
//! | model | tets, nodes: printed | here | particles: printed | here |
//! |---|---|---|---|---|
//! | Ellipsoids (ED0) | 188, 276 | 186, 66 | | |
//! | Full FEM (HM2) | 1352, 353 | 1344, 342 | | |
//! | Hybrid (HM1) | 188 | 186, 66 | 27 988, of which 50 to 600 awake, 200 on average | 27 988, 122 to 274, 202 |
//!
//! A connected mesh has at most three nodes more than tets, and 188 tets in one layer about 66.
pub(crate) use super::shell::ellipsoid_surface;
use super::{ShapeError, ellipsoid_shell};
use glam::DVec3;
use palpate_physics::{
    TetMesh,
    bodies::seed::{LayerSpec, PARTICLES, PaperModel, SHELL_TETS, SeedParameters, SeedSpec, VENTRICLE_TETS},
};

/// Semi-axes (m) of the cavity.
pub const CAVITY_AXES_M: DVec3 = DVec3::new(0.018, 0.017, 0.030);
/// Semi-axes (m) between core and layer.
pub const CORE_AXES_M: DVec3 = DVec3::new(0.027, 0.025, 0.039);
/// Semi-axes (m) of the outer surface. The layer is 7 to 11 mm thick: "not a uniform thickness".
pub const SKIN_AXES_M: DVec3 = DVec3::new(0.034, 0.032, 0.050);
/// Triangles of the hybrid's skin: about as many as make regions of the printed 200 particles on average.
pub const SKIN_TRIANGLES: u32 = 1820;
/// Nodes above this part of the upper semi-axis are held, as a heart is by its vessels. The papers do not say what holds their bodies.
const HELD_ABOVE: f64 = 0.75;

/// The specification of one of the papers' models with the given constants, such as [`SeedParameters::paper_2006`].
///
/// # Errors
/// None that these sizes make.
pub fn paper_model(model: PaperModel, parameters: SeedParameters) -> Result<SeedSpec, ShapeError> {
    let (outer_m, tets) = match model {
        PaperModel::Ellipsoids | PaperModel::Hybrid => (CORE_AXES_M, SHELL_TETS),
        PaperModel::FullFem => (SKIN_AXES_M, VENTRICLE_TETS),
    };
    let core = ellipsoid_shell(CAVITY_AXES_M, outer_m, tets)?.mesh;
    let layer = match model {
        PaperModel::Ellipsoids | PaperModel::FullFem => None,
        PaperModel::Hybrid => {
            let (skin_m, skin_triangles) = ellipsoid_surface(SKIN_AXES_M, SKIN_TRIANGLES);
            Some(LayerSpec { skin_m, skin_triangles, particles: PARTICLES })
        }
    };
    Ok(SeedSpec { held_nodes: held(&core, outer_m), core, layer, parameters })
}

fn held(core: &TetMesh, outer_m: DVec3) -> Vec<u32> {
    let nodes = 0..core.positions_m().len() as u32;
    nodes.filter(|&node| core.positions_m()[node as usize].z > HELD_ABOVE * outer_m.z).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_physics::bodies::seed::{AtVertex, SeedContact, SeedModel, SeedScratch, SeedState};

    fn build(model: PaperModel) -> SeedModel {
        SeedModel::build(paper_model(model, SeedParameters::paper_2006(model)).unwrap()).unwrap()
    }

    /// The triangle of the surface farthest along a direction.
    fn triangle_towards(model: &SeedModel, direction: DVec3) -> u32 {
        let along = |t: &[u32; 3]| t.iter().map(|&v| model.surface_rest_m()[v as usize]).sum::<DVec3>().dot(direction);
        let triangles = model.surface_triangles();
        (0..triangles.len()).max_by(|&a, &b| along(&triangles[a]).total_cmp(&along(&triangles[b]))).unwrap() as u32
    }

    #[test]
    fn the_papers_counts_are_met_about() {
        for (model, tets) in [(PaperModel::Ellipsoids, 188), (PaperModel::FullFem, 1352), (PaperModel::Hybrid, 188)] {
            let built = build(model);
            let mesh = built.core().mesh();
            println!("{model:?}: {} tets, {} nodes", mesh.tets().len(), mesh.positions_m().len());
            assert!((mesh.tets().len() as f64 / f64::from(tets) - 1.0).abs() < 0.1);
            let Some(layer) = built.layer() else { continue };
            let counts: Vec<usize> =
                built.regions().iter().map(palpate_physics::bodies::seed::region::Region::len).collect();
            let mean = counts.iter().sum::<usize>() as f64 / counts.len() as f64;
            println!(
                "  {} particles {:.3} mm apart under {} triangles; awake {} to {}, {mean:.0} on average",
                layer.particle_count(),
                layer.voxels.spacing_m * 1e3,
                counts.len(),
                counts.iter().min().unwrap(),
                counts.iter().max().unwrap(),
            );
            assert!(layer.particle_count().abs_diff(27_988) < 30);
            assert!((150.0..250.0).contains(&mean));
            // Δt is below what waves allow, also in the layer's doubled stiffness.
            let parameters = built.parameters();
            let limit_s = parameters.courant_s(layer.voxels.spacing_m);
            println!(
                "  Δt {} s, h/c {limit_s:.4} s, as printed {:.4} s",
                parameters.dt_s,
                parameters.courant_as_printed_s(layer.voxels.spacing_m)
            );
            assert!(parameters.dt_s < limit_s);
        }
    }

    /// Pressed to 1.5 mm in as many of the printed steps as make it slow beside waves; in both papers' conventions.
    #[test]
    fn the_papers_models_can_be_pressed_and_push_back() {
        // In the full FEM model waves make 7 mm a second.
        for (model, steps) in [(PaperModel::Ellipsoids, 500), (PaperModel::FullFem, 8000), (PaperModel::Hybrid, 500)] {
            for parameters in [SeedParameters::paper_2005(model), SeedParameters::paper_2006(model)] {
                let built = SeedModel::build(paper_model(model, parameters).unwrap()).unwrap();
                let triangle = triangle_towards(&built, DVec3::new(1.0, 0.3, -0.4));
                let corners = built.surface_triangles()[triangle as usize];
                let rest = corners.map(|v| built.surface_rest_m()[v as usize]);
                let outwards = (rest[1] - rest[0]).cross(rest[2] - rest[0]).normalize();
                let (mut state, mut scratch) = (SeedState::at_rest(&built), SeedScratch::new(&built));
                let mut means_n = [0.0; 5];
                for step in 0..steps {
                    let depth = 1.5e-3 * f64::from(step + 1) / f64::from(steps);
                    let goals = [0, 1, 2].map(|i| AtVertex { vertex: corners[i], value: rest[i] - outwards * depth });
                    let contact = SeedContact { triangle: Some(triangle), displaced_m: &goals, forces_n: &[] };
                    let report = built.step(&mut state, &mut scratch, &contact);
                    assert!(report.is_finite, "{model:?} {step}");
                    means_n[(step * 5 / steps) as usize] += report.reaction_n.dot(outwards) * 5.0 / f64::from(steps);
                }
                let shown: Vec<String> = means_n.iter().map(|f| format!("{:.3}", f * 1e6)).collect();
                println!("{model:?} {:?}: mean force by fifths (µN) {shown:?}", parameters.convention);
                assert!(means_n.iter().all(|&f| f > 0.0) && means_n[4] > means_n[1], "{means_n:?}");
            }
        }
    }
}
