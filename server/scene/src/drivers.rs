//! What moves a tool.
use crate::path::MotionPath;
use glam::DQuat;
use palpate_physics::contact::ToolTarget;

/// What moves a tool.
#[derive(Debug, Clone, PartialEq)]
pub enum Driver {
    /// An arm over the network. Offline, the scene's [`ScriptedHand`] stands in for it when it names this tool.
    Device,
    /// Samples of a file.
    Trajectory(MotionPath),
    /// Keyframes of the scene.
    Script(MotionPath),
}

impl Driver {
    /// In an orientation (tool frame to world).
    pub(crate) fn turned(self, orientation: DQuat) -> Self {
        match self {
            Self::Device => Self::Device,
            Self::Trajectory(path) => Self::Trajectory(path.turned(orientation)),
            Self::Script(path) => Self::Script(path.turned(orientation)),
        }
    }

    /// Where the tool shall be at a time, `None` when a device decides. Does not allocate.
    pub fn target(&self, time_s: f64) -> Option<ToolTarget> {
        match self {
            Self::Device => None,
            Self::Trajectory(path) | Self::Script(path) => Some(path.at(time_s)),
        }
    }
}

/// The path that the hand on a simulated arm follows in this scene, and the tool that arm drives.
#[derive(Debug, Clone, PartialEq)]
pub struct ScriptedHand {
    /// Index of the tool.
    pub tool: usize,
    /// Its name.
    pub tool_name: String,
    /// Where the hand wants to be.
    pub path: MotionPath,
}
