//! [`Model`] (which does not change after it is loaded), [`State`] (what a tick changes), [`Scratch`] (buffers without
//! a meaning between ticks), and [`step`].
mod by_hand;
mod chained;
mod energies;
mod error;
mod model;
mod quarantine;
mod rollback;
mod scratch;
mod sleep;
mod spec;
mod state;
mod step;
mod strained;

pub use by_hand::{refine_only, wake_only};
pub use energies::{elastic_energy_j, meeting_walls};
pub use error::ModelError;
pub use model::Model;
pub use quarantine::{Quarantine, first_non_finite};
pub use scratch::Scratch;
pub use sleep::Sleep;
pub use spec::ModelSpec;
pub use state::State;
pub use step::{StepReport, step};
pub use strained::{min_volume_ratio, strained, strained_in};
