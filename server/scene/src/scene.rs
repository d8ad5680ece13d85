//! A loaded scene: everything a run needs, checked.
use crate::{
    drivers::{Driver, ScriptedHand},
    probes::Probe,
    timeline::Timeline,
};
use palpate_physics::{
    ModelSpec,
    bodies::mass_spring::region::Constants,
    mesh::{Triangulation, quality::Quality},
};
use std::path::PathBuf;

/// A loaded scene.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Name.
    pub name: String,
    /// What it shows, for people.
    pub description: String,
    /// What the model is built from.
    pub model: ModelSpec,
    /// Loads and prescribed motions over time.
    pub timeline: Timeline,
    /// One per tool.
    pub drivers: Vec<Driver>,
    /// What it measures.
    pub probes: Vec<Probe>,
    /// Length and intervals of a run.
    pub output: OutputSettings,
    /// What the hand on the simulated arm does in this scene.
    pub arm: Option<ScriptedHand>,
    /// Remarks that are no errors.
    pub warnings: Vec<String>,
    /// What the body is like.
    pub summary: BodySummary,
}

impl Scene {
    /// Where a tool shall be at a time when no arm is attached: its driver's target, else that of the scene's scripted
    /// hand, else its start. Does not allocate.
    pub fn offline_target(&self, tool: usize, time_s: f64) -> palpate_physics::contact::ToolTarget {
        let scripted = || self.arm.as_ref().filter(|arm| arm.tool == tool).map(|arm| arm.path.at(time_s));
        let at_start = || self.model.tools[tool].start();
        self.drivers[tool].target(time_s).or_else(scripted).unwrap_or_else(at_start)
    }
}

/// Length and intervals of an offline run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutputSettings {
    /// Simulated time (s).
    pub duration_s: f64,
    /// Time between two rows of probes (s).
    pub sample_interval_s: f64,
    /// Time between two frames (s).
    pub frame_interval_s: f64,
}

/// What a body is like.
#[derive(Debug, Clone, PartialEq)]
pub struct BodySummary {
    /// Where it comes from: shape, file, or surfaces.
    pub origin: String,
    /// Nodes.
    pub nodes: usize,
    /// Tetrahedra.
    pub tets: usize,
    /// Boundary triangles.
    pub surface_triangles: usize,
    /// Rest volume (m³).
    pub volume_m3: f64,
    /// Mass (kg).
    pub mass_kg: f64,
    /// Shape of the tets, where there are any.
    pub quality: Option<Quality>,
    /// What the filler did, one remark a line: repairs, layers, quality.
    pub fill_report: Vec<String>,
    /// Named parts that regions can refer to: nodes, surface triangles and tets of each.
    pub parts: Vec<PartSummary>,
}

/// A named part of a body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PartSummary {
    /// Name.
    pub name: String,
    /// Nodes in it.
    pub nodes: usize,
    /// Surface triangles in it.
    pub triangles: usize,
    /// Tets in it.
    pub tets: usize,
}

/// What a table of spring constants is made from.
#[derive(Debug, Clone)]
pub struct ToCalibrate {
    /// The coarse surface.
    pub surface: Triangulation,
    /// Its springs.
    pub coarse: Constants,
    /// Rings refined.
    pub rings: u32,
    /// Where the scene looks for the table.
    pub table: PathBuf,
}
