//! Vector operations on all nodes: what a substep does to every position, velocity and force. A sum is taken in as many
//! lanes on every instruction set, which gives the same bits.
use super::{
    dispatch::{Available, Pass, run},
    real::{Real, Vector},
};
use bytemuck::{cast_slice, cast_slice_mut};
use glam::DVec3;

pub(crate) const LANES: usize = 8;
type Lanes = [f64; LANES];

/// Components, eight at a time, and the last few.
#[inline(always)]
pub(crate) fn lanes(list: &[DVec3]) -> (&[Lanes], &[f64]) {
    cast_slice::<DVec3, f64>(list).as_chunks()
}

#[inline(always)]
pub(crate) fn lanes_mut(list: &mut [DVec3]) -> (&mut [Lanes], &mut [f64]) {
    cast_slice_mut::<DVec3, f64>(list).as_chunks_mut()
}

/// Sum of as many vectors as make eight lanes, by halves: no lane waits for all others.
#[inline(always)]
pub(crate) fn total<V: Vector<Scalar = f64>>(vectors: [V; LANES]) -> f64 {
    let [a, b, c, d, e, f, g, h] = stored(vectors);
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

#[inline(always)]
fn stored<V: Vector<Scalar = f64>>(vectors: [V; LANES]) -> Lanes {
    let mut lanes = [0.0; LANES];
    for (vector, lanes) in vectors.into_iter().zip(lanes.chunks_exact_mut(V::WIDTH)) {
        vector.store(lanes);
    }
    lanes
}

/// `x ← x + h v`; returns a bound (m/s) of the largest speed: the length of `(max |v_x|, max |v_y|, max |v_z|)`.
pub(crate) fn drift(x: &mut [DVec3], v: &[DVec3], h_s: f64) -> f64 {
    run(Available::best(), Drift { x, v, h_s })
}

struct Drift<'a> {
    x: &'a mut [DVec3],
    v: &'a [DVec3],
    h_s: f64,
}

impl Pass for Drift<'_> {
    type Scalar = f64;
    type Found = f64;

    #[inline(always)]
    fn run<V: Vector<Scalar = f64>>(self) -> f64 {
        let ((xs, x_rest), (vs, v_rest)) = (lanes_mut(self.x), lanes(self.v));
        // Three blocks are eight vectors: a lane of each is always of the same axis.
        let mut most_sq = [[V::of(0.0); LANES]; 3];
        for (xs, vs) in xs.chunks_mut(3).zip(vs.chunks(3)) {
            for ((x, v), most_sq) in xs.iter_mut().zip(vs).zip(&mut most_sq) {
                for (part, first) in (0..LANES).step_by(V::WIDTH).enumerate() {
                    let v = V::load(&v[first..]);
                    (V::load(&x[first..]) + v * V::of(self.h_s)).store(&mut x[first..]);
                    most_sq[part] = (v * v).max(most_sq[part]);
                }
            }
        }
        let mut of_axis = [0.0; 3];
        for (component, most_sq) in most_sq.map(stored).as_flattened().iter().enumerate() {
            of_axis[component % 3] = Real::max(*most_sq, of_axis[component % 3]);
        }
        let done = LANES * vs.len();
        for (component, (x, v)) in x_rest.iter_mut().zip(v_rest).enumerate() {
            *x += *v * self.h_s;
            let axis = (done + component) % 3;
            of_axis[axis] = Real::max(*v * *v, of_axis[axis]);
        }
        of_axis.iter().sum::<f64>().sqrt()
    }
}

/// `f ← M⁻¹ f`, node by node; returns `f·M⁻¹ f` (N²/kg).
pub(crate) fn divide_by_masses(forces_n: &mut [DVec3], inverse_mass_per_kg: &[DVec3]) -> f64 {
    run(Available::best(), Divide { forces_n, inverse_mass_per_kg })
}

struct Divide<'a> {
    forces_n: &'a mut [DVec3],
    inverse_mass_per_kg: &'a [DVec3],
}

impl Pass for Divide<'_> {
    type Scalar = f64;
    type Found = f64;

    #[inline(always)]
    fn run<V: Vector<Scalar = f64>>(self) -> f64 {
        let ((fs, f_rest), (w, w_rest)) = (lanes_mut(self.forces_n), lanes(self.inverse_mass_per_kg));
        let mut sums = [V::of(0.0); LANES];
        for (f, w) in fs.iter_mut().zip(w) {
            for (part, first) in (0..LANES).step_by(V::WIDTH).enumerate() {
                let force = V::load(&f[first..]);
                let acceleration = force * V::load(&w[first..]);
                sums[part] = sums[part] + force * acceleration;
                acceleration.store(&mut f[first..]);
            }
        }
        let mut of_rest = 0.0;
        for (f, w) in f_rest.iter_mut().zip(w_rest) {
            let acceleration = *f * *w;
            of_rest += *f * acceleration;
            *f = acceleration;
        }
        total(sums) + of_rest
    }
}

/// `a += b`.
pub(crate) fn add(a: &mut [DVec3], b: &[DVec3]) {
    run(Available::best(), Add { a, b });
}

struct Add<'a> {
    a: &'a mut [DVec3],
    b: &'a [DVec3],
}

impl Pass for Add<'_> {
    type Scalar = f64;
    type Found = ();

    #[inline(always)]
    fn run<V: Vector<Scalar = f64>>(self) {
        let ((a, a_rest), (b, b_rest)) = (lanes_mut(self.a), lanes(self.b));
        for (a, b) in a.iter_mut().zip(b) {
            for first in (0..LANES).step_by(V::WIDTH) {
                (V::load(&a[first..]) + V::load(&b[first..])).store(&mut a[first..]);
            }
        }
        for (a, b) in a_rest.iter_mut().zip(b_rest) {
            *a += *b;
        }
    }
}

/// `Σ a·b`.
pub(crate) fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    run(Available::best(), Dot { a, b })
}

struct Dot<'a> {
    a: &'a [DVec3],
    b: &'a [DVec3],
}

impl Pass for Dot<'_> {
    type Scalar = f64;
    type Found = f64;

    #[inline(always)]
    fn run<V: Vector<Scalar = f64>>(self) -> f64 {
        let ((a, a_rest), (b, b_rest)) = (lanes(self.a), lanes(self.b));
        let mut sums = [V::of(0.0); LANES];
        for (a, b) in a.iter().zip(b) {
            for (part, first) in (0..LANES).step_by(V::WIDTH).enumerate() {
                sums[part] = sums[part] + V::load(&a[first..]) * V::load(&b[first..]);
            }
        }
        total(sums) + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
    }
}

/// Second differences of forces and of positions at three instants, the newest first; the newest forces in two parts.
#[derive(Debug)]
pub(crate) struct Answer<'a> {
    pub(crate) steady_n: &'a [DVec3],
    pub(crate) beyond_n: &'a [DVec3],
    /// At the two older instants.
    pub(crate) forces_n: [&'a [DVec3]; 2],
    pub(crate) x: [&'a [DVec3]; 3],
}

/// What [`Answer`] gives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct AnswerSums {
    /// `−Δ²f·Δ²x` (J).
    pub(crate) answer: f64,
    /// `|f|²` (N²) of the newest forces.
    pub(crate) force_sq: f64,
    /// `|Δ²x|²` (m²).
    pub(crate) moved_sq: f64,
}

impl Answer<'_> {
    pub(crate) fn sums(self) -> AnswerSums {
        run(Available::best(), self)
    }
}

impl Pass for Answer<'_> {
    type Scalar = f64;
    type Found = AnswerSums;

    #[inline(always)]
    fn run<V: Vector<Scalar = f64>>(self) -> AnswerSums {
        let ((steady, steady_rest), (beyond, beyond_rest)) = (lanes(self.steady_n), lanes(self.beyond_n));
        let [(f1, f1_rest), (f2, f2_rest)] = self.forces_n.map(lanes);
        let [(x0, x0_rest), (x1, x1_rest), (x2, x2_rest)] = self.x.map(lanes);
        let mut sums = [[V::of(0.0); LANES]; 3];
        let forces = steady.iter().zip(beyond).zip(f1.iter().zip(f2));
        for (((steady, beyond), (f1, f2)), (x0, (x1, x2))) in forces.zip(x0.iter().zip(x1.iter().zip(x2))) {
            for (part, first) in (0..LANES).step_by(V::WIDTH).enumerate() {
                let now = V::load(&steady[first..]) + V::load(&beyond[first..]);
                let force = second_difference(now, V::load(&f1[first..]), V::load(&f2[first..]));
                let [x0, x1, x2] = [V::load(&x0[first..]), V::load(&x1[first..]), V::load(&x2[first..])];
                let moved = second_difference(x0, x1, x2);
                sums[0][part] = sums[0][part] - force * moved;
                sums[1][part] = sums[1][part] + now * now;
                sums[2][part] = sums[2][part] + moved * moved;
            }
        }
        let [mut answer, mut force_sq, mut moved_sq] = sums.map(total);
        let forces = steady_rest.iter().zip(beyond_rest).zip(f1_rest.iter().zip(f2_rest));
        let positions = x0_rest.iter().zip(x1_rest.iter().zip(x2_rest));
        for (((steady, beyond), (f1, f2)), (x0, (x1, x2))) in forces.zip(positions) {
            let now = steady + beyond;
            let moved = second_difference(*x0, *x1, *x2);
            answer -= second_difference(now, *f1, *f2) * moved;
            force_sq += now * now;
            moved_sq += moved * moved;
        }
        AnswerSums { answer, force_sq, moved_sq }
    }
}

#[inline(always)]
fn second_difference<T: Real>(a0: T, a1: T, a2: T) -> T {
    (a0 - a1) - (a1 - a2)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::{lanes::InstructionSet, testing::Random};

    /// Numbers of nodes that fill blocks and that do not.
    pub(crate) const COUNTS: [usize; 6] = [0, 1, 7, 8, 29, 64];

    pub(crate) fn vectors(random: &mut Random, count: usize) -> Vec<DVec3> {
        (0..count).map(|_| random.vector()).collect()
    }

    pub(crate) fn is_near(found: f64, expected: f64) -> bool {
        (found - expected).abs() <= 1e-13 * (1.0 + expected.abs())
    }

    #[test]
    fn nodes_drift_and_none_is_faster_than_the_bound() {
        let mut random = Random(3);
        for count in COUNTS {
            let (x, v) = (vectors(&mut random, count), vectors(&mut random, count));
            let mut of_best = x.clone();
            let bound = drift(&mut of_best, &v, 0.3);
            assert!(x.iter().zip(&v).zip(&of_best).all(|((x, v), after)| *x + *v * 0.3 == *after), "{count}");
            let largest = v.iter().map(|v| v.abs()).fold(DVec3::ZERO, DVec3::max);
            assert!(is_near(bound, largest.length()) && v.iter().all(|v| v.length() <= bound), "{count}: {bound}");
            for set in InstructionSet::available() {
                let mut found = x.clone();
                let again = run(Available::at_most(set), Drift { x: &mut found, v: &v, h_s: 0.3 });
                assert!(again.to_bits() == bound.to_bits() && found == of_best, "{count} {set:?}");
            }
        }
    }

    #[test]
    fn sums_are_those_of_plain_code() {
        let mut random = Random(6);
        for count in COUNTS {
            let [a, b, c, d, e, f, g] = [0; 7].map(|_| vectors(&mut random, count));
            let dots = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
            assert!(is_near(dot(&a, &b), dots(&a, &b)));
            let divided: Vec<DVec3> = a.iter().zip(&b).map(|(a, b)| *a * *b).collect();
            let mut in_place = a.clone();
            assert!(is_near(divide_by_masses(&mut in_place, &b), dots(&a, &divided)) && in_place == divided);
            let added: Vec<DVec3> = a.iter().zip(&b).map(|(a, b)| *a + *b).collect();
            let mut in_place = a.clone();
            add(&mut in_place, &b);
            assert!(in_place == added);
            let second = |a0: &[DVec3], a1: &[DVec3], a2: &[DVec3]| -> Vec<DVec3> {
                a0.iter().zip(a1).zip(a2).map(|((a0, a1), a2)| *a0 - *a1 * 2.0 + *a2).collect()
            };
            let (force, moved) = (second(&added, &c, &d), second(&e, &f, &g));
            let answer = || Answer { steady_n: &a, beyond_n: &b, forces_n: [&c, &d], x: [&e, &f, &g] };
            let sums = answer().sums();
            assert!(is_near(sums.answer, -dots(&force, &moved)));
            assert!(is_near(sums.force_sq, dots(&added, &added)) && is_near(sums.moved_sq, dots(&moved, &moved)));
            for set in InstructionSet::available() {
                let set = Available::at_most(set);
                assert_eq!(run(set, answer()), sums);
                assert_eq!(run(set, Dot { a: &a, b: &b }), dot(&a, &b));
                let mut in_place = a.clone();
                let found = run(set, Divide { forces_n: &mut in_place, inverse_mass_per_kg: &b });
                assert!(found == divide_by_masses(&mut a.clone(), &b) && in_place == divided);
                let mut in_place = a.clone();
                run(set, Add { a: &mut in_place, b: &b });
                assert!(in_place == added);
            }
        }
    }
}
