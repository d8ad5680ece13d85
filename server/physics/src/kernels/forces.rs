//! Forces of elastic and viscous stress, one block of lanes at a time.
use super::tets::{Gathered, corner_forces, gradient, load};
use crate::lanes::{
    nodes::Lanes,
    real::{Scalar, Vector},
};
use crate::material::{
    ConstitutiveLaw,
    constants::Constants,
    crushing_limit,
    lane_matrix::{M3, columns, plus, rows},
    law::any_outside,
    viscous::lane_viscous,
};
use glam::DMat3;

/// Forces of one block; returns the viscous power (W).
#[inline(always)]
pub(super) fn compute<V: Vector<Scalar = T>, T: Scalar, L: ConstitutiveLaw, const VISCOUS: bool, const N: usize>(
    constants: &Constants<T>,
    input: &Gathered<'_, T, N>,
    forces: &mut Lanes<T, N>,
) -> f64 {
    let c: Constants<V> = constants.converted();
    let is_limited = constants.crushing > T::of(0.0);
    let mut inside = [T::of(0.0); N];
    let mut power = [T::of(0.0); N];
    for first in (0..N).step_by(V::WIDTH) {
        let b: [V; 9] = load(&input.rest.gradients, first);
        let minus_volume = V::load(&input.rest.minus_volume[first..]);
        let h = gradient(&b, &load(input.edges, first));
        let mut stress = L::lane_piola(&c, &h);
        if is_limited {
            crushing_limit::add_lane_piola(c.crushing, &h, &mut stress.p);
        }
        if VISCOUS {
            let viscous = lane_viscous(&c, &h, &gradient(&b, &load(input.edge_rates, first)));
            stress.p = plus(&stress.p, &viscous.p);
            (V::of(0.0) - viscous.power_density * minus_volume).store(&mut power[first..]);
        }
        if L::DOMAIN.is_some() {
            stress.domain.store(&mut inside[first..]);
        }
        let f = corner_forces(&b, minus_volume, &stress.p);
        for component in 0..9 {
            f[component].store(&mut forces[component][first..]);
        }
    }
    if any_outside::<L, T, N>(&inside) {
        redo_outside::<T, L, VISCOUS, N>(constants, input, &inside, forces);
    }
    if VISCOUS { power.iter().fold(0.0, |sum, &p| sum + p.into()) } else { 0.0 }
}

/// Computes lanes outside the law's domain once more, in f64.
#[cold]
#[inline(never)]
fn redo_outside<T: Scalar, L: ConstitutiveLaw, const VISCOUS: bool, const N: usize>(
    constants: &Constants<T>,
    input: &Gathered<'_, T, N>,
    inside: &[T; N],
    forces: &mut Lanes<T, N>,
) {
    let limit = T::of(L::DOMAIN.unwrap_or(0.0));
    for lane in 0..N {
        if inside[lane] >= limit {
            continue;
        }
        let b: [f64; 9] = input.rest.gradients.map(|component| component[lane].into());
        let h = gradient(&b, &input.edges.map(|component| component[lane].into()));
        let f = columns(&h) + DMat3::IDENTITY;
        let limited = crushing_limit::piola(constants.crushing.into(), &f);
        let mut p: M3<f64> = rows(&(L::piola(constants.lame(), &f) + limited));
        if VISCOUS {
            let h_dot = gradient(&b, &input.edge_rates.map(|component| component[lane].into()));
            p = plus(&p, &lane_viscous(&constants.converted(), &h, &h_dot).p);
        }
        let f = corner_forces(&b, input.rest.minus_volume[lane].into(), &p);
        for component in 0..9 {
            forces[component][lane] = T::of(f[component]);
        }
    }
}
