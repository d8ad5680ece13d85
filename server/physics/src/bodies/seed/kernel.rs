//! The particles' weight: a linear approximation of the Lennard-Jones potential.
//!
//! Eq. 24 (2006; eq. 8 of 2005), `W(r) = κ(r⁻³ − r⁻¹)`, is no weight: it is singular at 0, negative beyond `r = 1` and
//! has no finite integral. The 2006 paper uses "a linear approximation of the Lennard-Jones potential which fulfils
//! kernel requirements" and does not print it. It is read here as the tangent at the zero crossing, cut off there and
//! normalised over the ball:
//! ```text
//! W(r) = 3/(πR³) (1 − r/R)₊        ∫ W dV = 4π · 3/(πR³) ∫₀ᴿ (1 − r/R) r² dr = 1        |∇W| = 3/(πR⁴)
//! ```
//! The support is `R = 2h` (eq. 23); eq. 25 prints `h`.
use glam::DVec3;
use std::f64::consts::PI;

/// A weight that falls linearly to zero at the radius R: a cone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cone {
    /// Radius R = 2h (m) of the support.
    pub radius_m: f64,
}

impl Cone {
    /// Returns the cone of the smoothing length h (m).
    pub fn of_smoothing_length(h_m: f64) -> Self {
        Self { radius_m: 2.0 * h_m }
    }

    /// Returns `W = 3/(πR³)(1 − r/R)₊` (1/m³) at the distance `r_m` (m).
    pub fn weight_per_m3(&self, r_m: f64) -> f64 {
        3.0 / (PI * self.radius_m.powi(3)) * (1.0 - r_m / self.radius_m).max(0.0)
    }

    /// Returns `∇_i W(u_i − u_j) = 3/(πR⁴) (u_j − u_i)/r` (1/m⁴) for `to_m = u_j − u_i`, which is zero at the tip and
    /// outside the support.
    pub fn gradient_per_m4(&self, to_m: DVec3) -> DVec3 {
        let r = to_m.length();
        if r > 0.0 && r < self.radius_m { to_m * (3.0 / (PI * self.radius_m.powi(4) * r)) } else { DVec3::ZERO }
    }
}

/// The neighbours of a particle and the gradients `b = ∇_i W ΔV` (1/m) towards them, which are the same for all
/// particles of a lattice.
#[derive(Debug, Clone, PartialEq)]
pub struct Stencil {
    /// Steps to the neighbours, in voxels, with z slowest; sums run in this order.
    pub steps: Vec<[i32; 3]>,
    /// Gradient `b` (1/m) towards each neighbour.
    pub gradients_per_m: Vec<DVec3>,
    /// Number of voxels from a particle to its farthest neighbour along an axis.
    pub reach: usize,
}

impl Stencil {
    /// Returns the stencil of a weight on a lattice of `spacing_m` (m) whose particles have the volume `volume_m3` (m³)
    /// each.
    pub fn new(cone: &Cone, spacing_m: f64, volume_m3: f64) -> Self {
        let reach = (cone.radius_m / spacing_m).ceil() as i32;
        let (mut steps, mut gradients_per_m) = (Vec::new(), Vec::new());
        for k in -reach..=reach {
            for j in -reach..=reach {
                for i in -reach..=reach {
                    let to = DVec3::new(f64::from(i), f64::from(j), f64::from(k)) * spacing_m;
                    let gradient = cone.gradient_per_m4(to);
                    if gradient != DVec3::ZERO {
                        steps.push([i, j, k]);
                        gradients_per_m.push(gradient * volume_m3);
                    }
                }
            }
        }
        Self { steps, gradients_per_m, reach: reach as usize }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cone_integrates_to_one_and_has_its_slope() {
        let cone = Cone::of_smoothing_length(1.3e-3);
        // ∫ W dV by shells, midpoint rule.
        let shells = 20_000;
        let dr = cone.radius_m / f64::from(shells);
        let integral: f64 =
            (0..shells).map(|n| (f64::from(n) + 0.5) * dr).map(|r| cone.weight_per_m3(r) * 4.0 * PI * r * r * dr).sum();
        assert!((integral - 1.0).abs() < 1e-8, "{integral}");
        assert_eq!(cone.weight_per_m3(cone.radius_m * 1.01), 0.0);
        // The gradient at i, by moving i: u_j − u_i = to, so r falls when i moves along `to`.
        let to = DVec3::new(0.4e-3, -1.1e-3, 0.7e-3);
        let moved = 1e-9;
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let weight = |step: f64| cone.weight_per_m3((to - axis * step).length());
            let difference = (weight(moved) - weight(-moved)) / (2.0 * moved);
            assert!((difference / cone.gradient_per_m4(to).dot(axis) - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn neighbours_come_in_pairs_of_opposite_gradient() {
        let stencil = Stencil::new(&Cone { radius_m: 2.4 }, 1.0, 1.0);
        // 6 at 1, 12 at √2, 8 at √3, 6 at 2, 24 at √5.
        assert_eq!((stencil.steps.len(), stencil.reach), (56, 3));
        for (step, gradient) in stencil.steps.iter().zip(&stencil.gradients_per_m) {
            let back = stencil.steps.iter().position(|other| *other == step.map(|n| -n)).unwrap();
            assert_eq!(stencil.gradients_per_m[back], -*gradient);
        }
    }
}
