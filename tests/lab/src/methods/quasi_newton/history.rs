//! What L-BFGS remembers: the last steps `s` and the changes `t` of the gradient along them (Nocedal 1980).
use glam::DVec3;

/// Pairs that are kept.
pub(super) const PAIRS: usize = 5;
/// Least `s·t` over `|s||t|` of a pair that is kept: less is rounding, or negative curvature.
const LEAST_CURVATURE: f64 = 1e-8;

/// The last pairs.
pub(super) struct History {
    pairs: Vec<Pair>,
    /// How many there are, and where the next one goes.
    count: usize,
    next: usize,
}

struct Pair {
    s: Vec<DVec3>,
    t: Vec<DVec3>,
    /// `1/(s·t)`.
    rho: f64,
}

impl History {
    pub(super) fn new(nodes: usize) -> Self {
        let pair = || Pair { s: vec![DVec3::ZERO; nodes], t: vec![DVec3::ZERO; nodes], rho: 0.0 };
        Self { pairs: (0..PAIRS).map(|_| pair()).collect(), count: 0, next: 0 }
    }

    pub(super) fn forget(&mut self) {
        self.count = 0;
    }

    /// Takes the step from `x` to `x_next`, where the gradient went from `g` to `g_next`.
    pub(super) fn push(&mut self, (x, x_next): (&[DVec3], &[DVec3]), (g, g_next): (&[DVec3], &[DVec3])) {
        let pair = &mut self.pairs[self.next];
        let (mut st, mut ss, mut tt) = (0.0, 0.0, 0.0);
        for (i, (s, t)) in pair.s.iter_mut().zip(&mut pair.t).enumerate() {
            *s = x_next[i] - x[i];
            *t = g_next[i] - g[i];
            st += s.dot(*t);
            ss += s.length_squared();
            tt += t.length_squared();
        }
        if st > LEAST_CURVATURE * (ss * tt).sqrt() {
            pair.rho = 1.0 / st;
            self.count = (self.count + 1).min(PAIRS);
            self.next = (self.next + 1) % PAIRS;
        }
    }

    /// `d ← −H g` by the two loops, with `H₀ = A⁻¹` that `solve` applies in place.
    pub(super) fn direction(&self, g: &[DVec3], d: &mut [DVec3], solve: impl FnOnce(&mut [DVec3])) {
        let newest_first = (1..=self.count).map(|back| (self.next + PAIRS - back) % PAIRS);
        let mut shares = [0.0; PAIRS];
        for (d, g) in d.iter_mut().zip(g) {
            *d = -*g;
        }
        for k in newest_first.clone() {
            // α_k = ρ_k s_k·q,  q ← q − α_k t_k
            let pair = &self.pairs[k];
            shares[k] = pair.rho * dot(&pair.s, d);
            add(d, -shares[k], &pair.t);
        }
        solve(d);
        for k in newest_first.rev() {
            // r ← r + s_k (α_k − ρ_k t_k·r)
            let pair = &self.pairs[k];
            let share = shares[k] - pair.rho * dot(&pair.t, d);
            add(d, share, &pair.s);
        }
    }
}

pub(super) fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    // Three sums, so that one does not wait for the other.
    a.iter().zip(b).map(|(a, b)| *a * *b).sum::<DVec3>().element_sum()
}

fn add(a: &mut [DVec3], factor: f64, b: &[DVec3]) {
    for (a, b) in a.iter_mut().zip(b) {
        *a += *b * factor;
    }
}
