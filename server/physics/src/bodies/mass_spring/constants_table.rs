//! The table of the constants `K′_m`, `K′_h` of a refined surface over displacement (haptic-subdivision's look-up table);
//! [`super::calibration`] makes it.
use super::{
    matching::NoMatch,
    region::Constants,
    triangulation::{Triangulation, TriangulationError},
};
use crate::hash::{OFFSET, fnv};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What is calibrated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Constants of the coarse surface.
    pub coarse: Constants,
    /// Number of refined rings.
    pub rings: u32,
    /// Ratio `K′_m/K′_h`.
    pub ratio: f64,
    /// Number of sample vertices.
    pub samples: usize,
}

/// Spring constants over displacement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ConstantsTable {
    /// The surface that it was made for, by its [`fingerprint`].
    pub fingerprint: u64,
    /// How it was made.
    pub of: Calibration,
    /// Rows by ascending displacement.
    pub rows: Vec<TableRow>,
}

/// The constants at one displacement.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TableRow {
    /// Displacement `x/L`.
    pub xi: f64,
    /// Median of `K′_h/K_h`.
    #[serde(alias = "home_ratio")]
    pub anchor_ratio: f64,
    /// Largest relative difference of a sample's `K′_h/K_h` from the median.
    pub spread: f64,
    /// Median of `U′/U`.
    pub energy_ratio: f64,
}

/// Why there is no table.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CalibrationError {
    /// A number is outside its range.
    #[error("{name} = {value}: must be {rule}")]
    Setting {
        /// Name of the number.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        rule: &'static str,
    },
    /// Every vertex is too near to a boundary.
    #[error("no vertex of the surface is {rings} rings from its boundary: refine less, or give a finer surface")]
    NoSample {
        /// Number of rings that are wanted.
        rings: u32,
    },
    /// A piece of the surface is no valid surface once it is smoothed.
    #[error("around vertex {vertex}, smoothed by Loop's scheme, the surface is none: {source}")]
    Piece {
        /// The sample vertex.
        vertex: u32,
        /// What is wrong.
        source: TriangulationError,
    },
    /// No constants match at a sample.
    #[error("at vertex {vertex}, displaced by {xi} of its edges' length: {source}")]
    NoMatch {
        /// The sample vertex.
        vertex: u32,
        /// Displacement `x/L`.
        xi: f64,
        /// What is wrong.
        source: NoMatch,
    },
    /// The table was made for something else.
    #[error("the table was made for {what}: calibrate again")]
    Stale {
        /// What differs.
        what: &'static str,
    },
}

impl ConstantsTable {
    /// Returns the largest constants of the table.
    pub fn largest(&self) -> Constants {
        let most = self.rows.iter().map(|row| row.anchor_ratio).fold(0.0, f64::max);
        let anchor_n_per_m = most * self.of.coarse.anchor_n_per_m;
        Constants { mesh_n_per_m: self.of.ratio * anchor_n_per_m, anchor_n_per_m }
    }

    /// Returns the constants at a displacement over the mean length of the edges: linear between rows, and those of the
    /// last row beyond it.
    pub fn at(&self, xi: f64) -> Constants {
        let after = self.rows.partition_point(|row| row.xi <= xi).clamp(1, self.rows.len().saturating_sub(1).max(1));
        let anchor_ratio = match (self.rows.get(after - 1), self.rows.get(after)) {
            (Some(low), Some(high)) => {
                let part = ((xi - low.xi) / (high.xi - low.xi)).clamp(0.0, 1.0);
                low.anchor_ratio + (high.anchor_ratio - low.anchor_ratio) * part
            }
            (Some(only), None) => only.anchor_ratio,
            _ => 1.0,
        };
        let anchor_n_per_m = anchor_ratio * self.of.coarse.anchor_n_per_m;
        Constants { mesh_n_per_m: self.of.ratio * anchor_n_per_m, anchor_n_per_m }
    }

    /// Checks that the table was made for this surface, and in this way.
    ///
    /// # Errors
    /// [`CalibrationError::Stale`].
    pub fn fits(&self, surface: &Triangulation, of: &Calibration) -> Result<(), CalibrationError> {
        let stale = |what| Err(CalibrationError::Stale { what });
        if self.fingerprint != fingerprint(surface) {
            return stale("another surface");
        }
        if self.of.coarse != of.coarse || self.of.ratio.to_bits() != of.ratio.to_bits() {
            return stale("other spring constants");
        }
        if self.of.rings != of.rings {
            return stale("another number of rings");
        }
        if self.rows.is_empty() || self.rows.iter().any(|row| !(row.anchor_ratio > 0.0 && row.anchor_ratio.is_finite()))
        {
            return stale("nothing: it has no usable rows");
        }
        Ok(())
    }
}

/// Returns a hash of a surface's vertices and triangles (FNV-1a).
pub fn fingerprint(surface: &Triangulation) -> u64 {
    let positions = surface.positions_m().iter().flat_map(DVec3::to_array).flat_map(|c| c.to_bits().to_le_bytes());
    let triangles = surface.triangles().iter().flatten().flat_map(|vertex| vertex.to_le_bytes());
    fnv(OFFSET, positions.chain(triangles))
}
