//! [`Model`] (constant after load), [`State`] (what a tick changes) and [`Scratch`] (buffers, no meaning between ticks).
mod building;
mod check;
mod error;
mod model;
mod seed_body;
mod spec;
mod springs_body;
mod state;
mod substeps;
mod tick;

pub use error::ModelError;
pub use model::Model;
pub use spec::{ModelSpec, Region};

pub use state::State;
pub(crate) use state::with_room;
pub(crate) use substeps::relaxation_time_s;
pub use tick::{PointForce, Scratch, StepReport, TickInput};
