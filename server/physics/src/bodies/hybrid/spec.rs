//! The specification of a hybrid body.
use super::skin::Skin;
use crate::{
    elements::solid::{Solid, SolidError},
    mesh::MeshError,
    tick::EnvironmentError,
};
use glam::DVec3;
use std::{f64::consts::PI, fmt};
use thiserror::Error;

/// More cells than this in the lattice's box are refused: their numbers have to fit an index, and they take memory.
pub const MOST_CELLS: f64 = 5e8;
/// More active particles than this are refused.
pub const MOST_ACTIVE: usize = 20_000;

/// What a hybrid body is made from.
#[derive(Debug, Clone, PartialEq)]
pub struct HybridSpec {
    /// The coarse level. It covers the whole body.
    pub coarse: Solid,
    /// The particles. Their skin is the body's surface: loads are at the skin's vertices and triangles.
    pub particles: ParticleSpec,
}

/// The particles of a hybrid body.
#[derive(Clone, PartialEq)]
pub struct ParticleSpec {
    /// The body's surface at rest, which bounds its volume, is touched by tools and seen by viewers. It should be as
    /// fine as the lattice, or finer.
    pub skin: Skin,
    /// Spacing h (m) of the lattice.
    pub spacing_m: f64,
    /// Thickness (m) of the layer of cells of this spacing at the surface; it has as many cells as begin within this
    /// depth, and at least one. Deeper down blocks of eight are merged into cells of twice the spacing (`sizes`); with
    /// `None` no cells are merged.
    pub fine_depth_m: Option<f64>,
    /// Whether the skin follows a mean of the particles around each of its vertices, not those of one cell alone, and tools press it
    /// through a softer foundation: so they do not feel single particles ([`super::skin_carriers`]).
    pub smooth_skin: bool,
    /// A point (m) that planes of the lattice pass through; best on a surface that is held, so that no cell reaches
    /// past it.
    pub lattice_through_m: DVec3,
    /// Largest number of particles that are active at once.
    pub most_active: usize,
    /// What wakes particles.
    pub waking: Waking,
}

/// A body's fingerprint is made of this text; bodies without a smooth skin keep the one that they had before there were any.
impl fmt::Debug for ParticleSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { skin, spacing_m, fine_depth_m, smooth_skin, lattice_through_m, most_active, waking } = self;
        let mut text = f.debug_struct("ParticleSpec");
        text.field("skin", skin).field("spacing_m", spacing_m).field("fine_depth_m", fine_depth_m);
        if *smooth_skin {
            text.field("smooth_skin", smooth_skin);
        }
        text.field("lattice_through_m", lattice_through_m).field("most_active", most_active);
        text.field("waking", waking).finish()
    }
}

/// What wakes particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Waking {
    /// They wake by nothing but [`crate::world::wake_only`].
    ByHand,
    /// Tools near the skin wake those within `reach_m` (m, at rest) of where it is touched or about to be.
    ByTools {
        /// Radius (m) at rest.
        reach_m: f64,
    },
}

impl Waking {
    /// Lets tools wake what is within the radius r (m) of the half ball, as at a flat surface, that holds `most_active` particles: one in
    /// every h³ of a lattice with spacing h (m), or, in a lattice of two sizes, one in every h³ in the layers of fine ones, d thick, and one
    /// in every 8 h³ below,
    /// ```text
    /// n h³ = ⅔ π r³      n h³ = ⅛ (2π/3) r³ + ⅞ π d (r² − d²/3),  d ≤ r
    /// ```
    pub fn in_half_ball(spacing_m: f64, fine_depth_m: Option<f64>, most_active: usize) -> Self {
        let count = most_active as f64;
        let Some(depth_m) = fine_depth_m else {
            return Self::ByTools { reach_m: spacing_m * (count * 6.0 / (4.0 * PI)).cbrt() };
        };
        let depth_m = fine_layers(depth_m, spacing_m) as f64 * spacing_m;
        let all_m3 = count * spacing_m.powi(3);
        let held_m3 = |r: f64| {
            let d = depth_m.min(r);
            PI * (r.powi(3) / 12.0 + 7.0 / 8.0 * d * (r * r - d * d / 3.0))
        };
        // It is the largest where all are 8 h³ apart.
        let (mut low, mut high) = (0.0, (all_m3 * 12.0 / PI).cbrt());
        for _ in 0..60 {
            let middle = f64::midpoint(low, high);
            *(if held_m3(middle) < all_m3 { &mut low } else { &mut high }) = middle;
        }
        Self::ByTools { reach_m: f64::midpoint(low, high) }
    }
}

/// Why particles cannot be made.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum HybridError {
    /// The coarse level is refused.
    #[error(transparent)]
    Solid(#[from] SolidError),
    /// Settings, constraints, loads or tools are refused.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    /// A number is outside its range.
    #[error("{name} = {value}: {rule}")]
    Setting {
        /// Name.
        name: &'static str,
        /// Value.
        value: f64,
        /// What it must satisfy.
        rule: &'static str,
    },
    /// The lattice is too fine for the body.
    #[error(
        "a lattice of {spacing_m} m over this body has {cells:.1e} cells, more than {MOST_CELLS:.0e}; \
         take a larger spacing"
    )]
    TooMany {
        /// Spacing (m).
        spacing_m: f64,
        /// Cells in its box.
        cells: f64,
    },
    /// The lattice is too coarse for the body.
    #[error("no cell of a lattice of {spacing_m} m holds any of the body; take a smaller spacing")]
    Nothing {
        /// Spacing (m).
        spacing_m: f64,
    },
    /// Particles do not see all motions of the coarse level.
    #[error(
        "the coarse tets are too small beside the particles of [body.particles], which are {spacing_mm:.2} mm apart: {nodes} coarse nodes \
         (corners of tets and middles of their edges, which are {edge_mm:.2} mm long in the mean) are followed by {particles} particles, so that \
         they can move in ways that no particle feels, and do once particles wake; take fewer, larger tets, with edges of at least \
         {:.2} mm, or a smaller spacing",
        2.0 * spacing_mm
    )]
    CoarseTooFine {
        /// Coarse nodes that may move and that particles follow.
        nodes: usize,
        /// Particles that follow them.
        particles: usize,
        /// Mean edge (mm) of the coarse tets.
        edge_mm: f64,
        /// Spacing (mm).
        spacing_mm: f64,
    },
    /// Something was asked for that only bodies without particles have.
    #[error("{what} is not there for bodies with particles; {instead}")]
    NotForParticles {
        /// What was asked for.
        what: &'static str,
        /// What to do instead.
        instead: &'static str,
    },
}

/// Returns the number of layers of cells that begin within a depth (m), at least one.
pub(super) fn fine_layers(depth_m: f64, spacing_m: f64) -> usize {
    // A depth of whole cells, but for rounding, has that many layers.
    (depth_m / spacing_m - 1e-9).ceil().max(1.0) as usize
}

impl ParticleSpec {
    /// Returns the number of layers of cells of the lattice's spacing at the surface; `None` where deeper ones are not
    /// merged.
    pub(super) fn fine_layers(&self) -> Option<usize> {
        self.fine_depth_m.map(|depth_m| fine_layers(depth_m, self.spacing_m))
    }

    pub(crate) fn check(&self) -> Result<(), HybridError> {
        let setting = |name, value: f64, ok: bool, rule| {
            if ok { Ok(()) } else { Err(HybridError::Setting { name, value, rule }) }
        };
        let h = self.spacing_m;
        setting("spacing_m", h, h > 0.0 && h.is_finite(), "must be finite and larger than 0")?;
        let through = self.lattice_through_m.length();
        setting("lattice_through_m", through, through.is_finite(), "must be finite")?;
        if let Some(depth_m) = self.fine_depth_m {
            setting("fine_depth_m", depth_m, depth_m >= 0.0 && depth_m.is_finite(), "must be finite and not negative")?;
        }
        let most = self.most_active;
        setting("most_active", most as f64, (1..=MOST_ACTIVE).contains(&most), "must be 1 to 20000")?;
        if let Waking::ByTools { reach_m } = self.waking {
            setting("reach_m", reach_m, reach_m > 0.0 && reach_m.is_finite(), "must be finite and larger than 0")?;
        }
        let (low, high) = self.skin.bounds_m();
        let cells = ((high - low) / h + 1.0).to_array().iter().product();
        if cells > MOST_CELLS {
            return Err(HybridError::TooMany { spacing_m: h, cells });
        }
        Ok(())
    }
}

impl From<MeshError> for HybridError {
    fn from(source: MeshError) -> Self {
        Self::Solid(source.into())
    }
}
