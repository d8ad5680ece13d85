//! Which kind of body a document describes.
use crate::document::body::BodyTable;
use palpate_physics::Settings;

/// The kinds of body that a document can describe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Tetrahedra throughout.
    Tet,
    /// Coarse tetrahedra, and particles near the surface.
    Hybrid,
    /// A surface of masses on springs.
    MassSpring,
    /// The papers' own hybrid.
    Seed,
}

impl Kind {
    /// By the tables that `[body]` has.
    pub(crate) fn of(body: &BodyTable) -> Self {
        match body {
            BodyTable { springs: Some(_), .. } => Self::MassSpring,
            BodyTable { seed: Some(_), .. } => Self::Seed,
            BodyTable { particles: Some(_), .. } => Self::Hybrid,
            _ => Self::Tet,
        }
    }

    /// Numerical settings where the document is silent.
    pub(crate) fn default_settings(self) -> Settings {
        match self {
            Self::Hybrid => Settings::for_particles(),
            Self::Tet | Self::MassSpring | Self::Seed => Settings::default(),
        }
    }
}
