//! Lanczos' method for the largest eigenvalue of `K φ = ω² M φ` with a lumped mass matrix `M`.
//!
//! On the free degrees of freedom it is the symmetric problem `A y = ω² y` with `A = M^{-½} K M^{-½}`. The three-term
//! recurrence builds the tridiagonal `T_m`; its largest eigenvalue θ approaches ω²_max from below, the last component
//! `s` of its eigenvector gives the residual `r = β_m |s|`, and an eigenvalue of `A` lies within `r` of θ (Parlett
//! 1998, §13.2). There is no reorthogonalisation: rounding only makes copies of converged eigenvalues, and the largest
//! one is all that is asked for.
use glam::DVec3;

/// Lanczos stops when the residual is below this fraction of θ.
const TOLERANCE: f64 = 1e-4;
/// And anyway after this many steps: the residual that is added to θ is then larger, the result as safe.
const MAX_STEPS: usize = 400;
/// Steps between looks at the tridiagonal's spectrum.
const STEPS_PER_CHECK: usize = 10;

/// Products that tell how far Lanczos' method is; how many it takes is not known beforehand, some 30 to 80.
pub(crate) fn telling<'a>(
    progress: &'a mut dyn FnMut(f64),
    mut apply: impl FnMut(&[DVec3], &mut [DVec3]) + 'a,
) -> impl FnMut(&[DVec3], &mut [DVec3]) + 'a {
    let mut products = 0.0;
    move |a, out| {
        apply(a, out);
        products += 1.0;
        progress(1.0 - f64::exp(-products / 30.0));
    }
}

/// Largest eigenvalue θ of `A = D K D`, `D = M^{-½}`, and its residual `r` (both rad²/s²). `apply` overwrites its
/// second argument with K times its first.
pub(crate) fn lanczos(apply: &mut dyn FnMut(&[DVec3], &mut [DVec3]), root_inverse_mass: &[DVec3]) -> (f64, f64) {
    lanczos_to(TOLERANCE, apply, root_inverse_mass)
}

/// The same until the residual is below a fraction of θ.
pub(crate) fn lanczos_to(
    tolerance: f64,
    apply: &mut dyn FnMut(&[DVec3], &mut [DVec3]),
    root_inverse_mass: &[DVec3],
) -> (f64, f64) {
    let free = root_inverse_mass.iter().flat_map(DVec3::to_array).filter(|&d| d > 0.0).count();
    let mut current = start_vector(root_inverse_mass);
    let mut previous = vec![DVec3::ZERO; current.len()];
    let mut scaled = previous.clone();
    let mut next = previous.clone();
    let (mut diagonal, mut off_diagonal): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    let steps = free.min(MAX_STEPS);
    let mut best = (0.0, 0.0);
    let mut beta = 0.0;
    for step in 1..=steps {
        // w = A q_k − β_{k−1} q_{k−1};  α_k = w·q_k;  w ← w − α_k q_k;  β_k = |w|;  q_{k+1} = w/β_k
        for ((scaled, q), d) in scaled.iter_mut().zip(&current).zip(root_inverse_mass) {
            *scaled = *q * *d;
        }
        apply(&scaled, &mut next);
        for ((w, d), p) in next.iter_mut().zip(root_inverse_mass).zip(&previous) {
            *w = *w * *d - *p * beta;
        }
        let alpha = dot(&next, &current);
        for (w, q) in next.iter_mut().zip(&current) {
            *w -= *q * alpha;
        }
        beta = dot(&next, &next).sqrt();
        diagonal.push(alpha);
        let exhausted = step == steps || beta <= 1e-14 * alpha.abs();
        if exhausted || step % STEPS_PER_CHECK == 0 {
            let (theta, last) = largest_of_tridiagonal(&diagonal, &off_diagonal);
            best = (theta, beta * last);
            if exhausted || best.1 <= tolerance * theta {
                break;
            }
        }
        off_diagonal.push(beta);
        for w in &mut next {
            *w /= beta;
        }
        std::mem::swap(&mut previous, &mut current);
        std::mem::swap(&mut current, &mut next);
    }
    best
}

/// A unit vector of pseudo-random components on the free degrees of freedom: the same on every machine and in every
/// run.
fn start_vector(root_inverse_mass: &[DVec3]) -> Vec<DVec3> {
    let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = |d: f64| {
        // xorshift64 (Marsaglia 2003)
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        if d > 0.0 { (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5 } else { 0.0 }
    };
    let mut start: Vec<DVec3> =
        root_inverse_mass.iter().map(|d| DVec3::new(random(d.x), random(d.y), random(d.z))).collect();
    let length = dot(&start, &start).sqrt();
    for q in start.iter_mut().filter(|_| length > 0.0) {
        *q /= length;
    }
    start
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

/// Largest eigenvalue of a symmetric tridiagonal matrix and the last component of its unit eigenvector (absolute
/// value).
///
/// Bisection on the sign count of `T − σI = L D Lᵀ` (Sylvester's inertia: as many negative pivots as eigenvalues below
/// σ), between the largest diagonal entry and Gershgorin's bound.
fn largest_of_tridiagonal(diagonal: &[f64], off_diagonal: &[f64]) -> (f64, f64) {
    let n = diagonal.len();
    let off = |k: usize| off_diagonal.get(k).copied().unwrap_or(0.0);
    let below = |k: usize| if k == 0 { 0.0 } else { off(k - 1) };
    let mut low = diagonal.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut high = (0..n).map(|k| diagonal[k] + below(k) + off(k)).fold(f64::NEG_INFINITY, f64::max);
    let all_below = |sigma: f64| {
        let mut pivot = diagonal[0] - sigma;
        for k in 1..n {
            if pivot >= 0.0 {
                return false;
            }
            pivot = diagonal[k] - sigma - off(k - 1).powi(2) / pivot;
        }
        pivot < 0.0
    };
    while high - low > 1e-14 * high.abs() {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if all_below(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    (high, last_component(diagonal, off_diagonal, high))
}

/// `|s_n|` of the unit eigenvector of the eigenvalue θ: with the pivots `d_k` of `T − θI` from the top,
/// `s_k = −β_k s_{k+1}/d_k`, started from `s_n = 1`. Every `d_k` but the last is negative at the largest eigenvalue.
fn last_component(diagonal: &[f64], off_diagonal: &[f64], theta: f64) -> f64 {
    let n = diagonal.len();
    let mut pivots = Vec::with_capacity(n);
    for k in 0..n {
        let coupling = if k == 0 { 0.0 } else { off_diagonal[k - 1].powi(2) / pivots[k - 1] };
        pivots.push(diagonal[k] - theta - coupling);
    }
    let (mut component, mut length_sq) = (1.0_f64, 1.0_f64);
    for k in (0..n - 1).rev() {
        component *= -off_diagonal[k] / pivots[k];
        length_sq += component * component;
        if length_sq > 1e200 {
            return 0.0;
        }
    }
    1.0 / length_sq.sqrt()
}
