//! Scene files and meshes become physics: a TOML document is read, checked with messages a user can act on, and
//! compiled to a [`palpate_physics::ModelSpec`] with its loads over time, tool drivers and probes.
//!
//! The format is described in `docs/scenes.md`; its JSON schema is [`json_schema`].

pub mod builtin;
mod compile;
mod document;
pub mod drivers;
pub mod error;
pub mod files;
pub mod fill;
mod limits;
mod load;
pub mod path;
mod places;
pub mod probes;
pub mod scene;
pub mod shapes;
mod skin;
pub mod timeline;
pub mod wording;

pub use builtin::{builtin, builtin_names, load_builtin};
pub use drivers::{Driver, ScriptedHand};
pub use error::{SceneError, Stage};
pub use limits::Limits;
pub use load::{json_schema, load_file, parse, to_calibrate};
pub use path::{Interpolation, MotionPath};
pub use probes::Probe;
pub use scene::{BodySummary, OutputSettings, PartSummary, Scene, ToCalibrate};
pub use timeline::{Amplitude, PrescribedMotion, Timeline};
