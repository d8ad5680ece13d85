//! The surroundings of a body of any kind.
use super::{EnvironmentError, PointForce, Steps};
use crate::{
    contact::{
        ContactModel, Coupling, LARGEST_TRIANGLE, SelfContact, SkinAtRest, SubstepTime, ToolShape, ToolSpec, ToolState,
        Turning,
    },
    mesh::Surface,
    settings::{Integrator, LoadSpec, MAX_SUBSTEPS, PrescribedSpec, SelfContactChoice, Settings, Substeps},
};
use glam::DVec3;

/// The specification of a body's surroundings.
#[derive(Debug, Clone, PartialEq)]
pub struct EnvironmentSpec {
    /// Numerical settings.
    pub settings: Settings,
    /// Prescribed displacements; each axis of a node may be prescribed once.
    pub prescribed: Vec<PrescribedSpec>,
    /// Loads.
    pub loads: Vec<LoadSpec>,
    /// Gravity (m/s²).
    pub gravity_m_per_s2: DVec3,
    /// Tools.
    pub tools: Vec<ToolSpec>,
}

/// Settings, constraints, loads, gravity, tools, and the surface on which these act. It does not change after it is
/// loaded.
#[derive(Debug, Clone)]
pub struct Environment {
    /// Numerical settings.
    pub settings: Settings,
    /// Prescribed displacements.
    pub prescribed: Vec<PrescribedSpec>,
    /// Loads.
    pub loads: Vec<LoadSpec>,
    /// Gravity (m/s²).
    pub gravity_m_per_s2: DVec3,
    /// Tools.
    pub tools: Vec<ToolSpec>,
    /// Surface that tools touch, loads act on and viewers see.
    pub surface: Surface,
    /// Contact with that surface.
    pub contact: ContactModel,
    /// Number of substeps per tick, and of those in a long step of a coarse level.
    pub(crate) steps: Steps,
    /// Number of first nodes at which forces may be injected although they need not be on the surface.
    pub(crate) inner_nodes: usize,
}

impl Environment {
    /// Returns the surroundings of a body with this surface, contact and number of substeps.
    pub(crate) fn new(spec: EnvironmentSpec, surface: Surface, contact: ContactModel, steps: Steps) -> Self {
        let EnvironmentSpec { settings, prescribed, loads, gravity_m_per_s2, tools } = spec;
        Self { settings, prescribed, loads, gravity_m_per_s2, tools, surface, contact, steps, inner_nodes: 0 }
    }

    /// Returns the same surroundings, where forces may also be injected at the first `inner_nodes` nodes, inside the
    /// body or not.
    pub(crate) fn with_inner_nodes(self, inner_nodes: usize) -> Self {
        Self { inner_nodes, ..self }
    }

    /// Returns whether an injected force is finite and on a node that may have one.
    pub(crate) fn accepts(&self, point: &PointForce) -> bool {
        let node = point.node as usize;
        let on_surface = || self.surface.vertex_of_node.get(node).is_some_and(|&vertex| vertex != u32::MAX);
        (node < self.inner_nodes || on_surface()) && point.force_n.is_finite()
    }

    /// Returns the time of an evaluation of forces in the form that contact takes.
    pub(crate) fn substep_time(&self, fraction: f64, dt_s: f64) -> SubstepTime {
        SubstepTime { fraction, dt_s, tick_period_s: self.settings.tick_period_s }
    }

    /// Returns the tools' states before the first tick.
    pub(crate) fn tools_at_start(&self) -> Vec<ToolState> {
        self.tools.iter().map(ToolState::at_start).collect()
    }
}

impl EnvironmentSpec {
    /// Checks all ranges. `surface` is the one that tools and loads act on, with its nodes at `rest_positions_m` (m);
    /// the first `prescribed_nodes` nodes may be prescribed.
    ///
    /// # Errors
    /// Names the first value that is outside its range.
    pub(crate) fn check(
        &self,
        surface: &Surface,
        rest_positions_m: &[DVec3],
        prescribed_nodes: usize,
    ) -> Result<(), EnvironmentError> {
        for set in &self.prescribed {
            indices("node", set.nodes.iter().map(|&n| n as usize), prescribed_nodes)?;
        }
        self.loads.iter().try_for_each(|load| loaded(load, rest_positions_m.len(), surface.triangles.len()))?;
        self.tools.iter().try_for_each(tool)?;
        if self.settings.integrator == Integrator::BackwardEuler {
            self.demand_spheres("backward Euler, which knows no stiffness of a tool that turns")?;
        }
        self.tools.iter().try_for_each(|tool| fine_enough(surface, rest_positions_m, tool))?;
        self.check_settings()
    }

    /// Returns the self-contact of a body with this skin, where it is to have it.
    pub(crate) fn walls_of(&self, skin: &SkinAtRest<'_>) -> Option<SelfContact> {
        match self.settings.self_contact {
            SelfContactChoice::On => SelfContact::build(skin, false),
            SelfContactChoice::WhereFacing if self.settings.integrator == Integrator::Leapfrog => {
                SelfContact::build(skin, true)
            }
            SelfContactChoice::Off | SelfContactChoice::WhereFacing => None,
        }
    }

    /// Refuses capsules, because they cannot press `what`.
    pub(crate) fn demand_spheres(&self, what: &'static str) -> Result<(), EnvironmentError> {
        match self.tools.iter().find(|tool| tool.shape.as_capsule().is_some()) {
            Some(tool) => Err(EnvironmentError::SpheresOnly { tool: tool.name.clone(), what }),
            None => Ok(()),
        }
    }

    fn check_settings(&self) -> Result<(), EnvironmentError> {
        let s = &self.settings;
        let period = s.tick_period_s;
        setting("tick_period_s", period, period > 0.0 && period.is_finite(), "must be finite and larger than 0")?;
        let safety = s.step_safety;
        setting("step_safety", safety, safety > 0.0 && safety <= 1.0, "must be in (0, 1]")?;
        let stretch = s.stretch_allowance;
        setting("stretch_allowance", stretch, stretch >= 1.0 && stretch.is_finite(), "must be 1 or larger")?;
        let damping = s.mass_damping_per_s;
        setting("mass_damping_per_s", damping, damping >= 0.0 && damping.is_finite(), "must not be negative")?;
        setting("solver_iterations", f64::from(s.solver_iterations), s.solver_iterations >= 1, "must be 1 or more")?;
        let tolerance = s.solver_tolerance;
        setting("solver_tolerance", tolerance, tolerance > 0.0 && tolerance < 1.0, "must be in (0, 1)")?;
        let sleep = s.sleep_tolerance_m;
        setting("sleep_tolerance_m", sleep, sleep >= 0.0 && sleep.is_finite(), "must not be negative")?;
        let sleeps = matches!(s.integrator, Integrator::Leapfrog | Integrator::BackwardEuler);
        setting(
            "sleep_tolerance_m",
            sleep,
            sleep == 0.0 || sleeps,
            "must be 0 with the seeds' schemes, which never sleep",
        )?;
        let walls_ok = s.self_contact != SelfContactChoice::On || s.integrator == Integrator::Leapfrog;
        setting("self_contact", 1.0, walls_ok, "needs leapfrog, whose substeps are made for it")?;
        if let Substeps::Fixed(n) = s.substeps {
            setting("substeps", f64::from(n), (1..=MAX_SUBSTEPS).contains(&n), "must be 1 to 100000")?;
        }
        let gravity = self.gravity_m_per_s2.length();
        setting("gravity_m_per_s2", gravity, gravity.is_finite(), "must be finite")
    }
}

fn loaded(load: &LoadSpec, nodes: usize, triangles: usize) -> Result<(), EnvironmentError> {
    let finite = |name, value: f64| setting(name, value, value.is_finite(), "must be finite");
    let on = |list: &[u32]| indices("surface triangle", list.iter().map(|&t| t as usize), triangles);
    match load {
        LoadSpec::NodalForces(forces) => {
            indices("node", forces.iter().map(|f| f.0 as usize), nodes)?;
            forces.iter().try_for_each(|(_, force_n)| finite("nodal force (N)", force_n.length()))
        }
        LoadSpec::Traction { triangles, traction_pa } => {
            on(triangles)?;
            finite("traction_pa", traction_pa.length())
        }
        LoadSpec::Pressure { triangles, pressure_pa, .. } => {
            on(triangles)?;
            finite("pressure_pa", *pressure_pa)
        }
    }
}

/// Checks that no triangle of the surface is too large for the tool's contact samples.
fn fine_enough(surface: &Surface, rest_positions_m: &[DVec3], tool: &ToolSpec) -> Result<(), EnvironmentError> {
    let sizes_m = (0..surface.triangles.len()).map(|t| (t, surface.longest_edge_m(t, rest_positions_m)));
    let Some((triangle, size_m)) = sizes_m.max_by(|a, b| a.1.total_cmp(&b.1)) else {
        return Ok(());
    };
    let largest_m = LARGEST_TRIANGLE * tool.radius_m;
    if size_m <= largest_m * (1.0 + 1e-9) {
        return Ok(());
    }
    let [a, b, c] = surface.triangle_nodes(triangle).map(|n| rest_positions_m[n as usize]);
    let (tool, radius_m, centre_m) = (tool.name.clone(), tool.radius_m, (a + b + c) / 3.0);
    Err(EnvironmentError::SurfaceTooCoarse { tool, radius_m, triangle, centre_m, size_m, largest_m })
}

fn tool(tool: &ToolSpec) -> Result<(), EnvironmentError> {
    let positive =
        |name, value: f64| setting(name, value, value > 0.0 && value.is_finite(), "must be finite and larger than 0");
    let not_negative =
        |name, value: f64| setting(name, value, value >= 0.0 && value.is_finite(), "must be finite and not negative");
    positive("tool radius_m", tool.radius_m)?;
    not_negative("friction_coefficient", tool.friction_coefficient)?;
    if let Coupling::Spring { stiffness_n_per_m, damping_n_s_per_m, mass_kg } = tool.coupling {
        positive("coupling_stiffness_n_per_m", stiffness_n_per_m)?;
        not_negative("coupling_damping_n_s_per_m", damping_n_s_per_m)?;
        positive("tool mass_kg", mass_kg)?;
    }
    if let ToolShape::Capsule(capsule) = &tool.shape {
        positive("tool half_length_m", capsule.half_length_m)?;
        let orientation = capsule.start_orientation;
        let is_rotation = orientation.is_finite() && orientation.is_normalized();
        setting("tool start_orientation", orientation.length(), is_rotation, "must be of length 1")?;
        if let Coupling::Spring { .. } = tool.coupling {
            let Turning { stiffness_nm_per_rad, damping_nm_s_per_rad, inertia_kg_m2 } = capsule.turning;
            positive("turning stiffness_nm_per_rad", stiffness_nm_per_rad)?;
            not_negative("turning damping_nm_s_per_rad", damping_nm_s_per_rad)?;
            positive("turning inertia_kg_m2", inertia_kg_m2)?;
        }
    }
    let start = tool.start_position_m.length();
    setting("tool start_position_m", start, start.is_finite(), "must be finite")
}

/// Refuses a value that is not `ok`, with the rule that it violates.
pub(crate) fn setting(name: &'static str, value: f64, ok: bool, rule: &'static str) -> Result<(), EnvironmentError> {
    if ok { Ok(()) } else { Err(EnvironmentError::Setting { name, value, rule }) }
}

/// Refuses an index that is not below `count`.
pub(crate) fn indices(
    what: &'static str,
    mut indices: impl Iterator<Item = usize>,
    count: usize,
) -> Result<(), EnvironmentError> {
    match indices.find(|&index| index >= count) {
        Some(index) => Err(EnvironmentError::OutOfRange { what, index, count }),
        None => Ok(()),
    }
}
