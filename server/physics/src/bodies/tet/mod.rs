//! A body of tetrahedra throughout.
mod body;
mod error;
mod judged;
mod kind;
mod modes;
mod rest_bound;
mod spec;
mod stepped;
pub(crate) mod stiffness;

pub use body::TetBody;
pub use error::TetBodyError;
pub use kind::TetState;
pub use modes::{Mode, ModesError, natural_modes};
pub(crate) use rest_bound::RestBound;
pub use spec::{TetElements, TetSpec};
pub(crate) use stepped::{SteppedTet, TetScratch};
