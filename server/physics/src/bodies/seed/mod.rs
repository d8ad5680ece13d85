//! The seeds' hybrid body, as its authors describe it (Mero & Susín 2005, 2006): a coarse FEM core, a layer of
//! particles around it of which those under the touched point are awake, and a surface on spring links. It is kept as a
//! benchmark and for its history; the hybrid body of Palpate is another one (`crate::bodies::hybrid`).
//! `docs/theory/seed-hybrid.md` tells what the papers leave open or get wrong.
//!
//! | step of the papers | equations, section | file |
//! |---|---|---|
//! | parameters and what holds between them | tables 1; 2005: 14 | `spec.rs` |
//! | core: tets, stress, semi-implicit scheme | 4–11, 15–22, 34 | `core.rs` |
//! | projection towards the mass centre | 6 | `radial.rs` |
//! | layer: filling, volumes, masses | 25; 6 | `layer.rs`, `voxels.rs` |
//! | the particles' weight | 24, 25 | `kernel.rs` |
//! | strain, stress and force of particles | 25, 29; 2005: 13 | `sph.rs` |
//! | region RV(ps), its voxels, gradient field, interface force (the papers' border) | 6, 6.1 | `region.rs` |
//! | exchange between particles and core | 6.1 | `exchange.rs` |
//! | links of the outer surface | 6.1 | `links.rs` |
//! | the step Δt, Verlet | 33 | `step.rs`, `state.rs` |
//! | as a body of the loop: tools press it | | `body.rs`, `stepped.rs` |
//!
//! | what cannot work as printed | smallest repair | where |
//! |---|---|---|
//! | eqs. 22, 6: sign of +∂U/∂x | − | `core.rs` |
//! | eq. 24 is no weight | cone: tangent at its zero, cut, normalised; R = 2h | `kernel.rs` |
//! | eq. 25 differentiated strains what only moves | differences to particle i | `sph.rs` |
//! | eq. 4 on positions strains what rests | displacements, as eqs. 1 and 5 have them | `sph.rs` |
//! | eq. 13 of 2005: sign | gradient at i | `sph.rs` |
//! | eq. 29: the neighbour's stress alone; flutters | both particles' stress | `sph.rs` |
//! | interface force towards the nearest interface voxel; pumps energy | towards the particle's own | `region.rs` |
//! | eq. 27's mass matrix has no place in eq. 33 | m = ρV/N | `layer.rs` |
//! | exchange "from conservation of linear momentum" moves without masses | impulses | `exchange.rs` |
//! | eq. 25 on the surface: weights sum to ½ | divided by their sum | `region.rs` |
//! | no mass, stiffness or damping of links | from the layer | `links.rs` |
//! | particles woken at rest under a core that moved | start with the core | `step.rs` |
mod body;
mod body_state;
pub mod core;
mod error;
pub mod exchange;
pub mod kernel;
mod kind;
pub mod layer;
pub mod links;
mod model;
mod numbering;
pub mod radial;
pub mod region;
mod spec;
pub mod sph;
mod state;
mod step;
mod stepped;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;
pub mod voxels;

pub use body::{SeedBody, SeedBodySpec};
pub use body_state::SeedBodyState;
pub use error::SeedError;
pub use model::SeedModel;
pub use spec::{
    Exchange, InterfaceForce, LayerSpec, PARTICLES, PairStress, PaperModel, SHELL_TETS, SeedParameters, SeedSpec,
    VENTRICLE_TETS,
};
pub use state::{AtVertex, Motion, SeedContact, SeedReport, SeedScratch, SeedState};
pub(crate) use stepped::{SeedBodyScratch, SteppedSeed};
