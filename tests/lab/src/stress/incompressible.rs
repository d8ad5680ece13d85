//! Lamé's thick sphere under internal pressure as ν → ½, on one octant; the linear answer of the mesh itself, no Richardson.
//! The pressure is so small that every law is linear.
use super::{Measured, Options, Outcome, rig};
use crate::methods::tet_body;
use crate::{
    bodies,
    problems::{
        Action,
        body::{Body, OCTANT_M},
        exact, load,
    },
};
use glam::DVec3;
use miette::{IntoDiagnostic, Result};
use palpate_physics::{
    LoadSpec, Model,
    material::Law,
    statics::{Goal, StaticSettings, solve_static},
};
use std::{collections::BTreeSet, ops::ControlFlow};

pub(super) const CRITERION: &str =
    "Lame's sphere at nu 0.45, 0.49, 0.499, 0.4999: u(a) within 2, 3, 5, 8 %, on the finest mesh, without Richardson";

const YOUNG_PA: f64 = 10e3;
const PRESSURE_PA: f64 = 1.0;
const LOCKING: &str = "linear tetrahedra lock as nu -> 1/2: one volume constraint per tet leaves too few free displacements; \
                       nodal smoothing is not built yet";

/// ν, the largest error of u(a) (%), and the largest that locking is known to make of it on the coarsest of the last meshes.
const ALLOWED: [(f64, f64, f64); 4] = [(0.45, 2.0, 20.0), (0.49, 3.0, 33.0), (0.499, 5.0, 40.0), (0.4999, 8.0, 40.0)];

pub(super) fn run(options: &Options) -> Result<Outcome> {
    let meshes: &[usize] = options.pick(&[4, 8], &[6, 12, 24], &[12, 24, 48]);
    let mut outcome = Outcome::passing();
    for (poisson, allowed_percent, locked_percent) in ALLOWED {
        let exact_m = exact::lame_m(OCTANT_M[0], PRESSURE_PA, YOUNG_PA, poisson);
        let mut last = None;
        for (index, &cells) in meshes.iter().enumerate() {
            let (inner_m, tets) = inner_displacement_m(options, poisson, cells)?;
            let percent = 100.0 * (inner_m / exact_m - 1.0);
            let name = format!("error of u(a), nu = {poisson}, {tets} tets");
            outcome.push(if index + 1 < meshes.len() {
                Measured::value(name, percent.abs(), "%")
            } else {
                Measured::bounded(name, percent.abs(), "%", allowed_percent).known_to_exceed(LOCKING, locked_percent)
            });
            if let Some(before_m) = last.replace(inner_m)
                && index + 1 == meshes.len()
            {
                let limit_m: f64 = inner_m + (inner_m - before_m) / 3.0;
                let percent = 100.0 * (limit_m / exact_m - 1.0);
                outcome.push(Measured::value(format!("the same by Richardson, nu = {poisson}"), percent.abs(), "%"));
            }
        }
    }
    Ok(outcome)
}

/// Mean radial displacement (m) of the cavity's wall, and the number of tets.
fn inner_displacement_m(options: &Options, poisson: f64, cells: usize) -> Result<(f64, usize)> {
    let body = Body::Octant.tets(cells as u32)?;
    let cavity: BTreeSet<u32> = body.touched.iter().flatten().copied().collect();
    let load = load::on_tets(Action::Pressure { pressure_pa: PRESSURE_PA }, &body);
    let mut spec = rig::body(options, body.mesh, bodies::material(Law::StableNeoHookean, YOUNG_PA, poisson)?);
    spec.prescribed = body.prescribed;
    spec.loads = load.into_iter().map(|load| LoadSpec::NodalForces(load.forces_n)).collect();
    let model = Model::build(spec).into_diagnostic()?;
    let settings = StaticSettings { relative_residual: 1e-9, ..StaticSettings::default() };
    let go_on = &mut |_: &_| ControlFlow::Continue(());
    let found = solve_static(
        &model,
        &Goal { load_factors: &[1.0], prescribed_displacements_m: &[DVec3::ZERO; 3], ..Goal::default() },
        &settings,
        go_on,
    )
    .into_diagnostic()?;
    let grown = cavity.iter().map(|&n| found.x[n as usize].length() - OCTANT_M[0]);
    Ok((grown.sum::<f64>() / cavity.len() as f64, tet_body(&model).mesh().tets().len()))
}
