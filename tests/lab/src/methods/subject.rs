//! A problem set up on a mesh of linear tetrahedra: what every method on them shares.
use crate::problems::{
    Action, Problem,
    body::TetBody,
    load::{self, NodalLoad},
    sample::{self, Probe},
};
use glam::DVec3;
use miette::{IntoDiagnostic, Result};
use palpate_physics::{
    Body, BodySpec, LoadSpec, Model, ModelSpec, Region, Settings, Solid,
    bodies::tet::{TetElements, TetSpec},
    contact::{Coupling, ToolShape, ToolSpec},
    material::Material,
};

/// Model, and what acts on it.
pub(crate) struct Subject {
    pub(crate) model: Model,
    pub(super) load: Option<NodalLoad>,
    pub(crate) tool: Option<Tool>,
    pub(super) probe: Probe,
}

impl Subject {
    pub(crate) fn new(problem: &Problem, resolution: u32, material: Material, settings: Settings) -> Result<Self> {
        Self::of_elements(TetElements::Linear, problem, resolution, material, settings)
    }

    pub(crate) fn of_elements(
        elements: TetElements,
        problem: &Problem,
        resolution: u32,
        material: Material,
        settings: Settings,
    ) -> Result<Self> {
        let body = problem.body.tets(resolution)?;
        let load = load::on_tets(problem.action, &body);
        let mut spec = spec(material, &body, settings);
        spec.body = BodySpec::Tet(TetSpec { solid: solid(material, &body), elements });
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
        Ok(Self { model: Model::build(spec).into_diagnostic()?, load, tool, probe })
    }

    /// The problem's answer (N or m) where nodes are at `x` (m) and the body presses the tool with `force_n` (N).
    pub(crate) fn answer(&self, x: &[DVec3], force_n: DVec3) -> f64 {
        match (&self.tool, &self.load) {
            (Some(tool), _) => force_n.dot(tool.normal),
            (None, Some(load)) => load.displacement_m(self.model.rest_positions_m(), x),
            (None, None) => 0.0,
        }
    }

    /// Displacements (m) of the problem's material points.
    pub(super) fn displacements_m(&self, x: &[DVec3]) -> Vec<DVec3> {
        self.probe.displacements_m(self.model.rest_positions_m(), x)
    }

    /// Elements, nodes and the given substeps.
    pub(super) fn size(&self, substeps: usize) -> [usize; 3] {
        let mesh = tet_body(&self.model).mesh();
        [mesh.tets().len(), mesh.positions_m().len(), substeps]
    }
}

/// A problem's body of one material.
pub(super) fn solid(material: Material, body: &TetBody) -> Solid {
    Solid {
        mesh: body.mesh.clone(),
        regions: vec![Region { name: "body".into(), material, density_kg_per_m3: 1000.0 }],
        tet_region: vec![0; body.mesh.tets().len()],
    }
}

pub(super) fn spec(material: Material, body: &TetBody, settings: Settings) -> ModelSpec {
    ModelSpec {
        body: BodySpec::Tet(solid(material, body).into()),
        prescribed: body.prescribed.clone(),
        loads: vec![],
        gravity_m_per_s2: DVec3::ZERO,
        tools: vec![],
        settings,
    }
}

/// The tets of a model of tets alone, which all of [`Subject`] are.
pub(crate) fn tet_body(model: &Model) -> &palpate_physics::bodies::tet::TetBody {
    match model.body() {
        Body::Tet(body) => body,
        _ => unreachable!("methods on tetrahedra are given bodies of tetrahedra"),
    }
}

/// A problem's body with nothing that acts on it.
pub(super) fn unloaded(problem: &Problem, body: &TetBody) -> Result<Model> {
    Model::build(spec(problem.material()?, body, Settings::default())).into_diagnostic()
}

/// A rigid sphere without friction, and its way.
pub(crate) struct Tool {
    pub(super) touch_m: DVec3,
    pub(super) way_m: DVec3,
    pub(super) normal: DVec3,
    pub(super) radius_m: f64,
}

impl Tool {
    /// Its centre (m) after a part of its way.
    pub(crate) fn centre_m(&self, fraction: f64) -> DVec3 {
        self.touch_m + self.way_m * fraction
    }

    pub(crate) fn spec(&self) -> ToolSpec {
        ToolSpec {
            name: "tool".into(),
            shape: ToolShape::Sphere,
            radius_m: self.radius_m,
            coupling: Coupling::Rigid,
            friction_coefficient: 0.0,
            start_position_m: self.touch_m,
        }
    }
}
