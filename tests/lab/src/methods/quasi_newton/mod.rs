//! Backward Euler as a minimisation, by a prefactored quasi-Newton method (Liu, Bouaziz & Kavan 2017).
//!
//! Every tick minimises, over the free axes,
//! ```text
//! g(x) = |x − y|²_M / (2 dt²) + Σ V Ψ(F) + Φ(x) − f·x        y = x_n + dt e^{−c dt} v_n        v_{n+1} = (x − x_n)/dt
//! ```
//! with the contact's potential Φ and the dead load f at the tick's end: whose minimum is backward Euler's step. Iterations start at y, go
//! along `−H ∇g` with L-BFGS on the constant matrix `A` ([`prefactor`]) and the last five pairs, and halve the step until Armijo's
//! condition holds. A fixed number of iterations is done, as its authors do; pairs are kept from tick to tick.
//!
//! - The change of `g` along a step `αd` is taken as `½α (∇g(x) + ∇g(x + αd))·d`: exact to third order, free of the
//!   cancellation of two energies, and it costs nothing, for the next iteration needs that gradient.
//! - Elastic forces are the kernel's, contact is the server's, with the same samples.
mod history;
mod prefactor;

use super::{Method, Pace, Running, subject::Subject};
use crate::methods::tet_body;
use crate::problems::Problem;
use glam::DVec3;
use history::{History, dot};
use miette::Result;
use palpate_physics::{
    Precision, Settings, State, Substeps,
    contact::{BodyMotion, ContactScratch, ContactState, SubstepTime, ToolState, ToolTarget},
    kernels::KernelScratch,
};
use prefactor::Prefactored;

/// Armijo's share of the slope.
const ARMIJO: f64 = 0.3;
/// Most halvings of a step.
const HALVINGS: u32 = 10;
/// Decrease over the largest one so far that is rounding: such a step is taken as it is, and teaches nothing.
const ROUNDING: f64 = 1e-18;

/// One variant.
pub(super) struct QuasiNewton {
    name: &'static str,
    what: &'static str,
    iterations: usize,
}

impl QuasiNewton {
    pub(super) fn variants() -> Vec<Self> {
        vec![
            Self {
                name: "quasi-Newton 1",
                what: "Backward Euler as a minimisation (Liu, Bouaziz & Kavan 2017): matrix factorised once, L-BFGS with 5 pairs, line \
                       search; one iteration per tick.",
                iterations: 1,
            },
            Self { name: "quasi-Newton 5", what: "The same with 5 iterations per tick.", iterations: 5 },
        ]
    }
}

impl Method for QuasiNewton {
    fn name(&self) -> &str {
        self.name
    }

    fn what(&self) -> &str {
        self.what
    }

    fn build(&self, problem: &Problem, resolution: u32, pace: &Pace) -> Result<Box<dyn Running>> {
        let settings = Settings {
            mass_damping_per_s: pace.damping_per_s,
            precision: Precision::Double,
            substeps: Substeps::Fixed(1),
            ..Settings::default()
        };
        let subject = Subject::new(problem, resolution, problem.material()?, settings)?;
        Ok(Box::new(Body::new(subject, self.iterations)?))
    }
}

struct Body {
    subject: Subject,
    system: Prefactored,
    history: History,
    iterations: usize,
    tools: Vec<ToolState>,
    contact: ContactState,
    contact_scratch: ContactScratch,
    kernel_scratch: KernelScratch,
    /// Positions (m) and velocities (m/s).
    x: Vec<DVec3>,
    v: Vec<DVec3>,
    /// Positions (m) at the tick's start, and where inertia alone leads.
    before: Vec<DVec3>,
    inertial: Vec<DVec3>,
    /// `∇g` (N) at `x`.
    gradient: Vec<DVec3>,
    direction: Vec<DVec3>,
    next: Point,
    /// Dead load at factor 1 (N).
    load_n: Vec<DVec3>,
    factor: f64,
    /// Force of the body on the tool (N).
    tool_n: DVec3,
    largest_decrease_j: f64,
    failure: Option<String>,
}

/// A point of the search.
struct Point {
    x: Vec<DVec3>,
    gradient: Vec<DVec3>,
    contact_n: Vec<DVec3>,
}

impl Body {
    fn new(subject: Subject, iterations: usize) -> Result<Self> {
        let model = &subject.model;
        let state = State::at_rest(model);
        let nodes = state.mechanical.x.len();
        let zeros = || vec![DVec3::ZERO; nodes];
        Ok(Self {
            system: Prefactored::new(model, model.settings().tick_period_s)?,
            history: History::new(nodes),
            iterations,
            contact: model.contact().state(),
            contact_scratch: model.contact().scratch(true),
            kernel_scratch: tet_body(model).kernel().scratch(),
            tools: state.mechanical.tools,
            before: state.mechanical.x.clone(),
            inertial: state.mechanical.x.clone(),
            next: Point { x: state.mechanical.x.clone(), gradient: zeros(), contact_n: zeros() },
            x: state.mechanical.x,
            v: zeros(),
            gradient: zeros(),
            direction: zeros(),
            load_n: subject.load.as_ref().map_or_else(zeros, |load| load.dense(nodes)),
            factor: 0.0,
            tool_n: DVec3::ZERO,
            largest_decrease_j: 0.0,
            failure: None,
            subject,
        })
    }

    /// Gradient at `next.x`, to which nodes came from `x`.
    fn evaluate(&mut self) {
        let (model, next) = (&self.subject.model, &mut self.next);
        let dt_s = model.settings().tick_period_s;
        next.contact_n.fill(DVec3::ZERO);
        if !self.tools.is_empty() {
            // The broad phase must hear of every motion; a halved step comes back by as much as is left.
            let moved = next.x.iter().zip(&self.x).map(|(a, b)| a.distance_squared(*b)).fold(0.0, f64::max).sqrt();
            let body = BodyMotion { x: &next.x, v: &self.v, fastest_m_per_s: moved / dt_s };
            let time = SubstepTime { fraction: 1.0, dt_s, tick_period_s: dt_s };
            model.contact().substep(
                &body,
                &time,
                &mut self.tools,
                &mut self.contact,
                &mut next.contact_n,
                &mut self.contact_scratch,
            );
        }
        // ∇g = M (x − y)/dt² − f_elastic − f_contact − f
        let rest = model.rest_positions_m();
        tet_body(model).kernel().forces_n(rest, &next.x, &self.v, &mut next.gradient, &mut self.kernel_scratch);
        let inertia = model.body().mass_kg().iter().map(|mass| mass / (dt_s * dt_s));
        for (node, inertia) in inertia.enumerate() {
            let force_n = next.gradient[node] + next.contact_n[node] + self.load_n[node] * self.factor;
            let gradient = (next.x[node] - self.inertial[node]) * inertia - force_n;
            let held = tet_body(model).inverse_mass_per_kg()[node].cmpeq(DVec3::ZERO);
            next.gradient[node] = DVec3::select(held, DVec3::ZERO, gradient);
        }
    }

    fn accept(&mut self) {
        std::mem::swap(&mut self.x, &mut self.next.x);
        std::mem::swap(&mut self.gradient, &mut self.next.gradient);
    }

    /// One step of the search.
    fn iterate(&mut self) {
        self.history.direction(&self.gradient, &mut self.direction, |a| self.system.solve(a));
        let mut slope_j = dot(&self.gradient, &self.direction);
        if slope_j >= 0.0 {
            // Not downhill: what is remembered is of elsewhere.
            self.history.forget();
            self.history.direction(&self.gradient, &mut self.direction, |a| self.system.solve(a));
            slope_j = dot(&self.gradient, &self.direction);
        }
        self.largest_decrease_j = self.largest_decrease_j.max(-slope_j);
        let rounding = -slope_j <= ROUNDING * self.largest_decrease_j;
        let mut step = 1.0;
        for _ in 0..=HALVINGS {
            for ((next, x), d) in self.next.x.iter_mut().zip(&self.x).zip(&self.direction) {
                *next = *x + *d * step;
            }
            self.evaluate();
            // g(x + αd) − g(x) ≈ ½α (∇g + ∇g')·d ≤ γ α ∇g·d
            let mean = 0.5 * (slope_j + dot(&self.next.gradient, &self.direction));
            if rounding || mean <= ARMIJO * slope_j {
                break;
            }
            step *= 0.5;
        }
        if !rounding {
            self.history.push((&self.x, &self.next.x), (&self.gradient, &self.next.gradient));
        }
        self.accept();
    }
}

impl Running for Body {
    fn tick(&mut self, fraction: f64) {
        let settings = &self.subject.model.settings();
        let dt_s = settings.tick_period_s;
        let damping = (-settings.mass_damping_per_s * dt_s).exp();
        self.factor = fraction;
        if let Some(tool) = &self.subject.tool {
            let position_m = tool.centre_m(fraction);
            for state in &mut self.tools {
                state.previous_target = state.target;
                state.target = ToolTarget::at(position_m);
            }
        }
        self.before.copy_from_slice(&self.x);
        for ((inertial, v), x) in self.inertial.iter_mut().zip(&self.v).zip(&self.x) {
            *inertial = *x + *v * (damping * dt_s);
        }
        self.next.x.copy_from_slice(&self.inertial);
        self.evaluate();
        self.accept();
        for _ in 0..self.iterations {
            self.iterate();
        }
        for ((v, x), before) in self.v.iter_mut().zip(&self.x).zip(&self.before) {
            *v = (*x - *before) / dt_s;
        }
        self.tool_n = -self.next.contact_n.iter().sum::<DVec3>();
        if !self.tool_n.is_finite() || self.x.iter().any(|x| !x.is_finite()) {
            self.failure = Some("its positions are not finite".into());
        }
    }

    fn answer(&self) -> f64 {
        self.subject.answer(&self.x, self.tool_n)
    }

    fn displacements_m(&self) -> Vec<DVec3> {
        self.subject.displacements_m(&self.x)
    }

    fn energy_error(&self) -> Option<f64> {
        None
    }

    fn size(&self) -> [usize; 3] {
        self.subject.size(1)
    }

    fn failure(&self) -> Option<String> {
        self.failure.clone()
    }
}

#[cfg(test)]
mod tests;
