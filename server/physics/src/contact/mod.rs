//! Spheres and capsules against the deforming surface.
//!
//! Once a substep, for every tool: it moves ([`proxy`]), the broad phase lists the triangles near it ([`broad`]), samples
//! fixed in the surface press and rub ([`foundation`], [`narrow`]), and the forces go to nodes and tool by the transpose.
//! Once a tick the contact is summed up for the servo loop ([`local_model`]).
mod axis;
pub(crate) mod broad;
mod foundation;
mod inside;
mod local_model;
mod local_torque;
mod narrow;
mod nearest;
mod proxy;
mod resting;
mod spring;
mod state;
mod tangent;
mod tool;
mod touched;
mod touching;
mod triangle;
mod turning;

pub use inside::is_inside;
pub use local_torque::LocalTorqueModel;
pub(crate) use nearest::{deepest_m, nearest_vertex};
pub use proxy::SubstepTime;
pub(crate) use resting::{Pressing, RestingContact};
pub(crate) use spring::SaturatingSpring;
pub use state::ContactState;
pub(crate) use tangent::{ContactTangents, StepAhead};
pub use tool::{Capsule, Coupling, LocalContactModel, ToolShape, ToolSpec, ToolState, ToolTarget, Turning};
pub use triangle::closest_weights;

/// The longest edge of a surface triangle, over the radius of a tool, that can still be sampled as finely as contact needs.
pub const LARGEST_TRIANGLE: f64 = foundation::MAX_LEVEL as f64 * foundation::SPACING;

use crate::mesh::Surface;
use axis::Axis;
use broad::{Skin, Triangles};
use foundation::{BodyAtRest, Foundation, SampleTables};
use glam::DVec3;
use local_model::MeanContact;
use narrow::{Meeting, Pressed};
use touching::Touching;

/// Elastic moduli behind a boundary triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceModuli {
    /// `λ + 2µ` (Pa).
    pub p_wave_pa: f64,
    /// `E/(1 − ν²)` (Pa).
    pub indentation_pa: f64,
}

/// What contact needs that depends on the rest state alone.
#[derive(Debug, Clone, Default)]
pub struct ContactModel {
    /// Bound (N/m) of what contact can do at each node: a spring in all directions. Empty without tools.
    pub nodal_stiffness_n_per_m: Vec<f64>,
    /// Bound (rad²/s²) of what contact and coupling add through the tools' masses.
    pub tool_frequency_sq: f64,
    triangles: Triangles,
    tables: SampleTables,
    tools: Vec<ToolModel>,
}

/// What contact needs of one tool.
#[derive(Debug, Clone)]
struct ToolModel {
    spec: ToolSpec,
    foundation: Foundation,
    /// Where the coupling saturates (N).
    force_limit_n: f64,
    /// Bound of the kinetic energy with which the tool meets the surface (J).
    impact_energy_j: f64,
}

/// The foundation on one boundary triangle, as one tool meets it: for methods with a contact of their own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriangleFoundation<'a> {
    /// Corners, counter-clockwise from outside.
    pub nodes: [u32; 3],
    /// Weights of the second and third corner in every sample.
    pub weights: &'a [[f64; 2]],
    /// `k_f a` (N/m) of each sample.
    pub stiffness_n_per_m: f64,
}

/// The body at one instant.
#[derive(Debug, Clone, Copy)]
pub struct Body<'a> {
    /// Positions (m) of its nodes.
    pub x: &'a [DVec3],
    /// Velocities (m/s) of its nodes.
    pub v: &'a [DVec3],
    /// Bound of the speed (m/s) with which any node came here.
    pub fastest_m_per_s: f64,
}

/// The surface at one instant.
pub(crate) struct SurfaceNow<'a> {
    /// Positions (m) of its nodes, of use at those that are listed.
    pub(crate) x: &'a [DVec3],
    /// Velocity (m/s) of any of them.
    pub(crate) velocity_m_per_s: &'a dyn Fn(u32) -> DVec3,
}

/// Buffers of contact.
#[derive(Debug, Clone, Default)]
pub struct ContactScratch {
    tools: Vec<ToolScratch>,
    /// Every triangle is looked at in every substep: no broad phase. Same bits, only slower.
    exhaustive: bool,
}

#[derive(Debug, Clone)]
struct ToolScratch {
    next: Touching,
    sum: Pressed,
    coupling_sum_n: DVec3,
    coupling_sum_nm: DVec3,
    /// Triangle (as the broad phase numbers them) nearest to the centre when it was last pressed.
    nearest: usize,
}

impl ToolModel {
    fn new(spec: &ToolSpec, foundation: Foundation) -> Self {
        let radius_m = spec.radius_m;
        let depth_m = proxy::IMPACT_DEPTH * radius_m;
        Self {
            spec: spec.clone(),
            force_limit_n: foundation.flat_force_n(radius_m, proxy::SATURATION_DEPTH * radius_m),
            // ∫ π k_f R d² dd
            impact_energy_j: foundation.flat_force_n(radius_m, depth_m) * depth_m / 3.0,
            foundation,
        }
    }

    /// The axis of the tool now (m, world).
    fn axis(&self, tool: &ToolState) -> Axis {
        self.spec.shape.axis(tool.centre_m, tool.orientation)
    }

    /// The coupling's spring; `None` of a rigid tool.
    fn spring(&self) -> Option<SaturatingSpring> {
        match self.spec.coupling {
            Coupling::Rigid => None,
            Coupling::Spring { stiffness_n_per_m, .. } => {
                Some(SaturatingSpring { stiffness_n_per_m, limit_n: self.force_limit_n })
            }
        }
    }
}

impl ContactModel {
    /// Precomputes contact samples and the foundation stiffness of a body at rest, whose largest natural frequency without
    /// contact is given. `moduli[triangle]` are those of the tets behind it.
    pub fn build(
        rest_positions_m: &[DVec3],
        surface: &Surface,
        moduli: &[SurfaceModuli],
        mass_kg: &[f64],
        max_natural_frequency_rad_per_s: f64,
        tools: &[ToolSpec],
    ) -> Self {
        if tools.is_empty() {
            return Self::default();
        }
        let triangles = Triangles::of(surface, rest_positions_m);
        let body = BodyAtRest {
            triangles: &triangles,
            positions_m: rest_positions_m,
            moduli,
            mass_kg,
            // A body without a free node has none; its foundation is then of no consequence, but must be finite.
            frequency_sq: max_natural_frequency_rad_per_s.max(1.0).powi(2),
        };
        let tools: Vec<ToolModel> = tools
            .iter()
            .map(|tool| ToolModel::new(tool, Foundation::new(&body, tool.radius_m, tool.shape.half_length_m())))
            .collect();
        let (mut nodal_stiffness_n_per_m, mut tool_frequency_sq) = (vec![0.0; mass_kg.len()], 0.0);
        for tool in &tools {
            let size = (tool.spec.radius_m, tool.spec.shape.half_length_m());
            let (nodal, total) = tool.foundation.row_sums_n_per_m(&triangles, mass_kg.len(), size);
            for (sum, nodal) in nodal_stiffness_n_per_m.iter_mut().zip(nodal) {
                *sum += nodal;
            }
            tool_frequency_sq += tool.spec.frequency_bound_sq(&total);
        }
        Self { nodal_stiffness_n_per_m, tool_frequency_sq, tables: SampleTables::new(), tools, triangles }
    }

    /// Force (N) at which a tool's coupling saturates; infinite for a rigid tool.
    pub fn force_limit_n(&self, tool: usize) -> f64 {
        self.spring(tool).map_or(f64::INFINITY, |spring| spring.limit_n)
    }

    /// The foundation under a tool, triangle by triangle; nothing for a tool that is not there.
    pub fn foundation(&self, tool: usize) -> impl Iterator<Item = TriangleFoundation<'_>> {
        self.tools.get(tool).into_iter().flat_map(move |tool| {
            self.triangles.nodes.iter().enumerate().map(move |(triangle, &nodes)| {
                let samples = tool.foundation.of(triangle, &self.tables);
                TriangleFoundation { nodes, weights: samples.weights, stiffness_n_per_m: samples.stiffness_n_per_m }
            })
        })
    }

    /// The spring of a tool's coupling; `None` of a rigid tool.
    pub(crate) fn spring(&self, tool: usize) -> Option<SaturatingSpring> {
        self.tools[tool].spring()
    }

    /// Contact's part of the state, touching nothing.
    pub fn state(&self) -> ContactState {
        ContactState::new(self)
    }

    /// A state read from a snapshot, in buffers of this model's size; `None` when it does not fit.
    pub(crate) fn adopt(&self, saved: &ContactState) -> Option<ContactState> {
        self.state().adopt(saved, |tool| self.tools[tool].foundation.samples)
    }

    /// Buffers large enough for every tick.
    pub fn scratch(&self, skip_distant: bool) -> ContactScratch {
        let tool = |tool: &ToolModel| ToolScratch {
            next: Touching::with_capacity(tool.foundation.samples),
            sum: Pressed::default(),
            coupling_sum_n: DVec3::ZERO,
            coupling_sum_nm: DVec3::ZERO,
            nearest: 0,
        };
        ContactScratch { tools: self.tools.iter().map(tool).collect(), exhaustive: !skip_distant }
    }

    /// Once a tick, before its first substep.
    pub fn begin_tick(&self, tools: &mut [ToolState], scratch: &mut ContactScratch, tick_period_s: f64) {
        let time = SubstepTime { fraction: 1.0, dt_s: 0.0, tick_period_s };
        for (tool, scratch) in tools.iter_mut().zip(&mut scratch.tools) {
            time.smooth(tool);
            tool.penetration_m = 0.0;
            scratch.sum = Pressed::default();
            scratch.coupling_sum_n = DVec3::ZERO;
            scratch.coupling_sum_nm = DVec3::ZERO;
        }
    }

    /// Once a substep, after the body drifted: moves the tools with it, and adds contact forces (N) on nodes to `forces_n`.
    pub fn substep(
        &self,
        body: &Body<'_>,
        time: &SubstepTime,
        tools: &mut [ToolState],
        contact: &mut ContactState,
        forces_n: &mut [DVec3],
        scratch: &mut ContactScratch,
    ) {
        self.move_tools(body.fastest_m_per_s, time, tools, contact);
        for (index, tool) in tools.iter().enumerate() {
            self.list_candidates(index, &self.tools[index].axis(tool), body.x, contact, scratch.exhaustive);
        }
        let surface = SurfaceNow { x: body.x, velocity_m_per_s: &|node| body.v[node as usize] };
        self.press_tools(&surface, time, tools, contact, forces_n, scratch);
    }

    /// The first part of a substep: the body drifted with up to `fastest_m_per_s`, the tools follow.
    pub(crate) fn move_tools(
        &self,
        fastest_m_per_s: f64,
        time: &SubstepTime,
        tools: &mut [ToolState],
        contact: &mut ContactState,
    ) {
        contact.travelled(fastest_m_per_s * time.dt_s);
        for (index, tool) in tools.iter_mut().enumerate() {
            self.drift(index, tool, time, contact);
        }
    }

    /// The second part, on a skin: lists anew where a list is out of date. Whether any was. `x` has room for positions (m) of all vertices.
    pub(crate) fn list_on_skin(
        &self,
        (skin, x): (&mut impl Skin, &mut [DVec3]),
        tools: &[ToolState],
        contact: &mut ContactState,
        scratch: &ContactScratch,
    ) -> bool {
        let mut renewed = false;
        for (index, tool) in tools.iter().enumerate() {
            let (part, boxes, travel_m) = contact.split(index);
            let candidates = &mut part.candidates;
            if scratch.exhaustive {
                renewed |= candidates.triangles().len() != self.triangles.len();
                self.triangles.list_all(candidates);
            } else if candidates.slack_m <= 0.0 {
                let reach_m = self.reach_m(index);
                let axis = self.tools[index].axis(tool);
                self.triangles.query_skin((skin, x), (boxes, travel_m), &axis, reach_m, candidates);
                renewed = true;
            }
        }
        renewed
    }

    /// Nodes of the triangles that any tool may touch, some of them several times.
    pub(crate) fn listed_nodes<'a>(&'a self, contact: &'a ContactState) -> impl Iterator<Item = u32> + 'a {
        contact.listed().flat_map(|triangle| self.triangles.nodes[triangle as usize])
    }

    /// Nodes of all triangles, in the order of the broad phase.
    pub(crate) fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles.nodes
    }

    /// The last part: presses the tools on what is listed, and adds the forces (N) on nodes.
    pub(crate) fn press_tools(
        &self,
        SurfaceNow { x, velocity_m_per_s }: &SurfaceNow<'_>,
        time: &SubstepTime,
        tools: &mut [ToolState],
        contact: &mut ContactState,
        forces_n: &mut [DVec3],
        scratch: &mut ContactScratch,
    ) {
        for (index, (tool, scratch)) in tools.iter_mut().zip(&mut scratch.tools).enumerate() {
            let model = &self.tools[index];
            let pressed = self.press(index, tool, x, contact, forces_n, scratch);
            let surface_m_per_s = self.surface_m_per_s(&pressed, *velocity_m_per_s);
            let coupling = proxy::finish(model, tool, &pressed, surface_m_per_s, time);
            scratch.nearest = pressed.nearest.0;
            tool.friction_heat_j += pressed.heat_j;
            tool.contacts = pressed.contacts;
            tool.contact_energy_j = pressed.energy_j;
            tool.penetration_m = tool.penetration_m.max(pressed.penetration_m);
            if time.dt_s > 0.0 {
                scratch.sum.add(&pressed);
                scratch.coupling_sum_n += coupling.force_n;
                scratch.coupling_sum_nm += coupling.torque_nm;
            }
        }
    }

    /// [`Self::substep`] where the body does not move and no tool is near it, of which there is nothing but the tools' motion. Stops and
    /// returns false as soon as one is near.
    pub fn substep_apart(
        &self,
        x: &[DVec3],
        time: &SubstepTime,
        tools: &mut [ToolState],
        contact: &mut ContactState,
        scratch: &mut ContactScratch,
    ) -> bool {
        let exhaustive = scratch.exhaustive;
        for (index, (tool, scratch)) in tools.iter_mut().zip(&mut scratch.tools).enumerate() {
            self.drift(index, tool, time, contact);
            let axis = self.tools[index].axis(tool);
            self.list_candidates(index, &axis, x, contact, exhaustive);
            if self.is_near(index, &axis, x, contact) {
                return false;
            }
            let nothing = Pressed { to_surface_m: DVec3::INFINITY, ..Pressed::default() };
            let coupling = proxy::finish(&self.tools[index], tool, &nothing, DVec3::ZERO, time);
            scratch.coupling_sum_n += coupling.force_n;
            scratch.coupling_sum_nm += coupling.torque_nm;
        }
        true
    }

    /// Whether no tool is within a quarter of its radius of the surface. The lists must be of the present positions.
    pub fn is_apart(&self, x: &[DVec3], tools: &[ToolState], contact: &ContactState) -> bool {
        tools.iter().enumerate().all(|(index, tool)| !self.is_near(index, &self.tools[index].axis(tool), x, contact))
    }

    /// By distances, not by what is listed: which triangles beyond the zone are on a list depends on when it was made.
    fn is_near(&self, tool: usize, axis: &Axis, x: &[DVec3], contact: &ContactState) -> bool {
        let zone_m = (1.0 + proxy::NEAR) * self.tools[tool].spec.radius_m;
        let listed = contact.tools[tool].candidates.triangles();
        listed.iter().any(|&triangle| axis.distance_m(self.triangles.corners(triangle as usize, x)) < zone_m)
    }

    fn drift(&self, index: usize, tool: &mut ToolState, time: &SubstepTime, contact: &mut ContactState) {
        let part = &contact.tools[index];
        let moved_m = proxy::drift(&self.tools[index], tool, (part.force_n, part.torque_nm), time);
        contact.tools[index].candidates.slack_m -= moved_m;
    }

    fn list_candidates(&self, tool: usize, axis: &Axis, x: &[DVec3], contact: &mut ContactState, exhaustive: bool) {
        let (part, boxes, travel_m) = contact.split(tool);
        if exhaustive {
            self.triangles.list_all(&mut part.candidates);
        } else if part.candidates.slack_m <= 0.0 {
            self.triangles.query(x, (boxes, travel_m), axis, self.reach_m(tool), &mut part.candidates);
        }
    }

    /// How far from a tool's axis (m) triangles are listed, and within what none may be missing.
    fn reach_m(&self, tool: usize) -> (f64, f64) {
        let radius_m = self.tools[tool].spec.radius_m;
        ((1.0 + 2.0 * proxy::NEAR) * radius_m, (1.0 + proxy::NEAR) * radius_m)
    }

    fn press(
        &self,
        index: usize,
        tool: &ToolState,
        x: &[DVec3],
        contact: &mut ContactState,
        forces_n: &mut [DVec3],
        scratch: &mut ToolScratch,
    ) -> Pressed {
        let (model, part) = (&self.tools[index], &mut contact.tools[index]);
        let meeting = Meeting {
            triangles: &self.triangles,
            foundation: &model.foundation,
            tables: &self.tables,
            x,
            axis: model.axis(tool),
            orientation: model.spec.shape.as_capsule().map(|_| tool.orientation),
            radius_m: model.spec.radius_m,
            friction_coefficient: model.spec.friction_coefficient,
            put_into: std::mem::take(&mut part.just_put) || part.touching.tells_it_was_put(),
        };
        let pressed = narrow::press(&meeting, &mut part.candidates, &mut part.touching, &mut scratch.next, forces_n);
        (part.force_n, part.torque_nm) = (pressed.force_n, pressed.torque_nm);
        pressed
    }

    /// Velocity (m/s) of the point of the surface nearest to a tool.
    fn surface_m_per_s(&self, pressed: &Pressed, velocity_m_per_s: &dyn Fn(u32) -> DVec3) -> DVec3 {
        let (triangle, weights) = pressed.nearest;
        if weights == [0.0; 3] {
            return DVec3::ZERO;
        }
        let corners = self.triangles.nodes[triangle];
        corners.into_iter().zip(weights).map(|(node, weight)| velocity_m_per_s(node) * weight).sum()
    }

    /// Once a tick, at its end: means and local models.
    pub fn end_tick(
        &self,
        tools: &mut [ToolState],
        contact: &mut ContactState,
        substeps: u32,
        scratch: &mut ContactScratch,
    ) {
        let share = 1.0 / f64::from(substeps);
        for (index, (tool, scratch)) in tools.iter_mut().zip(&scratch.tools).enumerate() {
            let model = &self.tools[index];
            let pressed = scratch.sum.scaled(share);
            (tool.contact_force_n, tool.contact_torque_nm) = (pressed.force_n, pressed.torque_nm);
            (tool.device_force_n, tool.device_torque_nm) = match model.spec.coupling {
                Coupling::Rigid => (pressed.force_n, pressed.torque_nm),
                Coupling::Spring { .. } => (-scratch.coupling_sum_n * share, -scratch.coupling_sum_nm * share),
            };
            let mean =
                MeanContact { pressed, device_force_n: tool.device_force_n, device_torque_nm: tool.device_torque_nm };
            tool.local_model = local_model::update(model, tool, &mut contact.tools[index].estimate, &mean);
        }
    }
}
