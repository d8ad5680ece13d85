//! Products of the tangent stiffness and the viscous matrix with a vector, one block of lanes at a time.
use super::tets::{Gathered, corner_forces, gradient, load};
use crate::lanes::{
    nodes::Lanes,
    real::{Scalar, Vector},
};
use crate::material::{
    ConstitutiveLaw,
    constants::Constants,
    crushing_limit,
    lane_matrix::{M3, columns, plus, rows, scaled},
    law::any_outside,
    viscous::lane_viscous,
};
use glam::DMat3;

/// Corner forces `−V (α δP(F; ∇a) + β P_v(F; ∇a)) b_i` of one block: the tets' part of `−(α K + β C) a`.
#[inline(always)]
pub(super) fn compute<V: Vector<Scalar = T>, T: Scalar, L: ConstitutiveLaw, const VISCOUS: bool, const N: usize>(
    constants: &Constants<T>,
    [elastic, viscosity]: [f64; 2],
    input: &Gathered<'_, T, N>,
    forces: &mut Lanes<T, N>,
) {
    let c: Constants<V> = constants.converted();
    let is_limited = constants.crushing > T::of(0.0);
    let (alpha, beta) = (V::of(elastic), V::of(viscosity));
    let mut inside = [T::of(0.0); N];
    for first in (0..N).step_by(V::WIDTH) {
        let b: [V; 9] = load(&input.rest.gradients, first);
        let minus_volume = V::load(&input.rest.minus_volume[first..]);
        let h = gradient(&b, &load(input.edges, first));
        let df = gradient(&b, &load(input.edge_rates, first));
        let mut dp = L::lane_piola_differential(&c, &h, &df);
        if is_limited {
            crushing_limit::add_lane_piola_differential(c.crushing, &h, &df, &mut dp.p);
        }
        let mut p = scaled(&dp.p, alpha);
        if VISCOUS {
            p = plus(&p, &scaled(&lane_viscous(&c, &h, &df).p, beta));
        }
        if L::DOMAIN.is_some() {
            dp.domain.store(&mut inside[first..]);
        }
        let f = corner_forces(&b, minus_volume, &p);
        for component in 0..9 {
            f[component].store(&mut forces[component][first..]);
        }
    }
    if any_outside::<L, T, N>(&inside) {
        redo_outside::<T, L, VISCOUS, N>(constants, [elastic, viscosity], input, &inside, forces);
    }
}

/// Computes lanes outside the law's domain once more, in f64.
#[cold]
#[inline(never)]
fn redo_outside<T: Scalar, L: ConstitutiveLaw, const VISCOUS: bool, const N: usize>(
    constants: &Constants<T>,
    [elastic, viscosity]: [f64; 2],
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
        let df = gradient(&b, &input.edge_rates.map(|component| component[lane].into()));
        let (f, df_columns) = (columns(&h) + DMat3::IDENTITY, columns(&df));
        let limited = crushing_limit::piola_differential(constants.crushing.into(), &f, &df_columns);
        let dp = L::piola_differential(constants.lame(), &f, &df_columns) + limited;
        let mut p: M3<f64> = scaled(&rows(&dp), elastic);
        if VISCOUS {
            p = plus(&p, &scaled(&lane_viscous(&constants.converted(), &h, &df).p, viscosity));
        }
        let f = corner_forces(&b, input.rest.minus_volume[lane].into(), &p);
        for component in 0..9 {
            forces[component][lane] = T::of(f[component]);
        }
    }
}
