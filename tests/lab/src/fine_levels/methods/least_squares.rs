//! Moving least squares with a linear basis (Lancaster & Salkauskas 1981; Nayroles, Touzot & Villon 1992).
//!
//! Shape functions at X, with `P_p = (1, (X_p − X)/s)`, weights `w_p = W(|X_p − X|)` of Wendland's kernel and `e = (1, 0, 0, 0)`:
//! ```text
//! N_p(X) = e·A⁻¹ P_p w_p          A = Σ_p w_p P_p P_pᵀ
//! ∂_k N_p = e·A⁻¹ (∂_k(w_p P_p) − ∂_k A A⁻¹ P_p w_p)          ∂_k P_p = −e_k/s
//! ```
//! They sum to one and reproduce affine functions, so `Σ_p ∇N_p = 0` and `Σ_p (X_p − X_o) ⊗ ∇N_p = I` from any origin. They are not one at their own
//! particle and zero at the others: a particle's degree of freedom is not quite where it is, once motion is not affine. The skin and the particles that
//! follow the coarse level take it for that.
use super::{
    neighbours::particles_near,
    points::Term,
    smoothing_kernels::{Kernel, SMOOTHING},
};
use glam::{DMat4, DVec3, DVec4};
use palpate_physics::bodies::hybrid::partition::Partition;

/// `∇N_p` (1/m) of the particles around a point (m), except that of `origin`, which is the others' opposite.
pub(super) fn terms(partition: &Partition, point_m: DVec3, origin: u32) -> Vec<Term> {
    let smoothing_m = SMOOTHING * partition.sites().spacing_m();
    let near = particles_near(partition, point_m, Kernel::support_m(smoothing_m));
    let places: Vec<DVec3> = near.iter().map(|&p| partition.particle_m(p)).collect();
    let gradients = gradients_per_m(&places, point_m, smoothing_m);
    let origin_m = partition.particle_m(origin);
    let term = |((particle, place), gradient_per_m): ((u32, DVec3), DVec3)| Term {
        particle,
        gradient_per_m,
        span_m: place - origin_m,
        control_m: 0.0,
    };
    near.into_iter().zip(places).zip(gradients).map(term).filter(|term| term.particle != origin).collect()
}

/// `∇N_p` at a point (1/m).
fn gradients_per_m(places_m: &[DVec3], point_m: DVec3, smoothing_m: f64) -> Vec<DVec3> {
    let outer = |a: DVec4, b: DVec4| DMat4::from_cols(a * b.x, a * b.y, a * b.z, a * b.w);
    // W over W(0), and its gradient in units of s.
    let top = Kernel::WendlandC2.value_per_m3(0.0, smoothing_m);
    let weights = places_m.iter().map(|place| {
        let span = (*place - point_m) / smoothing_m;
        let distance_m = span.length() * smoothing_m;
        let slope = Kernel::WendlandC2.slope_per_m4(distance_m, smoothing_m) * smoothing_m / top;
        let weight = Kernel::WendlandC2.value_per_m3(distance_m, smoothing_m) / top;
        (DVec4::new(1.0, span.x, span.y, span.z), weight, -span.normalize_or_zero() * slope)
    });
    let weights: Vec<(DVec4, f64, DVec3)> = weights.collect();
    let a = weights.iter().fold(DMat4::ZERO, |sum, (p, w, _)| sum + outer(*p, *p) * *w);
    let inverse = a.inverse();
    let mut gradients = vec![DVec3::ZERO; weights.len()];
    for axis in 0..3 {
        let mut down = DVec4::ZERO;
        down[axis + 1] = -1.0;
        // ∂_k(w P), and ∂_k A = Σ (∂_k(w P) Pᵀ + w P ∂_k Pᵀ)
        let change = |(p, w, slope): &(DVec4, f64, DVec3)| *p * slope[axis] + down * *w;
        let of_a = weights
            .iter()
            .fold(DMat4::ZERO, |sum, term| sum + outer(change(term), term.0) + outer(term.0, down) * term.1);
        for (gradient, term) in gradients.iter_mut().zip(&weights) {
            let right = change(term) - of_a * (inverse * term.0) * term.1;
            gradient[axis] = (inverse * right).x / smoothing_m;
        }
    }
    gradients
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fine_levels::testing::Random;

    /// Shape functions themselves, to be differentiated.
    fn values(places_m: &[DVec3], point_m: DVec3, smoothing_m: f64) -> Vec<f64> {
        let rows: Vec<(DVec4, f64)> = places_m
            .iter()
            .map(|place| {
                let span = (*place - point_m) / smoothing_m;
                let weight = Kernel::WendlandC2.value_per_m3(span.length() * smoothing_m, smoothing_m);
                (DVec4::new(1.0, span.x, span.y, span.z), weight * smoothing_m.powi(3))
            })
            .collect();
        let mut a = DMat4::ZERO;
        for (p, w) in &rows {
            a += DMat4::from_cols(*p * p.x, *p * p.y, *p * p.z, *p * p.w) * *w;
        }
        let inverse = a.inverse();
        rows.iter().map(|(p, w)| (inverse * *p).x * w).collect()
    }

    #[test]
    fn gradients_are_those_of_the_shape_functions() {
        let mut random = Random(17);
        let places: Vec<DVec3> = (0..30).map(|_| random.vector() * 2e-3).collect();
        for _ in 0..10 {
            let (at, smoothing_m, step) = (random.vector() * 0.5e-3, 1.3e-3, 1e-8);
            let gradients = gradients_per_m(&places, at, smoothing_m);
            for axis in 0..3 {
                let by = DVec3::AXES[axis] * step;
                let (ahead, behind) = (values(&places, at + by, smoothing_m), values(&places, at - by, smoothing_m));
                for p in 0..places.len() {
                    let difference = (ahead[p] - behind[p]) / (2.0 * step);
                    assert!((difference - gradients[p][axis]).abs() < 1e-3, "{difference} {}", gradients[p][axis]);
                }
            }
            let sum: DVec3 = gradients.iter().sum();
            assert!(sum.length() < 1e-9);
        }
    }
}
