//! Mass-spring surfaces, refined where they are touched (haptic-subdivision).
//!
//! Masses sit at the vertices of a triangle surface. Mesh springs lie along its edges, and an anchor spring pulls every
//! vertex to its rest position:
//! ```text
//! f_i = −K_d v_i − K_h g(|u_i|) u_i/|u_i| + K_m Σ_j (|l_ij| − r_ij) l_ij/|l_ij| + f_i^ext,   u_i = x_i − X_i,  l_ij = x_j − x_i
//! ```
//! In the paper `g(u) = u`; [`anchor`] has other laws. (The paper's eq. 2 prints the vector `l_ij − r_ij` for the
//! spring's lengthening, which can only be meant as above.)
//!
//! *Refining* splits each triangle of a region in four by Loop's scheme. A vertex of the refined surface is of *type 1*
//! when it belongs to a vertex of the coarse surface, and of *type 2* when it belongs to an edge of it.
pub mod anchor;
pub mod around;
pub mod blend;
pub mod body;
mod build;
pub mod calibration;
#[cfg(test)]
mod checks;
pub mod constants_table;
pub mod energy;
pub mod equilibrium;
mod judged;
pub mod kernels;
mod kind;
pub mod loop_scheme;
pub mod matching;
pub mod model;
pub mod motion;
pub mod net;
pub mod places;
mod preparing;
pub mod region;
pub mod running;
pub(crate) mod skin;
pub(crate) mod state;
mod stepped;
#[cfg(test)]
pub(crate) mod testing;

use crate::mesh::triangulation;

pub use anchor::{AnchorLaw, AnchorLawError};
pub use body::{MassSpringBody, MassSpringError, MassSpringSpec, Refinement, Refining};
pub use kernels::{HalfSpring, SpringRows};
pub use model::{SpringError, SpringModel, SpringSpec};
pub use motion::{AwakeNodes, Changed, SpringMotion, SpringScratch, Wanted};
pub use net::{Net, Spring};
pub(crate) use preparing::MassSpringScratch;
pub use region::{Refined, Region};
pub use state::MassSpringState;
pub(crate) use stepped::SteppedMassSpring;
