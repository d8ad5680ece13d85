//! A body under way: model, state, buffers, and what drives a tick. The one place of the suite that steps time.
use super::Options;
use crate::methods::tet_body;
use glam::DVec3;
use miette::{IntoDiagnostic, Result};
use palpate_physics::{
    BodySpec, Energies, Model, ModelSpec, PointForce, Precision, PrescribedSpec, Region, Scratch, Settings, Solid,
    State, StepReport, TetMesh, TickInput, contact::ToolTarget, material::Material, step, world,
};

/// A body and its state.
#[derive(Debug, Clone)]
pub(super) struct Rig {
    pub(super) spec: ModelSpec,
    pub(super) model: Model,
    pub(super) state: State,
    pub(super) scratch: Scratch,
    /// Substeps of the last tick.
    substeps: u32,
}

/// What a tick is given.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Drive {
    pub(super) tools: Vec<ToolTarget>,
    pub(super) load_factors: Vec<f64>,
    pub(super) prescribed_m: Vec<DVec3>,
    pub(super) point_forces: Vec<PointForce>,
}

impl Drive {
    /// Holds a model's tools and prescribed nodes where they start, without loads.
    pub(super) fn still(model: &Model) -> Self {
        let at = |position_m| ToolTarget::at(position_m);
        Self {
            tools: model.tools().iter().map(|tool| at(tool.start_position_m)).collect(),
            load_factors: vec![0.0; model.loads().len()],
            prescribed_m: vec![DVec3::ZERO; model.prescribed().len()],
            point_forces: Vec::new(),
        }
    }
}

impl Rig {
    pub(super) fn new(spec: ModelSpec) -> Result<Self> {
        let model = Model::build(spec.clone()).into_diagnostic()?;
        Ok(Self {
            spec,
            state: State::at_rest(&model),
            scratch: Scratch::new(&model),
            substeps: model.substeps(),
            model,
        })
    }

    /// One tick. Allocates nothing.
    pub(super) fn tick(&mut self, drive: &Drive) -> StepReport {
        let input = TickInput {
            tools: &drive.tools,
            load_factors: &drive.load_factors,
            prescribed_displacements_m: &drive.prescribed_m,
            point_forces: &drive.point_forces,
        };
        let report = step(&self.model, &mut self.state, &mut self.scratch, &input);
        self.substeps = report.substeps.max(1);
        report
    }

    pub(super) fn energies(&self) -> Energies {
        Energies::of(&self.model, &self.state)
    }

    pub(super) fn min_volume_ratio(&self) -> f64 {
        world::min_volume_ratio(&self.model, &self.state).map_or(1.0, |smallest| smallest.ratio)
    }

    pub(super) fn is_finite(&self) -> bool {
        world::first_non_finite(&self.state).is_none()
    }

    /// Largest distance (m) of any node from its rest position.
    pub(super) fn largest_displacement_m(&self) -> f64 {
        let rest = self.model.rest_positions_m();
        self.state.mechanical.x.iter().zip(rest).map(|(x, rest)| x.distance(*rest)).fold(0.0, f64::max)
    }

    /// `⅛ dt² Σ f_i·f/m` (J) with the internal force `f_i` and the total one `f`, over the free degrees of freedom.
    ///
    /// Leapfrog does not conserve `K + U − W`. With `g = f − f_i` of work `W`, trapezoids of `f_i` as the change of `−U` (exact
    /// for a linear body), and the kinetic energy taken from the velocities half a step before and after,
    /// `½ m v₋·v₊ = K − ⅛ dt² f²/m`, what stays is
    /// ```text
    /// K + U − W − ⅛ dt² Σ f_i·f/m
    /// ```
    /// (the last term in W's own share is `+⅛ dt² g·f/m`, since the ledger stands half a kick before the end of a step). So this
    /// is by how much the energy held may exceed the work done although nothing is wrong: second order in dt.
    pub(super) fn leapfrog_excess_j(&self) -> f64 {
        let dt_s = self.model.settings().tick_period_s / f64::from(self.substeps);
        let weight = self.model.gravity_m_per_s2();
        let nodes = self.state.mechanical.force_n.iter().zip(&self.state.mechanical.external_n);
        let masses = self.model.body().mass_kg().iter().zip(tet_body(&self.model).inverse_mass_per_kg());
        let terms = nodes.zip(masses).map(|((force, external), (mass, inverse_mass))| {
            let internal = *force - *external - weight * *mass;
            (internal * *force * *inverse_mass).element_sum()
        });
        0.125 * dt_s * dt_s * terms.sum::<f64>()
    }
}

/// Settings of every body of the suite: f64 forces, ticks of 1 ms, the integrator under test.
pub(super) fn settings(_options: &Options) -> Settings {
    Settings { precision: Precision::Double, ..Settings::default() }
}

/// A body of one material without viscosity, 1000 kg/m³, nothing held or loaded.
pub(super) fn body(options: &Options, mesh: TetMesh, material: Material) -> ModelSpec {
    ModelSpec {
        body: BodySpec::Tet(
            Solid {
                tet_region: vec![0; mesh.tets().len()],
                mesh,
                regions: vec![Region { name: "body".into(), material, density_kg_per_m3: 1000.0 }],
            }
            .into(),
        ),
        prescribed: Vec::new(),
        loads: Vec::new(),
        gravity_m_per_s2: DVec3::ZERO,
        tools: Vec::new(),
        settings: settings(options),
    }
}

/// The tets of a body that was made by [`body`].
pub(super) fn solid_mut(spec: &mut ModelSpec) -> &mut Solid {
    match &mut spec.body {
        BodySpec::Tet(spec) => &mut spec.solid,
        _ => unreachable!("stressed bodies are of tetrahedra until they are given particles"),
    }
}

/// The same, to be read.
pub(super) fn solid(spec: &ModelSpec) -> &Solid {
    match &spec.body {
        BodySpec::Tet(spec) => &spec.solid,
        _ => unreachable!("stressed bodies are of tetrahedra until they are given particles"),
    }
}

/// Nodes held in all directions.
pub(super) fn hold(name: &str, nodes: Vec<u32>) -> PrescribedSpec {
    PrescribedSpec { name: name.into(), nodes, axes: [true; 3], is_fixed: false }
}
