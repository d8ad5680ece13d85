//! What tests of methods share.
#![allow(clippy::unwrap_used)] // a test that cannot build its subject has failed
use super::{
    Pace, Running,
    subject::{Subject, spec},
};
use crate::problems::{self, Problem, sample::Probe};
use glam::DVec3;
use palpate_physics::{
    Model, Settings,
    contact::ToolTarget,
    statics::{Goal, StaticSettings, solve_static},
};
use std::ops::ControlFlow;

pub(super) fn problem(name: &str) -> Problem {
    problems::all().into_iter().find(|problem| problem.name == name).unwrap()
}

/// Until the action is there, and its time to rest.
pub(super) fn settle(running: &mut dyn Running, pace: &Pace) {
    for tick in 1..=pace.ramp_ticks + pace.rest_ticks {
        running.tick(pace.fraction(tick));
        assert_eq!(running.failure(), None, "tick {tick}");
    }
}

/// Positions (m) and answer of the equilibrium on the same mesh.
pub(super) fn equilibrium(subject: &Subject) -> (Vec<DVec3>, f64) {
    let model = &subject.model;
    let tools: Vec<ToolTarget> = subject.tool.iter().map(|t| ToolTarget::at(t.centre_m(1.0))).collect();
    let factors = vec![1.0; model.loads().len()];
    let held = vec![DVec3::ZERO; model.prescribed().len()];
    let settings = StaticSettings::default();
    let found = solve_static(
        model,
        &Goal { load_factors: &factors, prescribed_displacements_m: &held, tools: &tools, ..Goal::default() },
        &settings,
        &mut |_| ControlFlow::Continue(()),
    )
    .unwrap();
    let answer = subject.answer(&found.x, found.tools.iter().map(|tool| tool.contact_force_n).sum());
    (found.x, answer)
}

/// The coarse block of a problem, neither held nor pressed.
pub(super) fn free(problem: &Problem, settings: Settings) -> Subject {
    let body = problem.body.tets(4).unwrap();
    let mut spec = spec(problem.material().unwrap(), &body, settings);
    spec.prescribed.clear();
    Subject { model: Model::build(spec).unwrap(), load: None, tool: None, probe: Probe::new(&body, &[]) }
}

/// Velocities (m/s) that drift, turn and stretch a body.
pub(super) fn tumbling(x: &[DVec3]) -> Vec<DVec3> {
    x.iter().map(|x| DVec3::new(0.2, -0.1, 0.05) + DVec3::new(3.0, 5.0, 2.0).cross(*x) + *x * 4.0).collect()
}

/// `Σ m v` and `Σ m x × v`.
pub(super) fn momenta(model: &Model, x: &[DVec3], v: &[DVec3]) -> [DVec3; 2] {
    let each = || model.body().mass_kg().iter().zip(x).zip(v);
    [each().map(|((m, _), v)| *v * *m).sum(), each().map(|((m, x), v)| x.cross(*v) * *m).sum()]
}

pub(super) fn farthest_m(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
}
