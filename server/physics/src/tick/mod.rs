//! What all kinds of body share in a tick: the surroundings, the inputs, the state that every kind has, and the
//! operations on lumped masses.
mod awake_for;
mod constraints;
mod environment;
mod error;
mod evaluation;
mod inputs;
mod judged;
mod kind;
mod ledger;
pub(crate) mod lumped;
pub(crate) mod lumped_evidence;
mod material_point;
pub(crate) mod progress;
mod rest_bound;
mod skin;
mod state;
mod substeps;

pub use awake_for::AwakeFor;
pub(crate) use constraints::free_inverse_mass;
pub use environment::{Environment, EnvironmentSpec};
pub use error::EnvironmentError;
pub(crate) use evaluation::{Evaluation, LoadRamp, Tick, touch_nodes};
pub use inputs::{PointForce, TickInput};
pub(crate) use inputs::{PrescribedNodes, take_prescribed, take_tools};
pub(crate) use judged::{Judged, StepEvidence, StepForcesNow};
pub(crate) use kind::{BodyKind, KindSpec, KindState, Stepped};
pub use ledger::{Energies, Ledger, ViscousPower};
pub use material_point::MaterialPoint;
pub(crate) use rest_bound::{NaturalBand, NodeMasses, RestBound};
pub(crate) use skin::{CarriedSkin, ListedVertices, Touch, any_tool_is_near, touch_skin};
pub use state::MechanicalState;
pub(crate) use substeps::{Frequencies, Steps, StifferContact, damping_growth, relaxation_time_s, stiffening};
