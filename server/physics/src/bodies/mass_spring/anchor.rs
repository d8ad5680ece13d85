//! The laws of anchor springs: `g(u)` of the force `K_h g(u)` that pulls a vertex back over the distance `u` from its
//! rest position.
//!
//! Every law has slope 1 at rest, so that `K_h` is the stiffness there. With slopes `s_k` at distances `u_k`, linear
//! between and constant beyond,
//! ```text
//! g(u) = ∫₀ᵘ s,   G(u) = ∫₀ᵘ g,   force −K_h g(u) û,   energy K_h G(u)
//! ```
//! so that force and stiffness are continuous. The single slope `s_0 = 1` is the paper's linear spring.
use glam::DVec3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// The law of an anchor spring.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum AnchorLaw {
    /// The paper's law `g = u`.
    Linear,
    /// The law `g = u + c u³`.
    Cubic {
        /// Constant `c` (1/m²).
        per_m2: f64,
    },
    /// Several layers that lie one behind the other ([`Layers`]).
    Layers(Layers),
}

/// A slope that is linear in the distance between given knots.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Layers {
    /// Knots by ascending distance, the first at 0.
    knots: Vec<Knot>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Knot {
    u_m: f64,
    slope: f64,
    g_m: f64,
    /// Integral `G` (m²) of the law.
    integral_m2: f64,
}

/// One of several layers in series.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Layer {
    /// Distance (m) by which it can be compressed; of the last layer it means nothing.
    pub thickness_m: f64,
    /// Its stiffness over that of the first layer.
    pub stiffness_ratio: f64,
}

/// Why numbers make no law.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum AnchorLawError {
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
    /// There are no layers.
    #[error("an anchor spring of layers needs at least one layer")]
    NoLayers,
}

/// The values of a law at a distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AtDistance {
    /// Law `g` (m).
    pub g_m: f64,
    /// Slope `g′`.
    pub slope: f64,
    /// Integral `G` (m²).
    pub integral_m2: f64,
}

impl AnchorLaw {
    /// Returns the law of a cubic spring.
    ///
    /// # Errors
    /// The constant is negative or not finite: the spring would push away from its rest position.
    pub fn cubic(per_m2: f64) -> Result<Self, AnchorLawError> {
        check("per_m2", per_m2, (0.0..f64::INFINITY).contains(&per_m2), "finite and not negative")?;
        Ok(Self::Cubic { per_m2 })
    }

    /// Returns the law of layers in series that are compressed one after the other: the stiffness is the nth layer's
    /// while `u` lies in the nth thickness. Over the last [`BLEND`] of its thickness a layer's stiffness changes
    /// linearly to that of the next.
    ///
    /// # Errors
    /// There are no layers, or a thickness or stiffness is not positive.
    pub fn layers(layers: &[Layer]) -> Result<Self, AnchorLawError> {
        let first = layers.first().ok_or(AnchorLawError::NoLayers)?;
        let mut slopes = vec![(0.0, 1.0)];
        let mut depth_m = 0.0;
        for pair in layers.windows(2) {
            let [upper, lower] = [pair[0], pair[1]];
            check(
                "thickness_m",
                upper.thickness_m,
                upper.thickness_m > 0.0 && upper.thickness_m.is_finite(),
                "positive",
            )?;
            depth_m += upper.thickness_m;
            slopes.push((depth_m - BLEND * upper.thickness_m, upper.stiffness_ratio / first.stiffness_ratio));
            slopes.push((depth_m, lower.stiffness_ratio / first.stiffness_ratio));
        }
        for layer in layers {
            let ratio = layer.stiffness_ratio;
            check("stiffness_ratio", ratio, ratio > 0.0 && ratio.is_finite(), "positive")?;
        }
        Ok(Self::Layers(Layers::new(&slopes)))
    }

    /// Returns the law's values at a distance (m) from the rest position.
    pub fn at(&self, u_m: f64) -> AtDistance {
        match self {
            Self::Linear => AtDistance { g_m: u_m, slope: 1.0, integral_m2: 0.5 * u_m * u_m },
            Self::Cubic { per_m2 } => {
                let sq = u_m * u_m;
                AtDistance {
                    g_m: u_m * (1.0 + per_m2 * sq),
                    slope: 1.0 + 3.0 * per_m2 * sq,
                    integral_m2: sq * (0.5 + 0.25 * per_m2 * sq),
                }
            }
            Self::Layers(layers) => layers.at(u_m),
        }
    }

    /// Returns `g(|u|) u/|u|` (m).
    pub fn stretched(&self, u_m: DVec3) -> DVec3 {
        match self {
            Self::Linear => u_m,
            Self::Cubic { per_m2 } => u_m * (1.0 + per_m2 * u_m.length_squared()),
            Self::Layers(layers) => u_m.normalize_or_zero() * layers.at(u_m.length()).g_m,
        }
    }

    /// Returns the largest slope within a distance (m), which bounds the stable step.
    pub fn steepest_within(&self, u_m: f64) -> f64 {
        match self {
            Self::Linear => 1.0,
            Self::Cubic { .. } => self.at(u_m).slope,
            Self::Layers(layers) => {
                let knots = layers.knots.iter().take_while(|knot| knot.u_m <= u_m);
                knots.map(|knot| knot.slope).fold(layers.at(u_m).slope, f64::max)
            }
        }
    }
}

/// Part of a layer's thickness over which its stiffness changes to that of the next layer.
pub const BLEND: f64 = 0.2;

impl Layers {
    fn new(slopes: &[(f64, f64)]) -> Self {
        let mut knots: Vec<Knot> = Vec::with_capacity(slopes.len());
        for &(u_m, slope) in slopes {
            let (g_m, integral_m2) = knots.last().map_or((0.0, 0.0), |last| {
                let at = last.towards(slope, u_m - last.u_m, u_m - last.u_m);
                (at.g_m, at.integral_m2)
            });
            knots.push(Knot { u_m, slope, g_m, integral_m2 });
        }
        Self { knots }
    }

    fn at(&self, u_m: f64) -> AtDistance {
        let after = self.knots.partition_point(|knot| knot.u_m <= u_m).max(1);
        let knot = self.knots[after - 1];
        let (slope, length_m) =
            self.knots.get(after).map_or((knot.slope, 1.0), |next| (next.slope, next.u_m - knot.u_m));
        knot.towards(slope, length_m, u_m - knot.u_m)
    }
}

impl Knot {
    /// Returns the values at the distance `t` (m) behind the knot, on a piece of this length (m) at whose end the slope
    /// is `slope`.
    fn towards(&self, slope: f64, length_m: f64, t: f64) -> AtDistance {
        let change = if length_m > 0.0 { (slope - self.slope) / length_m } else { 0.0 };
        AtDistance {
            slope: self.slope + change * t,
            g_m: self.g_m + t * (self.slope + 0.5 * change * t),
            integral_m2: self.integral_m2 + t * (self.g_m + t * (0.5 * self.slope + change * t / 6.0)),
        }
    }
}

fn check(name: &'static str, value: f64, ok: bool, rule: &'static str) -> Result<(), AnchorLawError> {
    if ok { Ok(()) } else { Err(AnchorLawError::Setting { name, value, rule }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn laws() -> [AnchorLaw; 3] {
        let layers = [(1e-3, 1.0), (2e-3, 4.0), (1e-3, 30.0)];
        let layers = layers.map(|(thickness_m, stiffness_ratio)| Layer { thickness_m, stiffness_ratio });
        [AnchorLaw::Linear, AnchorLaw::cubic(2e5).unwrap(), AnchorLaw::layers(&layers).unwrap()]
    }

    #[test]
    fn force_is_the_slope_of_energy_and_stiffness_that_of_force() {
        for law in laws() {
            let start = law.at(0.0);
            assert_eq!((start.g_m, start.slope, start.integral_m2), (0.0, 1.0, 0.0));
            for step in 1..500 {
                let (u, d) = (f64::from(step) * 1e-5 + 3e-7, 1e-8);
                let [less, here, more] = [u - d, u, u + d].map(|u| law.at(u));
                let force = (more.integral_m2 - less.integral_m2) / (2.0 * d);
                let slope = (more.g_m - less.g_m) / (2.0 * d);
                assert!((force - here.g_m).abs() < 1e-7 * here.g_m.max(1e-3), "{law:?} at {u}: {force} {here:?}");
                assert!((slope / here.slope - 1.0).abs() < 1e-3, "{law:?} at {u}: {slope} {here:?}");
                assert!(law.steepest_within(u) >= here.slope);
            }
        }
    }

    #[test]
    fn layers_come_to_bear_one_after_the_other() {
        let law = &laws()[2];
        for (u_m, slope) in [(0.5e-3, 1.0), (1e-3, 4.0), (2e-3, 4.0), (3e-3, 30.0), (1.0, 30.0)] {
            assert!((law.at(u_m).slope - slope).abs() < 1e-12, "{u_m}: {:?}", law.at(u_m));
        }
        assert_eq!(law.steepest_within(2e-3), 4.0);
    }

    #[test]
    fn bad_numbers_are_named() {
        assert!(matches!(AnchorLaw::cubic(-1.0), Err(AnchorLawError::Setting { name: "per_m2", .. })));
        assert_eq!(AnchorLaw::layers(&[]), Err(AnchorLawError::NoLayers));
        let layer = |thickness_m, stiffness_ratio| Layer { thickness_m, stiffness_ratio };
        let refused = |layers: &[Layer]| AnchorLaw::layers(layers).unwrap_err().to_string();
        assert!(refused(&[layer(0.0, 1.0), layer(1.0, 1.0)]).contains("thickness_m = 0"));
        assert!(refused(&[layer(1.0, 1.0), layer(1.0, -2.0)]).contains("stiffness_ratio = -2"));
    }
}
