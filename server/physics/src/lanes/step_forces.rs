//! Sums over all nodes that judge a step (`integrate::stability`), in as many lanes on every instruction set: the same
//! bits.
use super::{
    dispatch::{Available, Pass, run},
    real::Vector,
    vector_operations::{LANES, lanes, total},
};
use glam::DVec3;

/// Forces `f` (N) at three instants, the newest first, their external parts `e` (N), and `M⁻¹` (1/kg), zero on held
/// axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StepForces<'a> {
    pub(crate) total_n: [&'a [DVec3]; 3],
    pub(crate) external_n: [&'a [DVec3]; 3],
    pub(crate) inverse_mass_per_kg: &'a [DVec3],
}

impl StepForces<'_> {
    /// `‖Δ²(f − e)‖²`, and `‖f‖²` at the two older instants, with `‖a‖² = aᵀ M⁻¹ a` (N²/kg).
    pub(crate) fn sums(self) -> [f64; 3] {
        run(Available::best(), self)
    }
}

impl Pass for StepForces<'_> {
    type Scalar = f64;
    type Found = [f64; 3];

    #[inline(always)]
    fn run<V: Vector<Scalar = f64>>(self) -> [f64; 3] {
        let [f0, f1, f2] = self.total_n.map(lanes);
        let [e0, e1, e2] = self.external_n.map(lanes);
        let w = lanes(self.inverse_mass_per_kg);
        let mut sums = [[V::of(0.0); LANES]; 3];
        for ((w, (f0, e0)), ((f1, e1), (f2, e2))) in
            w.0.iter().zip(f0.0.iter().zip(e0.0)).zip(f1.0.iter().zip(e1.0).zip(f2.0.iter().zip(e2.0)))
        {
            add(&mut sums, w, [f0, f1, f2], [e0, e1, e2]);
        }
        let [f, e] = [[f0.1, f1.1, f2.1], [e0.1, e1.1, e2.1]].map(|rest| rest.map(filled));
        add(&mut sums, &filled(w.1), [&f[0], &f[1], &f[2]], [&e[0], &e[1], &e[2]]);
        sums.map(total)
    }
}

/// The last few, with zeros behind them.
fn filled(rest: &[f64]) -> [f64; LANES] {
    std::array::from_fn(|lane| rest.get(lane).copied().unwrap_or(0.0))
}

#[inline(always)]
fn add<V: Vector<Scalar = f64>>(
    [answer, one, two]: &mut [[V; LANES]; 3],
    w: &[f64; LANES],
    [f0, f1, f2]: [&[f64; LANES]; 3],
    [e0, e1, e2]: [&[f64; LANES]; 3],
) {
    for part in 0..LANES / V::WIDTH {
        let at = |list: &[f64; LANES]| V::load(&list[part * V::WIDTH..]);
        let (w, f1, f2) = (at(w), at(f1), at(f2));
        let middle = f1 - at(e1);
        let second = (at(f0) - at(e0)) - (middle + middle) + (f2 - at(e2));
        answer[part] = answer[part] + second * second * w;
        one[part] = one[part] + f1 * f1 * w;
        two[part] = two[part] + f2 * f2 * w;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::InstructionSet;

    /// Pseudo-random vectors, a number of nodes that fills no block.
    fn list(seed: u32) -> Vec<DVec3> {
        let component =
            |i: u32| f64::from((i.wrapping_mul(2_654_435_761) ^ seed.wrapping_mul(40_503)) >> 8) / 1e7 - 0.8;
        (0..37).map(|i| DVec3::new(component(3 * i), component(3 * i + 1), component(3 * i + 2))).collect()
    }

    #[test]
    fn every_instruction_set_gives_the_sums_and_the_same_bits() {
        let lists: Vec<Vec<DVec3>> = (1..=6).map(list).collect();
        let mut weights: Vec<DVec3> = list(7).iter().map(|a| a.abs()).collect();
        weights[5].y = 0.0;
        let forces = StepForces {
            total_n: [&lists[0], &lists[1], &lists[2]],
            external_n: [&lists[3], &lists[4], &lists[5]],
            inverse_mass_per_kg: &weights,
        };
        let mut by_node = [0.0; 3];
        for (n, w) in weights.iter().enumerate() {
            let g = |instant: usize| lists[instant][n] - lists[instant + 3][n];
            let second = g(0) - 2.0 * g(1) + g(2);
            for (sum, a) in by_node.iter_mut().zip([second, lists[1][n], lists[2][n]]) {
                *sum += (a * a).dot(*w);
            }
        }
        let sums = forces.run::<f64>();
        for (sum, by_node) in sums.iter().zip(by_node) {
            assert!((sum - by_node).abs() < 1e-13 * by_node, "{sum} {by_node}");
        }
        for set in InstructionSet::available() {
            assert_eq!(run(Available::at_most(set), forces), sums, "{set:?}");
        }
    }
}
