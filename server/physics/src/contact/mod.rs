//! Spheres and capsules against the deforming surface.
//!
//! Once a substep every tool moves ([`proxy`]), the broad phase lists the triangles near it ([`broad`]), samples fixed
//! in the surface press and rub ([`foundation`], [`narrow`], [`friction`]), and the forces are added to those of nodes and tool by
//! the transpose. Once a tick the contact is summed up for the servo loop ([`local_model`]).
mod axis;
mod axis_samples;
pub(crate) mod broad;
mod carriers;
mod clutch;
mod depth;
mod following;
mod foundation;
mod friction;
mod inside;
mod local_model;
mod local_torque;
pub(crate) mod moduli;
mod narrow;
mod nearest;
mod proxy;
mod resting;
mod sample_potential;
pub(crate) mod self_contact;
mod skin_at_rest;
mod spring;
mod state;
mod stepping;
mod stretched_area;
mod tangent;
mod tool;
mod tool_pairs;
mod touched;
mod touching;
mod triangle;
mod turning;

pub(crate) use axis_samples::Near;
pub(crate) use broad::Skin;
pub(crate) use carriers::{CarriersThen, ClustersThen, MostCarriers};
pub use following::{CoupledFollowing, Following};
pub use inside::is_inside;
pub use local_torque::LocalTorqueModel;
pub use moduli::SurfaceModuli;
pub(crate) use nearest::{Known, deepest_m};
pub use proxy::SubstepTime;
pub(crate) use resting::{Pressing, RestingContact};
pub use sample_potential::SamplePotential;
pub use self_contact::MeetingWalls;
pub(crate) use self_contact::{SelfContact, coarse_walls};
pub(crate) use skin_at_rest::{SkinAtRest, SkinFollows};
pub(crate) use spring::SaturatingSpring;
pub use state::ContactState;
pub(crate) use stepping::Drifted;
pub(crate) use tangent::{ContactTangents, StepAhead};
pub use tool::{Capsule, Coupling, LocalContactModel, ToolShape, ToolSpec, ToolState, ToolTarget, Turning};
pub use triangle::closest_weights;

/// The longest edge of a surface triangle, over the radius of a tool, that can still be sampled as finely as contact
/// needs.
pub const LARGEST_TRIANGLE: f64 = foundation::MAX_LEVEL as f64 * foundation::SPACING;

use axis::Axis;
use broad::Triangles;
use foundation::{Foundation, SampleTables, TriangleSamples};
use glam::DVec3;
use narrow::Pressed;
use self_contact::WallScratch;
use tool_pairs::Push;
use touching::Touching;

/// What contact needs that depends on the rest state alone.
#[derive(Debug, Clone, Default)]
pub struct ContactModel {
    /// Bound (N/m) of contact's stiffness at each node, as a spring in all directions. Empty without tools.
    pub nodal_stiffness_n_per_m: Vec<f64>,
    /// Largest distance (m) of a point of the surface at rest from the nearest vertex, or more.
    pub(crate) covering_radius_m: f64,
    /// Bound (rad²/s²) of what contact and coupling add through the tools' masses.
    pub tool_frequency_sq: f64,
    triangles: Triangles,
    tables: SampleTables,
    tools: Vec<ToolModel>,
    /// How walls of the body press each other; `None` where they are left to pass.
    walls: Option<Box<SelfContact>>,
    /// Whether the surface is closed with nothing inside, so that a tool that presses one wall pushes others out ([`narrow`]).
    is_hollow: bool,
}

/// What contact needs of one tool.
#[derive(Debug, Clone)]
struct ToolModel {
    spec: ToolSpec,
    foundation: Foundation,
    /// Force (N) at which the coupling saturates.
    force_limit_n: f64,
    /// Force (N) beyond which the tool slips, if it is rigid.
    slips_at_n: f64,
    /// Bound of the kinetic energy with which the tool meets the surface (J).
    impact_energy_j: f64,
}

/// The foundation on one boundary triangle, as one tool meets it, for methods with a contact of their own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriangleFoundation<'a> {
    /// Corners, counter-clockwise from outside.
    pub nodes: [u32; 3],
    /// Weights of the second and third corner in every sample.
    pub weights: &'a [[f64; 2]],
    /// `k_f a` (N/m) of each sample.
    pub stiffness_n_per_m: f64,
    /// Area (m²) of the triangle at rest.
    pub rest_m2: f64,
}

/// Positions and velocities of a body's nodes at one instant.
#[derive(Debug, Clone, Copy)]
pub struct BodyMotion<'a> {
    /// Positions (m) of its nodes.
    pub x: &'a [DVec3],
    /// Velocities (m/s) of its nodes.
    pub v: &'a [DVec3],
    /// Bound of the speed (m/s) of any node in the drift before.
    pub fastest_m_per_s: f64,
}

/// The surface at one instant.
pub(crate) struct SurfaceNow<'a> {
    /// Positions (m) of its nodes; only those of listed triangles are used.
    pub(crate) x: &'a [DVec3],
    /// Returns the velocity (m/s) of a node.
    pub(crate) velocity_m_per_s: &'a dyn Fn(u32) -> DVec3,
}

/// Buffers of contact.
#[derive(Debug, Clone, Default)]
pub struct ContactScratch {
    tools: Vec<ToolScratch>,
    /// Whether every triangle is looked at in every substep, without a broad phase: the bits are the same, only slower.
    exhaustive: bool,
    walls: WallScratch,
}

#[derive(Debug, Clone)]
struct ToolScratch {
    next: Touching,
    sum: Pressed,
    coupling_sum_n: DVec3,
    coupling_sum_nm: DVec3,
    /// Triangle, as the broad phase numbers them, that was nearest to the tool when it was pressed last.
    nearest: usize,
    /// What other tools do to it now.
    push: Option<Push>,
}

impl ContactScratch {
    /// Returns the largest addition (1/s²) of walls that meet to the squared frequency at a node in the tick so far.
    pub(crate) fn most_of_walls(&self) -> f64 {
        self.walls.most_frequency_sq
    }

    /// Returns the walls that meet, at the last evaluation of forces.
    pub(crate) fn meeting_walls(&self) -> MeetingWalls {
        self.walls.seen()
    }

    /// Returns the largest factor by which the foundation was stiffer than at rest in the tick so far, 1 or more.
    pub(crate) fn most_stiffened(&self) -> f64 {
        self.tools.iter().map(|tool| tool.sum.most_stiffened).fold(1.0, f64::max)
    }
}

impl ToolModel {
    fn new(spec: &ToolSpec, foundation: Foundation) -> Self {
        let radius_m = spec.radius_m;
        let depth_m = proxy::IMPACT_DEPTH * radius_m;
        Self {
            spec: spec.clone(),
            force_limit_n: foundation.bears_n(radius_m),
            slips_at_n: clutch::slips_at_n(spec, &foundation),
            // ∫ π k_f R d² dd
            impact_energy_j: foundation.flat_force_n(radius_m, depth_m) * depth_m / 3.0,
            foundation,
        }
    }

    /// Returns the axis of the tool now (m, world).
    fn axis(&self, tool: &ToolState) -> Axis {
        self.spec.shape.axis(tool.centre_m, tool.orientation)
    }

    /// Returns the coupling's spring, `None` for a rigid tool.
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
    /// Precomputes contact samples and the foundation's stiffness of a body at rest.
    pub(crate) fn build(skin: &SkinAtRest<'_>, tools: &[ToolSpec]) -> Self {
        if tools.is_empty() {
            return Self::default();
        }
        let (surface, nodes) = (skin.surface, skin.mass_kg.len());
        let triangles = Triangles::of(surface, skin.positions_m);
        let tools: Vec<ToolModel> = tools
            .iter()
            .map(|tool| {
                ToolModel::new(tool, Foundation::new(skin, &triangles, tool.radius_m, tool.shape.half_length_m()))
            })
            .collect();
        // Among triangles whose longest edge is l, an equilateral one has the point farthest from all corners: l/√3.
        let edges_m = (0..surface.triangles.len()).map(|triangle| surface.longest_edge_m(triangle, skin.positions_m));
        let covering_radius_m = edges_m.fold(0.0, f64::max) / 3.0_f64.sqrt();
        let (mut nodal_stiffness_n_per_m, mut tool_frequency_sq) = (vec![0.0; nodes], 0.0);
        for tool in &tools {
            let (radius_m, half_length_m) = (tool.spec.radius_m, tool.spec.shape.half_length_m());
            let (nodal, total) = tool.foundation.row_sums_n_per_m(&triangles, nodes, radius_m, half_length_m);
            for (sum, nodal) in nodal_stiffness_n_per_m.iter_mut().zip(nodal) {
                *sum += nodal;
            }
            tool_frequency_sq += tool.spec.frequency_bound_sq(&total);
        }
        let tables = SampleTables::new();
        Self {
            nodal_stiffness_n_per_m,
            covering_radius_m,
            tool_frequency_sq,
            triangles,
            tables,
            tools,
            walls: None,
            is_hollow: false,
        }
    }

    /// Returns the same contact of a surface that has nothing inside.
    #[must_use]
    pub(crate) fn hollow(self) -> Self {
        Self { is_hollow: true, ..self }
    }

    /// Returns the same contact, where walls of the body press each other as told.
    #[must_use]
    pub(crate) fn with_walls(self, walls: Option<SelfContact>) -> Self {
        Self { walls: walls.map(Box::new), ..self }
    }

    /// Returns the same contact, where clusters of walls follow so many nodes, each counted with each of its clusters.
    #[must_use]
    pub(crate) fn with_walls_following(mut self, of_clusters: usize) -> Self {
        if let Some(walls) = &mut self.walls {
            walls.follow(of_clusters);
        }
        self
    }

    /// Returns how walls of the body press each other, `None` where they do not.
    pub(crate) fn walls(&self) -> Option<&SelfContact> {
        self.walls.as_deref()
    }

    /// Returns the force (N) at which a tool's coupling saturates, infinite for a rigid tool.
    pub fn force_limit_n(&self, tool: usize) -> f64 {
        self.spring(tool).map_or(f64::INFINITY, |spring| spring.limit_n)
    }

    /// Returns the foundation under a tool, triangle by triangle; nothing for a tool that does not exist.
    pub fn foundation(&self, tool: usize) -> impl Iterator<Item = TriangleFoundation<'_>> {
        self.tools.get(tool).into_iter().flat_map(move |tool| {
            self.triangles.nodes.iter().enumerate().map(move |(triangle, &nodes)| {
                let TriangleSamples { weights, stiffness_n_per_m, rest_m2, .. } =
                    tool.foundation.of(triangle, &self.tables);
                TriangleFoundation { nodes, weights, stiffness_n_per_m, rest_m2 }
            })
        })
    }

    /// Returns the spring of a tool's coupling, `None` for a rigid tool.
    pub(crate) fn spring(&self, tool: usize) -> Option<SaturatingSpring> {
        self.tools[tool].spring()
    }

    /// Returns contact's part of the state while tools touch nothing.
    pub fn state(&self) -> ContactState {
        ContactState::new(self)
    }

    /// Returns a state read from a snapshot, in buffers of this model's size; `None` when it does not fit.
    pub(crate) fn adopt(&self, saved: &ContactState) -> Option<ContactState> {
        self.state().adopt(saved, |tool| self.tools[tool].foundation.samples)
    }

    /// Returns buffers large enough for every tick. Without `skip_distant` there is no broad phase.
    pub fn scratch(&self, skip_distant: bool) -> ContactScratch {
        let tool = |tool: &ToolModel| ToolScratch {
            next: Touching::with_capacity(tool.foundation.samples),
            sum: Pressed::default(),
            coupling_sum_n: DVec3::ZERO,
            coupling_sum_nm: DVec3::ZERO,
            nearest: 0,
            push: None,
        };
        let walls = self.walls.as_ref().map(|walls| walls.scratch()).unwrap_or_default();
        ContactScratch { tools: self.tools.iter().map(tool).collect(), exhaustive: !skip_distant, walls }
    }
}
