//! A body of tetrahedra throughout.
mod body;
mod damping;
mod error;
mod judged;
mod kind;
mod modes;
mod spec;
mod stepped;
pub(crate) mod stiffness;

pub use body::TetBody;
pub use error::TetBodyError;
pub use kind::TetState;
pub use modes::natural_modes;
pub use spec::{TetElements, TetSpec};
pub(crate) use stepped::{SteppedTet, TetScratch};
