//! Linear tetrahedra with lumped mass, as the server runs them: laws, factor conventions, integrators, precisions.
use super::{Method, Pace, Running, driven::Driven, subject::Subject};
use crate::problems::Problem;
use glam::DVec3;
use miette::{IntoDiagnostic, Result};
use palpate_physics::{
    Integrator, Precision, Settings, Substeps,
    bodies::tet::TetElements,
    material::{Convention, Lame, Law, Material, Viscosity},
};

/// One variant.
pub(super) struct Tetrahedra {
    name: &'static str,
    what: &'static str,
    /// Instead of the problem's law, with its factor convention.
    law: Option<(Law, Convention)>,
    elements: TetElements,
    settings: fn() -> Settings,
}

impl Tetrahedra {
    pub(super) fn variants() -> Vec<Self> {
        let double = || Settings { precision: Precision::Double, ..Settings::default() };
        let stvk = |convention| Some((Law::StVenantKirchhoff, convention));
        vec![
            Self {
                name: super::LINEAR_TETS,
                what: "Linear tetrahedra with the problem's law, explicit leapfrog, forces in f32.",
                law: None,
                elements: TetElements::Linear,
                settings: Settings::default,
            },
            Self {
                name: super::SMOOTHED_TETS,
                what: "The same with most of the strain averaged around nodes: what scenes of tets alone get when they ask for nothing else.",
                law: None,
                elements: TetElements::Smoothed,
                settings: Settings::default,
            },
            Self {
                name: "linear tets in f64",
                what: "Linear tetrahedra with forces in f64.",
                law: None,
                elements: TetElements::Linear,
                settings: double,
            },
            Self {
                name: "papers' Verlet",
                what: "The seeds' position Verlet (2006, eq. 33) with the problem's law: leapfrog's positions, velocities half a step ahead.",
                law: None,
                elements: TetElements::Linear,
                settings: || Settings { integrator: Integrator::SeedVerlet, ..Settings::default() },
            },
            Self {
                name: "papers' semi-implicit Euler",
                what: "The seeds' semi-implicit Euler with nodewise Jacobian (eq. 34) with the problem's law, at leapfrog's substeps.",
                law: None,
                elements: TetElements::Linear,
                settings: || Settings { integrator: Integrator::SeedSemiImplicit, ..Settings::default() },
            },
            Self {
                name: "papers' semi-implicit Euler once a tick",
                what: "The same in one step per tick, as the 2006 paper takes it, stable or not.",
                law: None,
                elements: TetElements::Linear,
                settings: || Settings {
                    integrator: Integrator::SeedSemiImplicit,
                    substeps: Substeps::Fixed(1),
                    ..Settings::default()
                },
            },
            Self {
                name: "backward Euler",
                what: "Linearised backward Euler with the problem's law: one step per tick, solved by preconditioned conjugate gradients \
                       to a thousandth of the first residual.",
                law: None,
                elements: TetElements::Linear,
                settings: || Settings { integrator: Integrator::BackwardEuler, ..Settings::default() },
            },
            Self {
                name: "backward Euler to a tenth",
                what: "The same to a tenth.",
                law: None,
                elements: TetElements::Linear,
                settings: || Settings {
                    integrator: Integrator::BackwardEuler,
                    solver_tolerance: 0.1,
                    ..Settings::default()
                },
            },
            Self {
                name: "papers' law of 2006",
                what: "The seeds' St. Venant-Kirchhoff law with the elastic factor that the 2006 paper prints (half of the consistent \
                       one), by leapfrog in f32.",
                law: stvk(Convention::Paper2006),
                elements: TetElements::Linear,
                settings: Settings::default,
            },
            Self {
                name: "papers' law of 2005",
                what: "The same law with the 2005 paper's factors, which are consistent, by leapfrog in f32.",
                law: stvk(Convention::Paper2005),
                elements: TetElements::Linear,
                settings: Settings::default,
            },
        ]
    }

    fn material(&self, problem: &Problem) -> Result<Material> {
        let Some((law, convention)) = self.law else { return problem.material() };
        let lame = Lame::from_young_poisson(problem.young_modulus_pa, problem.poisson_ratio).into_diagnostic()?;
        Ok(Material::new(law, lame, Viscosity::default(), convention))
    }
}

impl Method for Tetrahedra {
    fn name(&self) -> &str {
        self.name
    }

    fn what(&self) -> &str {
        self.what
    }

    fn competes(&self, problem: &Problem) -> bool {
        self.law.is_none_or(|(law, convention)| law == problem.law && convention.elastic_factor() == 1.0)
    }

    fn build(&self, problem: &Problem, resolution: u32, pace: &Pace) -> Result<Box<dyn Running>> {
        let settings = Settings { mass_damping_per_s: pace.damping_per_s, ..(self.settings)() };
        let subject = Subject::of_elements(self.elements, problem, resolution, self.material(problem)?, settings)?;
        Ok(Box::new(Body { driven: Driven::at_rest(&subject.model, subject.tool.as_ref()), subject }))
    }
}

struct Body {
    subject: Subject,
    driven: Driven,
}

impl Running for Body {
    fn tick(&mut self, fraction: f64) {
        self.driven.tick(&self.subject.model, self.subject.tool.as_ref(), fraction);
    }

    fn answer(&self) -> f64 {
        self.subject.answer(&self.driven.state.mechanical.x, self.driven.tool_force_n())
    }

    fn displacements_m(&self) -> Vec<DVec3> {
        self.subject.displacements_m(&self.driven.state.mechanical.x)
    }

    fn energy_error(&self) -> Option<f64> {
        self.driven.energy_error(&self.subject.model)
    }

    fn size(&self) -> [usize; 3] {
        self.subject.size(self.subject.model.substeps() as usize)
    }

    fn failure(&self) -> Option<String> {
        self.driven.failure()
    }
}
