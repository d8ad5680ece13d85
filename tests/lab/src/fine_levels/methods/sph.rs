//! Sums over neighbours as smoothed particle hydrodynamics makes them, raw and corrected; see `mod.rs`.
use super::{
    neighbours::particles_near,
    points::{Row, Term},
    smoothing_kernels::{Kernel, SMOOTHING},
};
use glam::DMat3;
use palpate_physics::{bodies::hybrid::partition::Partition, linalg::tensor::outer};

/// `b_qp = −V_p W' ΔX/|ΔX|`.
pub(super) fn raw(partition: &Partition, kernel: Kernel, particle: u32) -> Vec<Term> {
    let spacing_m = partition.sites().spacing_m();
    let (smoothing_m, volume_m3) = (SMOOTHING * spacing_m, spacing_m.powi(3));
    let at = partition.particle_m(particle);
    let near = particles_near(partition, at, Kernel::support_m(smoothing_m));
    let term = |neighbour: u32| {
        let span_m = partition.particle_m(neighbour) - at;
        let distance_m = span_m.length();
        let gradient_per_m = span_m * (-volume_m3 * kernel.slope_per_m4(distance_m, smoothing_m) / distance_m);
        Term { particle: neighbour, gradient_per_m, span_m, control_m: 0.0 }
    };
    near.into_iter().filter(|&p| p != particle).map(term).collect()
}

/// `b_qp = V_p L_q ∇W`.
pub(super) fn corrected(partition: &Partition, kernel: Kernel, particle: u32) -> Vec<Term> {
    let mut terms = raw(partition, kernel, particle);
    // L_q = (Σ V_p ∇W ⊗ ΔX)⁻¹: the corners of one cell are among the neighbours, so it is there.
    let moment = terms.iter().fold(DMat3::ZERO, |sum, term| sum + outer(term.gradient_per_m, term.span_m));
    let correction = moment.inverse();
    for term in &mut terms {
        term.gradient_per_m = correction * term.gradient_per_m;
    }
    terms
}

/// Gives a row control, `k_qp = α V_q V_p w_p/|ΔX|²`.
pub(super) fn controlled(partition: &Partition, kernel: Kernel, control: f64, mut row: Row) -> Row {
    let spacing_m = partition.sites().spacing_m();
    for term in &mut row.terms {
        let weight = spacing_m.powi(3) * kernel.value_per_m3(term.span_m.length(), SMOOTHING * spacing_m);
        term.control_m = control * row.volume_m3 * weight / term.span_m.length_squared();
    }
    row
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fine_levels::testing::block_in_cage;
    use glam::DVec3;

    /// In a layer four particles thick.
    #[test]
    fn raw_sums_give_the_identity_map_another_gradient() {
        let of_identity = |partition: &Partition, kernel: Kernel, at: DVec3| {
            let particle = particles_near(partition, at, 1e-6)[0];
            let terms = raw(partition, kernel, particle);
            terms.iter().fold(DMat3::ZERO, |sum, term| sum + outer(term.span_m, term.gradient_per_m))
        };
        let layer = block_in_cage([12, 12, 3]);
        let in_face = |kernel| of_identity(&layer, kernel, DVec3::new(6e-3, 6e-3, 0.0));
        let near = |a: DMat3, x: f64, z: f64| a.abs_diff_eq(DMat3::from_diagonal(DVec3::new(x, x, z)), 0.005);
        let (cone, wendland) = (in_face(Kernel::Cone), in_face(Kernel::WendlandC2));
        assert!(near(cone, 0.62, 0.40) && near(wendland, 0.85, 0.50), "{cone} {wendland}");
        // A face cuts off half of what makes the gradient along its normal.
        let inside = of_identity(&block_in_cage([6, 6, 6]), Kernel::Cone, DVec3::splat(3e-3));
        assert!(near(inside, 0.80, 0.80) && (cone.z_axis.z / inside.z_axis.z - 0.5).abs() < 1e-9, "{inside}");
    }
}
