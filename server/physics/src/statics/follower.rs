//! Follower pressure: its load stiffness, and its work along a line.
//!
//! A triangle with corners `a, b, c` gets `f = −(p/6) (b − a)×(c − a)` at each corner. With `N = (b−a)×(c−a)`,
//! `∂N/∂a = [c − b]×`, `∂N/∂b = [a − c]×`, `∂N/∂c = [b − a]×`, so that `∂(−f_i)/∂x_j = (p/6) [opposite edge of j]×` for every
//! corner `i`. Summed over a surface the skew parts cancel inside; what is left on a free rim is dropped.
use crate::{
    bodies::tet::stiffness::{Stiffness, cross_matrix, symmetric_part},
    elements::free_axes::FreeAxes,
    settings::LoadSpec,
    tick::Environment,
};
use glam::{DMat3, DVec3};

/// Follower pressures with a factor that is not zero: triangles and pressure (Pa).
pub(super) fn active<'a>(environment: &'a Environment, factors: &'a [f64]) -> impl Iterator<Item = (&'a [u32], f64)> {
    environment.loads.iter().zip(factors).filter_map(|(load, &factor)| match load {
        LoadSpec::Pressure { triangles, pressure_pa, follower: true } if factor != 0.0 => {
            Some((triangles.as_slice(), pressure_pa * factor))
        }
        _ => None,
    })
}

/// Adds the symmetric part of `∂(−f)/∂x`.
pub(super) fn add_stiffness(
    environment: &Environment,
    factors: &[f64],
    x: &[DVec3],
    free: &FreeAxes,
    stiffness: &mut Stiffness,
) {
    for_each_block(environment, factors, x, &mut |i, j, block| stiffness.add_block(free, i, j, block));
}

/// Calls `add(i, j, block)` with the symmetric part of `∂(−f_i)/∂x_j`, once for a pair of corners.
pub(super) fn for_each_block(
    environment: &Environment,
    factors: &[f64],
    x: &[DVec3],
    add: &mut impl FnMut(u32, u32, &DMat3),
) {
    for (triangles, pressure_pa) in active(environment, factors) {
        for &triangle in triangles {
            let nodes = environment.surface.triangle_nodes(triangle as usize);
            let [a, b, c] = nodes.map(|n| x[n as usize]);
            let derivative = [c - b, a - c, b - a].map(|edge| cross_matrix(edge) * (pressure_pa / 6.0));
            for i in 0..3 {
                // Diagonal blocks are skew: nothing symmetric to add.
                for j in i + 1..3 {
                    // K_ij = D_j, K_ji = D_i; both D are skew.
                    let block = (derivative[j] + derivative[i].transpose()) * 0.5;
                    add(nodes[i], nodes[j], &block);
                }
                debug_assert!(symmetric_part(&derivative[i]).abs_diff_eq(DMat3::ZERO, 0.0));
            }
        }
    }
}
