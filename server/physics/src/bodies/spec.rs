//! What a body is built from, whichever kind it is.
use super::{BodySpec, hybrid::HybridSpec, mass_spring::MassSpringSpec, of_kind, seed::SeedBodySpec};
use crate::{elements::solid::Solid, tick::KindSpec};

impl BodySpec {
    /// A hybrid body, if it is one.
    pub fn as_hybrid(&self) -> Option<&HybridSpec> {
        if let Self::Hybrid(spec) = self { Some(spec) } else { None }
    }

    /// A mass-spring surface, if it is one.
    pub fn as_mass_spring(&self) -> Option<&MassSpringSpec> {
        if let Self::MassSpring(spec) = self { Some(spec) } else { None }
    }

    /// The papers' hybrid, if it is one.
    pub fn as_seed(&self) -> Option<&SeedBodySpec> {
        if let Self::Seed(spec) = self { Some(spec) } else { None }
    }

    /// The tets, of whatever level, with their materials, of kinds that have any.
    pub fn solid(&self) -> Option<&Solid> {
        of_kind!(BodySpec, self, spec => KindSpec::solid(spec))
    }

    /// The same, to be changed.
    pub fn solid_mut(&mut self) -> Option<&mut Solid> {
        of_kind!(BodySpec, self, spec => KindSpec::solid_mut(spec))
    }
}
