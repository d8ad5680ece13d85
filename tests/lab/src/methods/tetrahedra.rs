//! Linear tetrahedra with lumped mass, as the server runs them: laws, factor conventions, integrators, precisions.
use super::{
    Method, Pace, Running,
    subject::{Subject, Tool},
};
use crate::problems::Problem;
use glam::DVec3;
use miette::{IntoDiagnostic, Result};
use palpate_physics::{
    Energies, Integrator, Precision, Scratch, Settings, State, Substeps, TickInput,
    contact::ToolTarget,
    material::{Convention, Lame, Law, Material, Viscosity},
    step,
};

/// One variant.
pub(super) struct Tetrahedra {
    name: &'static str,
    what: &'static str,
    /// Instead of the problem's law, with its factor convention.
    law: Option<(Law, Convention)>,
    settings: fn() -> Settings,
}

impl Tetrahedra {
    pub(super) fn variants() -> Vec<Self> {
        let double = || Settings { precision: Precision::Double, ..Settings::default() };
        let stvk = |convention| Some((Law::StVenantKirchhoff, convention));
        vec![
            Self {
                name: super::DEFAULT,
                what: "The default: the problem's law, explicit leapfrog, forces in f32.",
                law: None,
                settings: Settings::default,
            },
            Self { name: "leapfrog f64", what: "The same with forces in f64.", law: None, settings: double },
            Self {
                name: "seed Verlet",
                what: "The seeds' position Verlet (2006, eq. 33) with the problem's law: leapfrog's positions, velocities half a step ahead.",
                law: None,
                settings: || Settings { integrator: Integrator::SeedVerlet, ..Settings::default() },
            },
            Self {
                name: "seed semi-implicit",
                what: "The seeds' semi-implicit Euler with nodewise Jacobian (eq. 34) with the problem's law, at leapfrog's substeps.",
                law: None,
                settings: || Settings { integrator: Integrator::SeedSemiImplicit, ..Settings::default() },
            },
            Self {
                name: "seed semi-implicit once",
                what: "The same in one step per tick, as the 2006 paper takes it, stable or not.",
                law: None,
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
                settings: || Settings { integrator: Integrator::BackwardEuler, ..Settings::default() },
            },
            Self {
                name: "backward Euler loose",
                what: "The same to a tenth.",
                law: None,
                settings: || Settings {
                    integrator: Integrator::BackwardEuler,
                    solver_tolerance: 0.1,
                    ..Settings::default()
                },
            },
            Self {
                name: "StVK as in 2006",
                what: "The seeds' St. Venant-Kirchhoff law with the elastic factor that the 2006 paper prints (half of the consistent \
                       one), by leapfrog in f32.",
                law: stvk(Convention::Paper2006),
                settings: Settings::default,
            },
            Self {
                name: "StVK as in 2005",
                what: "The same law with the 2005 paper's factors, which are consistent, by leapfrog in f32.",
                law: stvk(Convention::Paper2005),
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
        let subject = Subject::new(problem, resolution, self.material(problem)?, settings)?;
        let model = &subject.model;
        let target = |tool: &Tool| ToolTarget { position_m: tool.touch_m, velocity_m_per_s: DVec3::ZERO };
        Ok(Box::new(Body {
            state: State::at_rest(model),
            scratch: Scratch::new(model),
            targets: subject.tool.iter().map(target).collect(),
            factors: vec![0.0; model.spec().loads.len()],
            prescribed_m: vec![DVec3::ZERO; model.spec().prescribed.len()],
            failure: None,
            subject,
        }))
    }
}

struct Body {
    subject: Subject,
    state: State,
    scratch: Scratch,
    targets: Vec<ToolTarget>,
    factors: Vec<f64>,
    prescribed_m: Vec<DVec3>,
    failure: Option<String>,
}

impl Running for Body {
    fn tick(&mut self, fraction: f64) {
        let model = &self.subject.model;
        if let Some(tool) = &self.subject.tool {
            let period_s = model.spec().settings.tick_period_s;
            for target in &mut self.targets {
                let position_m = tool.centre_m(fraction);
                target.velocity_m_per_s = (position_m - target.position_m) / period_s;
                target.position_m = position_m;
            }
        }
        self.factors.fill(fraction);
        let input = TickInput {
            tools: &self.targets,
            load_factors: &self.factors,
            prescribed_displacements_m: &self.prescribed_m,
            point_forces: &[],
        };
        let report = step(model, &mut self.state, &mut self.scratch, &input);
        if let Some(quarantine) = report.quarantined {
            self.failure = Some(quarantine.to_string());
        }
    }

    fn answer(&self) -> f64 {
        let force_n = self.state.tools.iter().map(|tool| tool.contact_force_n).sum();
        self.subject.answer(&self.state.x, force_n)
    }

    fn displacements_m(&self) -> Vec<DVec3> {
        self.subject.displacements_m(&self.state.x)
    }

    fn energy_error(&self) -> Option<f64> {
        let energies = Energies::of(&self.subject.model, &self.state);
        Some((energies.balance_j() / energies.external_work_j).abs()).filter(|error| error.is_finite())
    }

    fn size(&self) -> [usize; 3] {
        self.subject.size(self.subject.model.substeps() as usize)
    }

    fn failure(&self) -> Option<String> {
        self.failure.clone()
    }
}
