//! The problems every method is judged by: what is done to which body, and how the answer is read.
//!
//! - `registry.rs`: all of them, by name
//! - `body.rs`: their bodies in tetrahedra, at any resolution, and where a tool first touches them
//! - `motion.rs`: how the action comes in time
//! - `place.rs`: where the ventricle is touched
//! - `load.rs`: loads as nodal forces on any mesh, and the displacement that is conjugate to them
//! - `sample.rs`: the material points at which displacement fields are compared
//! - `exact.rs`: answers by formula
pub mod body;
pub mod exact;
pub mod load;
pub mod motion;
pub mod place;
mod registry;
pub mod sample;

use body::Body;
use miette::Result;
pub use motion::Motion;
use palpate_physics::material::{Law, Material};
pub use registry::{OF_PEERS, all};

/// What is done to a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Action {
    /// A rigid sphere without friction is pressed in, along the line of its touch.
    Sphere {
        /// Radius (m).
        radius_m: f64,
        /// Its way (m) past first touch.
        depth_m: f64,
    },
    /// A smooth dead load, normal to the rest surface, `p(r) = p₀ (1 − r²/a²)²` in the distance `r` from the line of the touch.
    Patch {
        /// Its radius `a` (m).
        radius_m: f64,
        /// Its sum along the line of the touch (N), `π a² p₀ / 3`.
        force_n: f64,
    },
    /// Dead pressure (Pa) on the touched surface.
    Pressure {
        /// Pressure (Pa).
        pressure_pa: f64,
    },
    /// A dead force (N) along +z, spread evenly over the touched surface.
    Shear {
        /// Force (N).
        force_n: f64,
    },
}

/// What the answer of a problem is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// The body's force on the tool along the outward normal (N).
    Force,
    /// The displacement conjugate to the load: its work over its sum (m).
    Displacement,
}

impl Quantity {
    /// Its unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Force => "N",
            Self::Displacement => "m",
        }
    }
}

/// A problem.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// Its name, from which a reader can guess it.
    pub name: String,
    /// What happens, in a sentence.
    pub sentence: String,
    /// To which body.
    pub body: Body,
    /// What is done.
    pub action: Action,
    /// When.
    pub motion: Motion,
    /// By which law the body answers.
    pub law: Law,
    /// Young's modulus (Pa).
    pub young_modulus_pa: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
}

impl Problem {
    /// Its material.
    ///
    /// # Errors
    /// Impossible constants.
    pub fn material(&self) -> Result<Material> {
        crate::bodies::material(self.law, self.young_modulus_pa, self.poisson_ratio)
    }

    /// What its answer is.
    pub fn quantity(&self) -> Quantity {
        match self.action {
            Action::Sphere { .. } => Quantity::Force,
            Action::Patch { .. } | Action::Pressure { .. } | Action::Shear { .. } => Quantity::Displacement,
        }
    }

    /// Radius (m) of what presses it, about which reference grids are graded.
    pub fn contact_radius_m(&self) -> f64 {
        match self.action {
            Action::Sphere { radius_m, depth_m } => (radius_m * depth_m).sqrt(),
            Action::Patch { radius_m, .. } => radius_m,
            Action::Pressure { .. } | Action::Shear { .. } => 0.0,
        }
    }
}
