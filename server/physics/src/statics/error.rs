//! Why there is no equilibrium to show.
use super::load_path;
use crate::{
    elements::natural_modes::ModesError,
    elements::rigid_motion::{self, FreePart, RigidMotion},
    linalg::CholeskyError,
};
use thiserror::Error;

/// Why there is no equilibrium to show.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SolveError {
    /// A kind of body that this solver does not know.
    #[error("{what} is known of bodies of tetrahedra{but}: run the scene in time until it is at rest")]
    NotForThisBody {
        /// What is asked for.
        what: &'static str,
        /// What other bodies it is known of.
        but: &'static str,
    },
    /// Arguments of the wrong number.
    #[error("{what}: {found} given, the model has {expected}")]
    InputLength {
        /// What was counted.
        what: &'static str,
        /// Given.
        found: usize,
        /// Wanted.
        expected: usize,
    },
    /// Arguments that are not finite.
    #[error("{what} {index} is not finite")]
    InputNotFinite {
        /// What it is.
        what: &'static str,
        /// Which one.
        index: usize,
    },
    /// A setting outside its range.
    #[error("{name} = {value}: {rule}")]
    Setting {
        /// Name.
        name: &'static str,
        /// Value.
        value: f64,
        /// What it must satisfy.
        rule: &'static str,
    },
    /// Rigid motions are left free.
    #[error(
        "the body (the part with node {node}) is free to {}; prescribe displacements that hold it",
        rigid_motion::list(motions)
    )]
    UnderConstrained {
        /// A node of the part that is free.
        node: u32,
        /// Its free motions.
        motions: Vec<RigidMotion>,
    },
    /// Newton's method failed at the smallest load step.
    #[error(
        "no equilibrium found beyond {:.4} % of the load: relative residual {relative_residual:.2e} after {iterations} \
         iterations; {hint}", 100.0 * reached_fraction
    )]
    NoConvergence {
        /// Load fraction of the last equilibrium.
        reached_fraction: f64,
        /// Load fraction that failed.
        failed_fraction: f64,
        /// Relative residual it ended with.
        relative_residual: f64,
        /// Iterations in all.
        iterations: u32,
        /// What may help.
        hint: &'static str,
    },
    /// The load was raised in as many steps as are allowed, and is not reached.
    #[error("only {:.4} % of the load reached after {} load steps, of which {failed} failed", 100.0 * reached_fraction, load_path::MAX_LOAD_STEPS)]
    TooManySteps {
        /// Load fraction of the last equilibrium.
        reached_fraction: f64,
        /// Load steps that failed.
        failed: u32,
    },
    /// A capsule turns until it is in equilibrium, and this solver knows no turning.
    #[error(
        "tool \"{tool}\" is a capsule, and static equilibrium is known of spheres only: run the scene in time until it is at rest"
    )]
    SpheresOnly {
        /// Name of the tool.
        tool: String,
    },
    /// A tool's way is longer than the allowed load steps can take it.
    #[error(
        "tool \"{tool}\" starts {distance_m} m from where it is to be, more than {:.0} of its radii ({radius_m} m)",
        0.5 * f64::from(load_path::MAX_LOAD_STEPS)
    )]
    ToolTooFar {
        /// Name of the tool.
        tool: String,
        /// Its device's way (m).
        distance_m: f64,
        /// Its radius (m).
        radius_m: f64,
    },
    /// Forces at a finite position are not finite.
    #[error("the force on node {node} is not finite at {:.4} % of the load; are the loads or constants too large?", 100.0 * load_fraction)]
    NonFinite {
        /// The node.
        node: u32,
        /// Load fraction.
        load_fraction: f64,
    },
    /// The factorisation ran out of memory or indices.
    #[error("the sparse factorisation of {unknowns} unknowns failed: {reason}")]
    Factorisation {
        /// Size of the system.
        unknowns: usize,
        /// What the library says.
        reason: String,
    },
    /// The caller stopped it.
    #[error("stopped at {:.4} % of the load", 100.0 * load_fraction)]
    Cancelled {
        /// Load fraction being solved.
        load_fraction: f64,
    },
}

impl From<FreePart> for SolveError {
    fn from(FreePart { node, motions }: FreePart) -> Self {
        Self::UnderConstrained { node, motions }
    }
}

impl From<CholeskyError> for SolveError {
    fn from(CholeskyError { unknowns, reason }: CholeskyError) -> Self {
        Self::Factorisation { unknowns, reason }
    }
}

impl From<ModesError> for SolveError {
    fn from(error: ModesError) -> Self {
        match error {
            ModesError::UnderConstrained(part) => part.into(),
            ModesError::Factorisation(error) => error.into(),
            ModesError::NoConvergence { relative_residual, iterations } => Self::NoConvergence {
                reached_fraction: 0.0,
                failed_fraction: 0.0,
                relative_residual,
                iterations,
                hint: "the subspace iteration did not settle; ask for one mode more or fewer, a pair may be cut in two",
            },
        }
    }
}
