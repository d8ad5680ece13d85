//! Linear tetrahedra with lumped mass, as the server runs them: laws, factor conventions, integrators, precisions.
use super::{Method, Pace, Running};
use crate::problems::{
    Action, Problem,
    body::TetBody,
    load::{self, NodalLoad},
    sample::{self, Probe},
};
use glam::DVec3;
use miette::{IntoDiagnostic, Result};
use palpate_physics::{
    Energies, Integrator, LoadSpec, Model, ModelSpec, Precision, Region, Scratch, Settings, State, TickInput,
    contact::{Coupling, ToolSpec, ToolTarget},
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
        let body = problem.body.tets(resolution)?;
        let settings = Settings { mass_damping_per_s: pace.damping_per_s, ..(self.settings)() };
        let load = load::on_tets(problem.action, &body);
        let mut spec = spec(self.material(problem)?, &body, settings);
        spec.loads = load.iter().map(|load| LoadSpec::NodalForces(load.forces_n.clone())).collect();
        let tool = match problem.action {
            Action::Sphere { radius_m, depth_m } => Some(Tool {
                touch_m: body.first_touch_m(radius_m),
                way_m: body.normal * -depth_m,
                normal: body.normal,
                radius_m,
            }),
            _ => None,
        };
        spec.tools = tool.iter().map(Tool::spec).collect();
        let probe = Probe::new(&body, &sample::points(problem.body));
        let model = Model::build(spec).into_diagnostic()?;
        Ok(Box::new(Body {
            state: State::at_rest(&model),
            scratch: Scratch::new(&model),
            targets: tool.iter().map(|t| ToolTarget { position_m: t.touch_m, velocity_m_per_s: DVec3::ZERO }).collect(),
            factors: vec![0.0; model.spec().loads.len()],
            prescribed_m: vec![DVec3::ZERO; model.spec().prescribed.len()],
            failure: None,
            model,
            load,
            tool,
            probe,
        }))
    }
}

fn spec(material: Material, body: &TetBody, settings: Settings) -> ModelSpec {
    ModelSpec {
        mesh: body.mesh.clone(),
        regions: vec![Region { name: "body".into(), material, density_kg_per_m3: 1000.0 }],
        tet_region: vec![0; body.mesh.tets().len()],
        prescribed: body.prescribed.clone(),
        loads: vec![],
        gravity_m_per_s2: DVec3::ZERO,
        tools: vec![],
        settings,
    }
}

/// A problem's body with nothing that acts on it.
pub(super) fn unloaded(problem: &Problem, body: &TetBody) -> Result<Model> {
    Model::build(spec(problem.material()?, body, Settings::default())).into_diagnostic()
}

struct Tool {
    touch_m: DVec3,
    way_m: DVec3,
    normal: DVec3,
    radius_m: f64,
}

impl Tool {
    fn spec(&self) -> ToolSpec {
        ToolSpec {
            name: "tool".into(),
            radius_m: self.radius_m,
            coupling: Coupling::Rigid,
            friction_coefficient: 0.0,
            start_position_m: self.touch_m,
        }
    }
}

struct Body {
    model: Model,
    state: State,
    scratch: Scratch,
    targets: Vec<ToolTarget>,
    factors: Vec<f64>,
    prescribed_m: Vec<DVec3>,
    load: Option<NodalLoad>,
    tool: Option<Tool>,
    probe: Probe,
    failure: Option<String>,
}

impl Running for Body {
    fn tick(&mut self, fraction: f64) {
        if let Some(tool) = &self.tool {
            let period_s = self.model.spec().settings.tick_period_s;
            for target in &mut self.targets {
                let position_m = tool.touch_m + tool.way_m * fraction;
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
        let report = step(&self.model, &mut self.state, &mut self.scratch, &input);
        if let Some(quarantine) = report.quarantined {
            self.failure = Some(quarantine.to_string());
        }
    }

    fn answer(&self) -> f64 {
        match (&self.tool, &self.load) {
            (Some(tool), _) => self.state.tools.iter().map(|t| t.contact_force_n.dot(tool.normal)).sum(),
            (None, Some(load)) => load.displacement_m(self.model.rest_positions_m(), &self.state.x),
            (None, None) => 0.0,
        }
    }

    fn displacements_m(&self) -> Vec<DVec3> {
        self.probe.displacements_m(self.model.rest_positions_m(), &self.state.x)
    }

    fn energy_error(&self) -> Option<f64> {
        let energies = Energies::of(&self.model, &self.state);
        Some((energies.balance_j() / energies.external_work_j).abs()).filter(|error| error.is_finite())
    }

    fn size(&self) -> [usize; 3] {
        let mesh = self.model.mesh();
        [mesh.tets().len(), mesh.positions_m().len(), self.model.substeps() as usize]
    }

    fn failure(&self) -> Option<String> {
        self.failure.clone()
    }
}
