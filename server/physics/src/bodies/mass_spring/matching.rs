//! Spring constants with which a refined region feels as the coarse one did: haptic-subdivision, eq. 4.
//! ```text
//! F′(K′_h, K′_m, x) = F(K_h, K_m, x)
//! ```
//! Here `F` is the force that displaces one vertex by `x` while all others come to rest. This is one equation for two
//! constants; a [`Way`] is the second one. Matched constants are right for *point contact*. Under uniform pressure a
//! region of `N′` anchor springs in place of `N`, with about the same constant, is `N′/N` times as stiff. The
//! [`area_consistent`] constants are right for that, and wrong for a point.
use super::{
    equilibrium::{NoRest, settle},
    net::Net,
    region::{Constants, Refined},
};
use glam::DVec3;
use thiserror::Error;

/// The condition besides eq. 4.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Way {
    /// `K′_h` is given (N/m), and `K′_m` is found.
    Anchor(f64),
    /// `K′_m/K′_h` is given, and both are found.
    Ratio(f64),
}

/// Why no constants are found.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum NoMatch {
    /// One of the nets does not come to rest.
    #[error(transparent)]
    NoRest(#[from] NoRest),
    /// No constant gives the force.
    #[error("no constant between {low_n_per_m:e} and {high_n_per_m:e} N/m gives the force {force_n:e} N")]
    OutOfReach {
        /// The force that is wanted (N).
        force_n: f64,
        /// Smallest constant that was tried (N/m).
        low_n_per_m: f64,
        /// Largest constant that was tried (N/m).
        high_n_per_m: f64,
    },
}

/// Returns the constants with which a refined surface is the same sheet on the same foundation, per area: `K′_m = K_m`,
/// `K′_h = K_h/4`. In the plane the springs of triangles of any size make the same stiffness, and a refined vertex has
/// a quarter of the foundation's area.
pub fn area_consistent(coarse: &Constants) -> Constants {
    Constants { mesh_n_per_m: coarse.mesh_n_per_m, anchor_n_per_m: 0.25 * coarse.anchor_n_per_m }
}

/// Forces below this part of the stiffest spring times the displacement count as zero.
const TOLERANCE: f64 = 1e-12;

/// Returns the force (N) that displaces a node by `displacement_m` (m) from its rest position while all others come to
/// rest. `x_m` has the positions from which to start, and at the end those at rest.
///
/// # Errors
/// [`NoRest`].
pub fn point_force_n(net: &Net, node: u32, displacement_m: DVec3, x_m: &mut Vec<DVec3>) -> Result<DVec3, NoRest> {
    let mut is_held = vec![false; net.rest_m.len()];
    is_held[node as usize] = true;
    x_m[node as usize] = net.rest_m[node as usize] + displacement_m;
    let stiffest = net.diagonal_n_per_m().into_iter().fold(0.0, f64::max);
    settle(net, &is_held, &[], x_m, TOLERANCE * stiffest * displacement_m.length())?;
    Ok(-net.forces_n(x_m)[node as usize])
}

/// Returns the constants inside a region with which a displacement of its node `node` by `displacement_m` (m) takes the
/// force `force_n` (N, along the displacement).
///
/// They are the root of `ln F′ − ln F` over the constant's logarithm, which the Illinois method finds to 1e-10 of the
/// force.
///
/// # Errors
/// [`NoMatch`].
pub fn matched(
    refined: &Refined,
    outside: &Constants,
    node: u32,
    displacement_m: DVec3,
    force_n: f64,
    way: Way,
) -> Result<Constants, NoMatch> {
    let constants = |ln: f64| match way {
        Way::Anchor(anchor_n_per_m) => Constants { mesh_n_per_m: ln.exp(), anchor_n_per_m },
        Way::Ratio(ratio) => Constants { mesh_n_per_m: ratio * ln.exp(), anchor_n_per_m: ln.exp() },
    };
    let mut x_m = refined.rest_m.clone();
    let mut misfit = |ln: f64| -> Result<f64, NoRest> {
        let net = refined.net(outside, &constants(ln));
        let force = point_force_n(&net, node, displacement_m, &mut x_m)?.dot(displacement_m.normalize_or_zero());
        Ok((force / force_n).ln())
    };
    let start = match way {
        Way::Anchor(_) => outside.mesh_n_per_m.ln(),
        Way::Ratio(_) => outside.anchor_n_per_m.ln(),
    };
    let first = misfit(start)?;
    // The force grows with the constant: go away from the start until the force is on the other side.
    let (mut one, mut step) = ((start, first), -first.signum() * 0.25);
    let mut other = one;
    while other.1 * one.1 > 0.0 || other.0.to_bits() == one.0.to_bits() {
        if first == 0.0 {
            return Ok(constants(start));
        }
        if step.abs() > 20.0 {
            let (low, high) = (other.0.min(start), other.0.max(start));
            return Err(NoMatch::OutOfReach { force_n, low_n_per_m: low.exp(), high_n_per_m: high.exp() });
        }
        if other.0.to_bits() != one.0.to_bits() {
            one = other;
        }
        other = (start + step, misfit(start + step)?);
        step *= 2.0;
    }
    for _ in 0..200 {
        let middle = (one.0 * other.1 - other.0 * one.1) / (other.1 - one.1);
        let at = misfit(middle)?;
        if at.abs() < 1e-10 || (one.0 - other.0).abs() < 1e-13 {
            return Ok(constants(middle));
        }
        if at * other.1 < 0.0 {
            one = other;
        } else {
            one.1 *= 0.5;
        }
        other = (middle, at);
    }
    Ok(constants(other.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::mass_spring::{loop_scheme, region::Region, testing::hexagon};

    #[test]
    fn matched_constants_give_the_force_of_the_coarse_sheet() {
        let (edge, k) = (0.03, Constants { mesh_n_per_m: 60.0, anchor_n_per_m: 60.0 });
        let patch = hexagon(5, edge);
        let coarse = Net::uniform(&patch, k.mesh_n_per_m, k.anchor_n_per_m);
        let refined = Refined::new(&patch, &Region::rings(&patch, &[0], 1), &loop_scheme::refined(&patch).0);
        for part in [0.1, 1.0] {
            let push = DVec3::Z * (part * edge);
            let force_n = point_force_n(&coarse, 0, push, &mut coarse.rest_m.clone()).unwrap().z;
            for way in [Way::Anchor(60.0), Way::Anchor(60.0 * refined.node_ratio()), Way::Ratio(1.0), Way::Ratio(4.0)] {
                let found = matched(&refined, &k, 0, push, force_n, way).unwrap();
                let net = refined.net(&k, &found);
                let force = point_force_n(&net, 0, push, &mut net.rest_m.clone()).unwrap().z;
                assert!((force / force_n - 1.0).abs() < 1e-9, "{way:?} at {part}: {force} {force_n}");
                match way {
                    Way::Anchor(anchor) => assert_eq!(found.anchor_n_per_m, anchor),
                    Way::Ratio(ratio) => {
                        assert!((found.mesh_n_per_m / found.anchor_n_per_m / ratio - 1.0).abs() < 1e-12);
                    }
                }
            }
        }
    }

    /// Only anchor springs answer a uniform press. Those matched for a point are too stiff together; area-consistent
    /// ones are not, except along the rim, whose vertices have more area than a fine one and less than a coarse one.
    #[test]
    fn pressed_uniformly_matched_constants_are_too_stiff_and_area_consistent_ones_not() {
        let (edge, k) = (0.03, Constants { mesh_n_per_m: 60.0, anchor_n_per_m: 60.0 });
        let patch = hexagon(5, edge);
        let fine_rest = loop_scheme::refined(&patch).0;
        let coarse = Net::uniform(&patch, k.mesh_n_per_m, k.anchor_n_per_m);
        for (rings, too_stiff) in [(1, 2.5..2.8), (2, 3.0..3.3)] {
            let refined = Refined::new(&patch, &Region::rings(&patch, &[0], rings), &fine_rest);
            let push = DVec3::Z * (0.1 * edge);
            let force_n = point_force_n(&coarse, 0, push, &mut coarse.rest_m.clone()).unwrap().z;
            let of_point = matched(&refined, &k, 0, push, force_n, Way::Ratio(1.0)).unwrap();
            let of_sum = |constants: &Constants| {
                let inside = refined.is_inside.iter().filter(|inside| **inside).count() as f64;
                constants.anchor_n_per_m * inside / (k.anchor_n_per_m * refined.coarse_inside as f64)
            };
            assert!(too_stiff.contains(&of_sum(&of_point)), "{rings}: {}", of_sum(&of_point));
            let of_area = of_sum(&area_consistent(&k));
            assert!((0.65..0.85).contains(&of_area), "{rings}: {of_area}");
        }
    }

    #[test]
    fn a_force_out_of_reach_is_told() {
        let k = Constants { mesh_n_per_m: 60.0, anchor_n_per_m: 60.0 };
        let patch = hexagon(3, 0.03);
        let refined = Refined::new(&patch, &Region::rings(&patch, &[0], 1), &loop_scheme::refined(&patch).0);
        // Anchor springs alone push back more than this.
        let error = matched(&refined, &k, 0, DVec3::Z * 1e-3, 1e-3, Way::Anchor(60.0)).unwrap_err();
        assert!(matches!(error, NoMatch::OutOfReach { .. }), "{error}");
    }
}
