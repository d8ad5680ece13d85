//! The kinds of body, behind one enum: what each of them answers.
//!
//! A kind has its own folder: what it is made from, what its rest state fixes, what a tick changes of it beside
//! [`crate::tick::MechanicalState`], its buffers, and how it is stepped. No kind knows another, nor this file.
mod chained;
pub mod hybrid;
pub mod mass_spring;
mod material_point;
pub mod seed;
mod spec;
mod state;
mod stepped;
pub mod tet;

pub use material_point::MaterialPoint;
pub use spec::{BodyError, BodySpec};
pub(crate) use state::BodyScratch;
pub use state::BodyState;
pub(crate) use stepped::SteppedBody;

use crate::{
    elements::{linear_tet::min_volume_ratio, solid::Solid},
    hash::{FirstNames, Fnv},
    mesh::TetMesh,
    tick::{Energies, Environment, EnvironmentSpec, MechanicalState},
};
use glam::DVec3;
use hybrid::HybridBody;
use mass_spring::MassSpringBody;
use seed::SeedBody;
use std::fmt::Write;
use tet::TetBody;

/// A body: all that its rest state fixes. Constant after load.
#[derive(Debug, Clone)]
pub enum Body {
    /// Linear tetrahedra throughout.
    Tet(Box<TetBody>),
    /// Coarse tetrahedra throughout, and particles of which those near a contact are awake.
    Hybrid(Box<HybridBody>),
    /// A surface of masses on springs, refined where it is touched.
    MassSpring(Box<MassSpringBody>),
    /// The papers' own hybrid.
    Seed(Box<SeedBody>),
}

/// The smallest `J = det F` of a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VolumeRatio {
    /// `J`; below zero: inverted.
    pub ratio: f64,
    /// Where it is: a tet's number, of a hybrid body a coarse tet's.
    pub tet: usize,
}

impl Body {
    /// Builds a body in its environment; `progress` is told the part done of what takes long.
    ///
    /// # Errors
    /// The kind's own error.
    pub(crate) fn build(
        spec: BodySpec,
        around: EnvironmentSpec,
        progress: &mut dyn FnMut(f64),
    ) -> Result<(Self, Environment), BodyError> {
        Ok(match spec {
            BodySpec::Tet(solid) => {
                let (body, environment) = TetBody::build(solid, around, progress)?;
                (Self::Tet(Box::new(body)), environment)
            }
            BodySpec::Hybrid(spec) => {
                let (body, environment) = HybridBody::build(spec, around, progress)?;
                (Self::Hybrid(Box::new(body)), environment)
            }
            BodySpec::MassSpring(spec) => {
                let (body, environment) = MassSpringBody::build(spec, around)?;
                (Self::MassSpring(Box::new(body)), environment)
            }
            BodySpec::Seed(spec) => {
                let (body, environment) = SeedBody::build(spec, around)?;
                (Self::Seed(Box::new(body)), environment)
            }
        })
    }

    /// The body of tetrahedra, if it is one.
    pub fn as_tet(&self) -> Option<&TetBody> {
        if let Self::Tet(body) = self { Some(body) } else { None }
    }

    /// The hybrid body, if it is one.
    pub fn as_hybrid(&self) -> Option<&HybridBody> {
        if let Self::Hybrid(body) = self { Some(body) } else { None }
    }

    /// The mass-spring surface, if it is one.
    pub fn as_mass_spring(&self) -> Option<&MassSpringBody> {
        if let Self::MassSpring(body) = self { Some(body) } else { None }
    }

    /// The papers' hybrid, if it is one.
    pub fn as_seed(&self) -> Option<&SeedBody> {
        if let Self::Seed(body) = self { Some(body) } else { None }
    }

    /// Its tetrahedra at rest: all there are, the coarse level's, or the core's; none of a surface of springs.
    pub fn tets(&self) -> Option<&TetMesh> {
        match self {
            Self::Tet(body) => Some(body.mesh()),
            Self::Hybrid(body) => Some(body.coarse()),
            Self::MassSpring(_) => None,
            Self::Seed(body) => Some(body.mesh()),
        }
    }

    /// The tets that fill it by themselves; none of a body with particles, or of springs.
    pub fn filling_tets(&self) -> Option<&Solid> {
        match self {
            Self::Tet(body) => Some(body.solid()),
            Self::Seed(body) if body.model().layer().is_none() => Some(body.core()),
            Self::Hybrid(_) | Self::MassSpring(_) | Self::Seed(_) => None,
        }
    }

    /// Rest positions (m) of the nodes that masses and constraints are of: of tets, of a coarse level with its edges' middles, of coarse
    /// vertices, of a core and then its skin.
    pub fn rest_positions_m(&self) -> &[DVec3] {
        match self {
            Self::Tet(body) => body.rest_positions_m(),
            Self::Hybrid(body) => body.rest_positions_m(),
            Self::MassSpring(body) => body.rest_positions_m(),
            Self::Seed(body) => body.rest_positions_m(),
        }
    }

    /// Rest positions (m) of what the surface's nodes are numbered by.
    pub fn surface_rest_positions_m(&self) -> &[DVec3] {
        match self {
            Self::Tet(body) => body.rest_positions_m(),
            Self::Hybrid(body) => body.skin_rest_m(),
            Self::MassSpring(body) => body.model().rest_m(),
            Self::Seed(body) => body.rest_positions_m(),
        }
    }

    /// Lumped mass (kg) of every node of [`Self::rest_positions_m`].
    pub fn mass_kg(&self) -> &[f64] {
        match self {
            Self::Tet(body) => body.mass_kg(),
            Self::Hybrid(body) => &body.masses().node_kg,
            Self::MassSpring(body) => &body.model().spec().mass_kg,
            Self::Seed(body) => body.mass_kg(),
        }
    }

    /// Largest natural frequency (rad/s) at rest.
    pub fn max_natural_frequency_rad_per_s(&self) -> f64 {
        match self {
            Self::Tet(body) => body.max_natural_frequency_rad_per_s(),
            Self::Hybrid(body) => body.max_natural_frequency_rad_per_s(),
            Self::MassSpring(body) => body.model().frequency_rad_per_s(),
            Self::Seed(body) => body.max_natural_frequency_rad_per_s(),
        }
    }

    /// Particles, awake or not.
    pub fn particle_count(&self) -> usize {
        match self {
            Self::Hybrid(body) => body.partition().particle_count(),
            Self::Seed(body) => body.model().layer().map_or(0, seed::layer::Layer::particle_count),
            Self::Tet(_) | Self::MassSpring(_) => 0,
        }
    }

    /// Most particles awake at once.
    pub fn most_awake_particles(&self) -> usize {
        match self {
            Self::Hybrid(body) => body.particles().most_active,
            Self::Seed(body) => body.model().most_awake(),
            Self::Tet(_) | Self::MassSpring(_) => 0,
        }
    }

    /// How far particles are apart (m); 0 where there are none.
    pub fn particle_spacing_m(&self) -> f64 {
        match self {
            Self::Hybrid(body) => body.particles().spacing_m,
            Self::Seed(body) => body.model().layer().map_or(0.0, |layer| layer.voxels.spacing_m),
            Self::Tet(_) | Self::MassSpring(_) => 0.0,
        }
    }

    /// The most positions that a state of it ever has.
    pub(crate) fn most_positions(&self) -> usize {
        match self {
            Self::Tet(body) => body.rest_positions_m().len(),
            Self::Hybrid(body) => body.most_positions(),
            Self::MassSpring(body) => body.model().most_nodes(),
            Self::Seed(body) => body.rest_positions_m().len(),
        }
    }

    /// Whether leapfrog's step of it can be judged ([`SteppedBody::judged`]).
    pub(crate) fn can_be_judged(&self) -> bool {
        matches!(self, Self::Tet(_) | Self::Hybrid(_))
    }

    /// Writes where each vertex of the surface is (m). Of a hybrid body, each is worked out from some particles.
    pub(crate) fn surface_positions_m(
        &self,
        environment: &Environment,
        own: &BodyState,
        state: &MechanicalState,
        positions_m: &mut Vec<DVec3>,
    ) {
        positions_m.clear();
        let vertices = 0..environment.surface.nodes.len() as u32;
        match (self, own) {
            (Self::Hybrid(body), BodyState::Hybrid(own)) => {
                positions_m.extend(vertices.map(|vertex| body.vertex_m(vertex, own.ids(), &state.x)));
            }
            (Self::MassSpring(body), BodyState::MassSpring(own)) => {
                positions_m.extend(vertices.map(|vertex| body.vertex_m(&own.motion, vertex, &state.x)));
            }
            _ => positions_m.extend(environment.surface.nodes.iter().map(|&node| state.x[node as usize])),
        }
    }

    /// What the body holds now, beside the ledger's work and dissipation.
    pub(crate) fn energies(&self, gravity_m_per_s2: DVec3, own: &BodyState, state: &MechanicalState) -> Energies {
        match (self, own) {
            (Self::Tet(body), _) => body.energies(gravity_m_per_s2, state),
            (Self::Hybrid(body), BodyState::Hybrid(own)) => body.energies(gravity_m_per_s2, own, state),
            (Self::MassSpring(body), BodyState::MassSpring(own)) => body.energies(gravity_m_per_s2, own, state),
            (Self::Seed(body), BodyState::Seed(own)) => body.energies(own, state),
            _ => Energies::NAN,
        }
    }

    /// The smallest `J = det F` over all tets; of a hybrid body, over the coarse tets' means and the awake cells. A surface of springs has
    /// none.
    pub(crate) fn min_volume_ratio(&self, own: &BodyState, x: &[DVec3]) -> Option<VolumeRatio> {
        let (ratio, tet) = match (self, own) {
            (Self::Tet(body), _) => min_volume_ratio(body.mesh(), body.rest_tets(), x),
            (Self::Hybrid(body), BodyState::Hybrid(own)) => body.min_volume_ratio(own, x),
            (Self::Seed(body), _) => min_volume_ratio(body.mesh(), body.model().core().rest_tets(), x),
            _ => return None,
        };
        Some(VolumeRatio { ratio, tet })
    }

    /// Writes what it was built from into a hash, so that a state goes back only into the body it came from.
    pub(crate) fn fingerprint_into(&self, hash: &mut Fnv) {
        // A float prints as the shortest text that reads back to its bits. Writing to the hash cannot fail.
        let _ = match self {
            Self::Tet(body) => write!(hash, "tet {:?}", body.solid()),
            Self::Hybrid(body) => write!(hash, "hybrid {:?}", (body.coarse(), body.materials(), body.particles())),
            Self::MassSpring(body) => write!(hash, "mass-spring {}", body.fingerprint()),
            Self::Seed(body) => write!(FirstNames(hash), "seed {:?}", body.spec()),
        };
    }
}
