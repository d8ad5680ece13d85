//! Extended position-based dynamics with small steps (Macklin, Müller & Chentanez 2016; Macklin et al. 2019).
//!
//! A tick is `n` substeps `h = T/n` of one sweep of Gauss and Seidel each, multipliers starting at zero:
//! ```text
//! v ← e^{−c h} v        x₀ ← x        x ← x + h v + h² f/m        every constraint: x ← x + Δx        v ← (x − x₀)/h
//! ```
//! In f64: at 40 substeps f32 would hold velocities, as differences of positions, to some 1e-4 m/s.
//!
//! - `elements.rs`: the body's energy as constraints
//! - `contact.rs`: the sphere
mod contact;
mod elements;

use super::{Method, Pace, Running, subject::Subject};
use crate::methods::tet_body;
use crate::problems::Problem;
use contact::Contact;
use elements::{Elements, Node};
use glam::DVec3;
use miette::{Result, ensure};
use palpate_physics::{Settings, Substeps, material::Law};

/// One variant.
pub(super) struct Xpbd {
    name: &'static str,
    what: &'static str,
    substeps: u32,
}

impl Xpbd {
    pub(super) fn variants() -> Vec<Self> {
        vec![
            Self {
                name: "XPBD 10",
                what: "Extended position-based dynamics with small steps: the law's energy as compliant constraints (Macklin & Müller \
                       2021 where it is stable neo-Hookean), 10 substeps of one sweep of Gauss and Seidel each.",
                substeps: 10,
            },
            Self { name: "XPBD 40", what: "The same with 40 substeps.", substeps: 40 },
        ]
    }
}

impl Method for Xpbd {
    fn name(&self) -> &str {
        self.name
    }

    fn what(&self) -> &str {
        self.what
    }

    fn build(&self, problem: &Problem, resolution: u32, pace: &Pace) -> Result<Box<dyn Running>> {
        ensure!(
            problem.law != Law::FixedCorotated,
            "XPBD is not run with the fixed corotated law: a rotation per element and sweep makes it some 25 times slower"
        );
        let settings = Settings {
            mass_damping_per_s: pace.damping_per_s,
            substeps: Substeps::Fixed(self.substeps),
            ..Settings::default()
        };
        Ok(Box::new(Body::new(Subject::new(problem, resolution, problem.material()?, settings)?)))
    }
}

struct Body {
    subject: Subject,
    h_s: f64,
    elements: Elements,
    contact: Option<Contact>,
    nodes: Vec<Node>,
    /// Positions (m) at the substep's start, velocities (m/s).
    before: Vec<DVec3>,
    v: Vec<DVec3>,
    /// Dead load at factor 1 (N).
    load_n: Vec<DVec3>,
    /// Part of the action that the last tick ended with.
    fraction: f64,
    /// Mean force (N) of the body on the tool during the last tick.
    tool_n: DVec3,
    /// Positions (m), for who reads.
    x: Vec<DVec3>,
}

impl Body {
    fn new(subject: Subject) -> Self {
        let model = &subject.model;
        let h_s = model.settings().tick_period_s / f64::from(model.substeps());
        let x = model.rest_positions_m().to_vec();
        let zeros = vec![DVec3::ZERO; x.len()];
        let node = |(x, w): (&DVec3, &DVec3)| Node { x: *x, w: *w };
        Self {
            h_s,
            elements: Elements::of(model, h_s),
            contact: subject.tool.as_ref().map(|tool| Contact::of(model, tool.radius_m, h_s)),
            nodes: x.iter().zip(tet_body(model).inverse_mass_per_kg()).map(node).collect(),
            before: x.clone(),
            v: zeros.clone(),
            load_n: subject.load.as_ref().map_or(zeros, |load| load.dense(x.len())),
            fraction: 0.0,
            tool_n: DVec3::ZERO,
            x,
            subject,
        }
    }

    /// To a part of the action; returns the force (N) of the body on the tool.
    fn substep(&mut self, fraction: f64) -> DVec3 {
        let h = self.h_s;
        let damping = (-self.subject.model.settings().mass_damping_per_s * h).exp();
        let push = h * h * fraction;
        for (i, node) in self.nodes.iter_mut().enumerate() {
            self.before[i] = node.x;
            node.x += self.v[i] * (damping * h) + node.w * self.load_n[i] * push;
        }
        self.elements.project(&mut self.nodes);
        let centre_m = self.subject.tool.as_ref().map(|tool| tool.centre_m(fraction));
        let mut tool_n = DVec3::ZERO;
        if let (Some(contact), Some(centre_m)) = (&self.contact, centre_m) {
            tool_n = contact.project(centre_m, &mut self.nodes) / (-h * h);
        }
        for ((v, node), before) in self.v.iter_mut().zip(&self.nodes).zip(&self.before) {
            *v = (node.x - *before) / h;
        }
        tool_n
    }
}

impl Running for Body {
    fn tick(&mut self, fraction: f64) {
        if let (Some(contact), Some(tool)) = (&mut self.contact, &self.subject.tool) {
            contact.look(tool.centre_m(fraction), &self.nodes);
        }
        let (from, substeps) = (self.fraction, self.subject.model.substeps());
        let mut sum_n = DVec3::ZERO;
        for substep in 1..=substeps {
            let part = f64::from(substep) / f64::from(substeps);
            sum_n += self.substep(from + (fraction - from) * part);
        }
        self.tool_n = sum_n / f64::from(substeps);
        self.fraction = fraction;
        for (x, node) in self.x.iter_mut().zip(&self.nodes) {
            *x = node.x;
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
        self.subject.size(self.subject.model.substeps() as usize)
    }

    fn failure(&self) -> Option<String> {
        let finite = self.x.iter().all(|x| x.is_finite());
        (!finite).then(|| "its positions are not finite".into())
    }
}

#[cfg(test)]
mod tests;
