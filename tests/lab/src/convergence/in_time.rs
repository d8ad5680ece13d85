//! Leapfrog against itself at half the time step: a block that a patch of pressure dents and that swings on.
use super::Convergence;
use crate::{
    bodies,
    problems::{Action, body::Body, load},
};
use glam::DVec3;
use miette::{IntoDiagnostic, Result, ensure};
use palpate_physics::{
    BodySpec, LoadSpec, Model, ModelSpec, Precision, Region, Scratch, Settings, Solid, State, Substeps, TickInput,
    material::Law, step,
};

const SUBSTEPS: [u32; 4] = [8, 16, 32, 64];
const TICKS: usize = 30;

/// `‖x_s − x_2s‖` over all nodes after the same time.
pub(super) fn study() -> Result<Convergence> {
    let ends = SUBSTEPS.iter().map(|&substeps| swung(substeps)).collect::<Result<Vec<_>>>()?;
    let distance = |p: &[DVec3], q: &[DVec3]| p.iter().zip(q).map(|(p, q)| p.distance_squared(*q)).sum::<f64>().sqrt();
    Ok(Convergence {
        quantity: "leapfrog: positions against half the time step (m)",
        refined: "substeps per tick",
        sizes: SUBSTEPS.to_vec(),
        errors: ends.windows(2).map(|two| distance(&two[0], &two[1])).collect(),
        demand: 1.9,
    })
}

fn swung(substeps: u32) -> Result<Vec<DVec3>> {
    let body = Body::Block.tets(8)?;
    let load = load::on_tets(Action::Patch { radius_m: 20e-3, force_n: 1.0 }, &body);
    let model = Model::build(ModelSpec {
        body: BodySpec::Tet(
            Solid {
                regions: vec![Region {
                    name: "body".into(),
                    material: bodies::material(Law::StableNeoHookean, 10e3, 0.4)?,
                    density_kg_per_m3: 1000.0,
                }],
                tet_region: vec![0; body.mesh.tets().len()],
                mesh: body.mesh,
            }
            .into(),
        ),
        prescribed: body.prescribed,
        loads: load.into_iter().map(|load| LoadSpec::NodalForces(load.forces_n)).collect(),
        gravity_m_per_s2: DVec3::ZERO,
        tools: vec![],
        settings: Settings { precision: Precision::Double, substeps: Substeps::Fixed(substeps), ..Settings::default() },
    })
    .into_diagnostic()?;
    let (mut state, mut scratch) = (State::at_rest(&model), Scratch::new(&model));
    let held = vec![DVec3::ZERO; model.prescribed().len()];
    let input = TickInput { tools: &[], load_factors: &[1.0], prescribed_displacements_m: &held, point_forces: &[] };
    for _ in 0..TICKS {
        let report = step(&model, &mut state, &mut scratch, &input);
        ensure!(report.quarantined.is_none(), "the swinging block is quarantined at {substeps} substeps");
    }
    Ok(state.mechanical.x)
}
