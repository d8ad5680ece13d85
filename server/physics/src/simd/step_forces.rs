//! Sums over all nodes that judge a step (`integrate::stability`): plain loops, compiled for several instruction sets, whose lanes are
//! added in the same order on all of them.
use bytemuck::cast_slice;
use glam::DVec3;

const LANES: usize = 8;

/// Forces `f` (N) at three instants, the newest first, their external parts `e` (N), and `M⁻¹` (1/kg), zero on held axes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StepForces<'a> {
    pub(crate) total_n: [&'a [DVec3]; 3],
    pub(crate) external_n: [&'a [DVec3]; 3],
    pub(crate) inverse_mass_per_kg: &'a [DVec3],
}

impl StepForces<'_> {
    /// `‖Δ²(f − e)‖²`, and `‖f‖²` at the two older instants, with `‖a‖² = aᵀ M⁻¹ a` (N²/kg).
    #[inline(always)]
    pub(crate) fn sums(&self) -> [f64; 3] {
        let [f0, f1, f2] = self.total_n.map(|list| cast_slice::<DVec3, f64>(list).as_chunks::<LANES>());
        let [e0, e1, e2] = self.external_n.map(|list| cast_slice::<DVec3, f64>(list).as_chunks::<LANES>());
        let w = cast_slice::<DVec3, f64>(self.inverse_mass_per_kg).as_chunks::<LANES>();
        let mut sums = [[0.0_f64; LANES]; 3];
        for ((w, (f0, e0)), ((f1, e1), (f2, e2))) in
            w.0.iter().zip(f0.0.iter().zip(e0.0)).zip(f1.0.iter().zip(e1.0).zip(f2.0.iter().zip(e2.0)))
        {
            add(&mut sums, w, [f0, f1, f2], [e0, e1, e2]);
        }
        let [f, e] = [[f0.1, f1.1, f2.1], [e0.1, e1.1, e2.1]].map(|rest| rest.map(filled));
        add(&mut sums, &filled(w.1), [&f[0], &f[1], &f[2]], [&e[0], &e[1], &e[2]]);
        sums.map(|lanes| lanes.iter().sum())
    }
}

/// The last few, with zeros behind them.
#[inline(always)]
fn filled(rest: &[f64]) -> [f64; LANES] {
    std::array::from_fn(|lane| rest.get(lane).copied().unwrap_or(0.0))
}

#[inline(always)]
fn add(
    sums: &mut [[f64; LANES]; 3],
    w: &[f64; LANES],
    [f0, f1, f2]: [&[f64; LANES]; 3],
    [e0, e1, e2]: [&[f64; LANES]; 3],
) {
    let [answer, one, two] = sums;
    for lane in 0..LANES {
        let second = (f0[lane] - e0[lane]) - 2.0 * (f1[lane] - e1[lane]) + (f2[lane] - e2[lane]);
        answer[lane] += second * second * w[lane];
        one[lane] += f1[lane] * f1[lane] * w[lane];
        two[lane] += f2[lane] * f2[lane] * w[lane];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::{InstructionSet, dispatch};

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
        let sums = forces.sums();
        for (sum, by_node) in sums.iter().zip(by_node) {
            assert!((sum - by_node).abs() < 1e-13 * by_node, "{sum} {by_node}");
        }
        for set in InstructionSet::available() {
            assert_eq!(dispatch::step_force_sums(dispatch::Available::at_most(set), &forces), sums, "{set:?}");
        }
    }
}
