//! Kicks of all nodes: what forces and damping do to velocities, and the power of it.
use super::{
    dispatch::{Available, Pass, run},
    real::{Real, Vector},
    vector_operations::{LANES, lanes, lanes_mut, total},
};
use glam::DVec3;

/// `v ← (v k + h a) k` with `k` what damping leaves, component by component: `1 − free (1 − factor)` where `free_parts`
/// are given, `factor` behind. Finds `Σ e·(v k + ½ h a)` (W), with `e` the `external_n`.
#[derive(Debug)]
pub(crate) struct Kick<'a> {
    pub(crate) v: &'a mut [DVec3],
    pub(crate) accelerations: &'a [DVec3],
    pub(crate) external_n: &'a [DVec3],
    /// 1 on free axes of the first nodes, 0 on held ones.
    pub(crate) free_parts: &'a [DVec3],
    pub(crate) factor: f64,
    pub(crate) h_s: f64,
}

impl Kick<'_> {
    pub(crate) fn give(self) -> f64 {
        run(Available::best(), self)
    }
}

impl Pass for Kick<'_> {
    type Scalar = f64;
    type Found = f64;

    #[inline(always)]
    fn run<V: Vector<Scalar = f64>>(self) -> f64 {
        let Self { v, accelerations, external_n, free_parts, factor, h_s } = self;
        let nodes = free_parts.len();
        let (v_nodes, v_others) = v.split_at_mut(nodes);
        let (a_nodes, a_others) = accelerations.split_at(nodes);
        let (e_nodes, e_others) = external_n.split_at(nodes);
        let gone = 1.0 - factor;
        let mut power_w = [V::of(0.0); LANES];
        let mut of_rest_w = 0.0;
        let ((vs, v_rest), (a, a_rest)) = (lanes_mut(v_nodes), lanes(a_nodes));
        let ((e, e_rest), (free, free_rest)) = (lanes(e_nodes), lanes(free_parts));
        for ((v, a), (e, free)) in vs.iter_mut().zip(a).zip(e.iter().zip(free)) {
            for (part, first) in (0..LANES).step_by(V::WIDTH).enumerate() {
                let factor = V::of(1.0) - V::load(&free[first..]) * V::of(gone);
                let found = kicked(V::load(&v[first..]), V::load(&a[first..]) * V::of(h_s), factor);
                found[0].store(&mut v[first..]);
                power_w[part] = power_w[part] + V::load(&e[first..]) * found[1];
            }
        }
        for ((v, a), (e, free)) in v_rest.iter_mut().zip(a_rest).zip(e_rest.iter().zip(free_rest)) {
            let [after, middle] = kicked(*v, *a * h_s, 1.0 - free * gone);
            *v = after;
            of_rest_w += e * middle;
        }
        let ((vs, v_rest), (a, a_rest), (e, e_rest)) = (lanes_mut(v_others), lanes(a_others), lanes(e_others));
        for ((v, a), e) in vs.iter_mut().zip(a).zip(e) {
            for (part, first) in (0..LANES).step_by(V::WIDTH).enumerate() {
                let found = kicked(V::load(&v[first..]), V::load(&a[first..]) * V::of(h_s), V::of(factor));
                found[0].store(&mut v[first..]);
                power_w[part] = power_w[part] + V::load(&e[first..]) * found[1];
            }
        }
        for ((v, a), e) in v_rest.iter_mut().zip(a_rest).zip(e_rest) {
            let [after, middle] = kicked(*v, *a * h_s, factor);
            *v = after;
            of_rest_w += e * middle;
        }
        total(power_w) + of_rest_w
    }
}

/// `v ← (v k + h f/m) k` of nodes that move along all axes or none. Finds `Σ e·(v k + ½ h f/m)` (W), with `e` the
/// `external_n`, and `Σ m v²` before and after the force, but for what damping takes then.
#[derive(Debug)]
pub(crate) struct LumpedKick<'a> {
    pub(crate) v: &'a mut [DVec3],
    pub(crate) forces_n: &'a [DVec3],
    pub(crate) external_n: &'a [DVec3],
    /// On each axis; 0 of nodes that are held, whose velocity is 0.
    pub(crate) mass_kg: &'a [DVec3],
    /// 0 of them, too.
    pub(crate) inverse_mass_per_kg: &'a [DVec3],
    pub(crate) factor: f64,
    pub(crate) h_s: f64,
}

impl LumpedKick<'_> {
    pub(crate) fn give(self) -> [f64; 3] {
        run(Available::best(), self)
    }
}

impl Pass for LumpedKick<'_> {
    type Scalar = f64;
    type Found = [f64; 3];

    #[inline(always)]
    fn run<V: Vector<Scalar = f64>>(self) -> [f64; 3] {
        let ((vs, v_rest), (f, f_rest)) = (lanes_mut(self.v), lanes(self.forces_n));
        let ((e, e_rest), (m, m_rest)) = (lanes(self.external_n), lanes(self.mass_kg));
        let (w, w_rest) = lanes(self.inverse_mass_per_kg);
        let mut sums = [[V::of(0.0); LANES]; 3];
        for (((v, f), e), (m, w)) in vs.iter_mut().zip(f).zip(e).zip(m.iter().zip(w)) {
            for (part, first) in (0..LANES).step_by(V::WIDTH).enumerate() {
                let before = V::load(&v[first..]);
                let change = V::load(&f[first..]) * V::load(&w[first..]) * V::of(self.h_s);
                let [after, middle] = kicked(before, change, V::of(self.factor));
                after.store(&mut v[first..]);
                let mass = V::load(&m[first..]);
                let undamped = before * V::of(self.factor) + change;
                sums[0][part] = sums[0][part] + V::load(&e[first..]) * middle;
                sums[1][part] = sums[1][part] + mass * before * before;
                sums[2][part] = sums[2][part] + mass * undamped * undamped;
            }
        }
        let mut of_rest = [0.0; 3];
        for (((v, f), e), (m, w)) in v_rest.iter_mut().zip(f_rest).zip(e_rest).zip(m_rest.iter().zip(w_rest)) {
            let (before, change) = (*v, *f * *w * self.h_s);
            let [after, middle] = kicked(before, change, self.factor);
            *v = after;
            let undamped = before * self.factor + change;
            of_rest[0] += *e * middle;
            of_rest[1] += *m * before * before;
            of_rest[2] += *m * undamped * undamped;
        }
        std::array::from_fn(|sum| total(sums[sum]) + of_rest[sum])
    }
}

/// `(v k + c) k`, and `v k + ½ c`.
#[inline(always)]
fn kicked<T: Real>(v: T, change: T, factor: T) -> [T; 2] {
    let damped = v * factor;
    [(damped + change) * factor, damped + change * T::of(0.5)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::vector_operations::tests::{COUNTS, is_near, vectors};
    use crate::{lanes::InstructionSet, testing::Random};

    #[test]
    fn kicks_are_those_of_plain_code() {
        let mut random = Random(4);
        for count in COUNTS {
            let [v, a, e] = [0; 3].map(|_| vectors(&mut random, count));
            for (factor, free) in [(1.0, 0), (0.9, 0), (0.9, count / 2), (0.9, count)] {
                let free_parts: Vec<DVec3> = (0..free).map(|i| DVec3::new(1.0, f64::from(i % 2 == 0), 0.0)).collect();
                let mut expected_w = 0.0;
                let expected: Vec<DVec3> = (0..count)
                    .map(|i| {
                        let left = free_parts.get(i).map_or(DVec3::splat(factor), |free| 1.0 - *free * (1.0 - factor));
                        expected_w += e[i].dot(v[i] * left + a[i] * 0.05);
                        (v[i] * left + a[i] * 0.1) * left
                    })
                    .collect();
                let run = |set| {
                    let (mut v, free_parts) = (v.clone(), &free_parts[..]);
                    let kick = Kick { v: &mut v, accelerations: &a, external_n: &e, free_parts, factor, h_s: 0.1 };
                    (run(set, kick), v)
                };
                let (power_w, kicked) = run(Available::best());
                assert!(is_near(power_w, expected_w), "{power_w} {expected_w}");
                assert!(kicked.iter().zip(&expected).all(|(a, b)| a.distance(*b) < 1e-15), "{count} {factor} {free}");
                assert!(
                    InstructionSet::available()
                        .into_iter()
                        .all(|set| run(Available::at_most(set)) == (power_w, kicked.clone()))
                );
            }
        }
    }

    #[test]
    fn lumped_kicks_are_those_of_plain_code() {
        let mut random = Random(9);
        for (count, factor) in COUNTS.into_iter().flat_map(|count| [(count, 1.0), (count, 0.9)]) {
            let [mut v, forces_n, external_n, mass] = [0; 4].map(|_| vectors(&mut random, count));
            let is_held = |i: usize| i % 5 == 2;
            let mass_kg: Vec<DVec3> = (0..count)
                .map(|i| if is_held(i) { DVec3::ZERO } else { DVec3::splat(0.1 + mass[i].x.abs()) })
                .collect();
            let inverse: Vec<DVec3> = mass_kg.iter().map(|m| if m.x > 0.0 { m.recip() } else { DVec3::ZERO }).collect();
            v.iter_mut().enumerate().filter(|(i, _)| is_held(*i)).for_each(|(_, v)| *v = DVec3::ZERO);
            let h_s = 0.1;
            let mut sums = [0.0; 3];
            let expected: Vec<DVec3> = (0..count)
                .map(|i| {
                    let kicked = v[i] * factor + forces_n[i] * inverse[i] * h_s;
                    sums[0] += external_n[i].dot((v[i] * factor + kicked) * 0.5);
                    sums[1] += mass_kg[i].x * v[i].length_squared();
                    sums[2] += mass_kg[i].x * kicked.length_squared();
                    kicked * factor
                })
                .collect();
            let run = |set| {
                let mut v = v.clone();
                let (forces_n, external_n, mass_kg) = (&forces_n[..], &external_n[..], &mass_kg[..]);
                let inverse_mass_per_kg = &inverse[..];
                let kick = LumpedKick { v: &mut v, forces_n, external_n, mass_kg, inverse_mass_per_kg, factor, h_s };
                (run(set, kick), v)
            };
            let (found, kicked) = run(Available::best());
            assert!(found.iter().zip(&sums).all(|(a, b)| is_near(*a, *b)), "{count}: {found:?} {sums:?}");
            assert!(kicked.iter().zip(&expected).all(|(a, b)| a.distance(*b) < 1e-14), "{count} {factor}");
            assert!((0..count).filter(|i| is_held(*i)).all(|i| kicked[i] == DVec3::ZERO));
            let same = |set| run(Available::at_most(set)) == (found, kicked.clone());
            assert!(InstructionSet::available().into_iter().all(same), "{count}");
        }
    }
}
