//! Products of the tangent stiffness and the viscous matrix with a vector, one block of lanes at a time.
use super::{
    block::{Input, any_outside, corner_forces, gradient, load},
    laws::{Constants, M3, columns, plus, rows, scaled, viscous},
    tangents::LaneTangent,
};
use crate::lanes::nodes::Lanes;
use crate::lanes::real::{Scalar, Vector};
use glam::DMat3;

/// Corner forces `−V (α δP(F; ∇a) + β P_v(F; ∇a)) b_i` of one block: the tets' share of `−(α K + β C) a`.
#[inline(always)]
pub(crate) fn compute<V: Vector<Scalar = T>, T: Scalar, L: LaneTangent, const VISCOUS: bool, const N: usize>(
    constants: &Constants<T>,
    [elastic, viscosity]: [f64; 2],
    input: &Input<'_, T, N>,
    forces: &mut Lanes<T, N>,
) {
    let c: Constants<V> = constants.converted();
    let (alpha, beta) = (V::of(elastic), V::of(viscosity));
    let mut inside = [T::of(0.0); N];
    for first in (0..N).step_by(V::WIDTH) {
        let b: [V; 9] = load(&input.block.gradients, first);
        let minus_volume = V::load(&input.block.minus_volume[first..]);
        let h = gradient(&b, &load(input.edges, first));
        let df = gradient(&b, &load(input.edge_rates, first));
        let (dp, domain) = L::differential(&c, &h, &df);
        let mut p = scaled(&dp, alpha);
        if VISCOUS {
            p = plus(&p, &scaled(&viscous(&c, &h, &df).0, beta));
        }
        if L::DOMAIN.is_some() {
            domain.store(&mut inside[first..]);
        }
        let f = corner_forces(&b, minus_volume, &p);
        for component in 0..9 {
            f[component].store(&mut forces[component][first..]);
        }
    }
    if any_outside(&inside, L::DOMAIN) {
        redo_outside::<T, L, VISCOUS, N>(constants, [elastic, viscosity], input, &inside, forces);
    }
}

/// Lanes outside the law's domain, once more, in f64.
#[cold]
#[inline(never)]
fn redo_outside<T: Scalar, L: LaneTangent, const VISCOUS: bool, const N: usize>(
    constants: &Constants<T>,
    [elastic, viscosity]: [f64; 2],
    input: &Input<'_, T, N>,
    inside: &[T; N],
    forces: &mut Lanes<T, N>,
) {
    let limit = T::of(L::DOMAIN.unwrap_or(0.0));
    let c: Constants<f64> = constants.converted();
    for lane in 0..N {
        if inside[lane] >= limit {
            continue;
        }
        let b: [f64; 9] = input.block.gradients.map(|component| component[lane].into());
        let h = gradient(&b, &input.edges.map(|component| component[lane].into()));
        let df = gradient(&b, &input.edge_rates.map(|component| component[lane].into()));
        let dp = L::differential_outside(&c, &(columns(&h) + DMat3::IDENTITY), &columns(&df));
        let mut p: M3<f64> = scaled(&rows(&dp), elastic);
        if VISCOUS {
            p = plus(&p, &scaled(&viscous(&c, &h, &df).0, viscosity));
        }
        let f = corner_forces(&b, input.block.minus_volume[lane].into(), &p);
        for component in 0..9 {
            forces[component][lane] = T::of(f[component]);
        }
    }
}
