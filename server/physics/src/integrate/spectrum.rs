//! The largest natural frequency of a discrete body, which bounds the step of explicit integration: `dt < 2/ω_max`.
//!
//! `K φ = ω² M φ` with lumped `M`, on the free degrees of freedom, is the symmetric problem `A y = ω² y` with
//! `A = M^{-½} K M^{-½}`. Lanczos' three-term recurrence builds the tridiagonal `T_m`; its largest eigenvalue θ approaches
//! ω²_max from below, the last component `s` of its eigenvector gives the residual `r = β_m |s|`, and an eigenvalue of
//! `A` lies within `r` of θ (Parlett 1998, §13.2). No reorthogonalisation: rounding only makes copies of converged
//! eigenvalues, and the largest one is all that is asked for.
//!
//! `K` is applied tet by tet, with the linear elasticity that every law shares at rest:
//! `f_i = −V σ b_i`, `σ = λ tr(G) I + µ(G + Gᵀ)`, `G = Σ_j a_j b_jᵀ`.
use crate::{
    fem::element::{RestTet, outer},
    material::{Lame, Material, stvk::trace},
    mesh::TetMesh,
};
use glam::{DMat3, DVec3};

/// Lanczos stops when the residual is below this fraction of θ.
const TOLERANCE: f64 = 1e-4;
/// And anyway after this many steps: the residual that is added to θ is then larger, the result as safe.
const MAX_STEPS: usize = 400;
/// Steps between looks at the tridiagonal's spectrum.
const STEPS_PER_CHECK: usize = 10;

/// `K` of a body at rest, and the springs that hold its nodes from outside, applied without being assembled.
#[derive(Debug, Clone, Copy)]
pub struct RestStiffness<'a> {
    /// The body.
    pub mesh: &'a TetMesh,
    /// Rest data of its tets.
    pub rest_tets: &'a [RestTet],
    /// Index into `materials`, one per tet.
    pub tet_material: &'a [u16],
    /// Materials.
    pub materials: &'a [Material],
    /// `k_i ≥ 0` (N/m, in all directions), one per node, or none: `K + diag(k_i)`.
    pub springs_n_per_m: &'a [f64],
}

/// ω_max (rad/s) of `K φ = ω² M φ` at rest, on the free degrees of freedom (`inverse_mass_per_kg` is zero on fixed ones);
/// zero if none is free.
///
/// A safe estimate: `√(θ + r)`, the upper end of the interval that holds the eigenvalue found, but never more than the
/// provable `√(ω_e² + max k_i/m_i)` with ω_e of [`element_bound_rad_per_s`]. With `r ≤ 1e-4 θ` it exceeds that eigenfrequency
/// by at most 1e-4. What remains is the chance that the pseudo-random start vector misses the top of the spectrum;
/// `Settings::step_safety` is there for it.
pub fn max_natural_frequency_rad_per_s(stiffness: &RestStiffness<'_>, inverse_mass_per_kg: &[DVec3]) -> f64 {
    max_natural_frequency_with(stiffness, inverse_mass_per_kg, &mut |_| {})
}

/// The same; `progress` is told the part done.
pub(crate) fn max_natural_frequency_with(
    stiffness: &RestStiffness<'_>,
    inverse_mass_per_kg: &[DVec3],
    progress: &mut dyn FnMut(f64),
) -> f64 {
    let root_inverse_mass: Vec<DVec3> = inverse_mass_per_kg.iter().map(|m| m.map(f64::sqrt)).collect();
    let mut apply = telling(progress, |a, out| stiffness.apply(a, out));
    let (theta, residual) = lanczos(&mut apply, &root_inverse_mass);
    let bound = element_bound_rad_per_s(stiffness, inverse_mass_per_kg);
    let springs = stiffness.springs_n_per_m.iter().zip(inverse_mass_per_kg);
    let spring_bound_sq = springs.map(|(k, inverse_mass)| k * inverse_mass.max_element()).fold(0.0, f64::max);
    (theta + residual).min(bound * bound + spring_bound_sq).sqrt()
}

/// `max_e ω_e ≥ ω_max` (rad/s): the frequency bound of single tets, each with its share `m_i V_e/Σ_{t∋i} V_t` of its nodes'
/// masses (Irons & Treharne 1971: by Rayleigh's quotient no assembly of elements is faster than the fastest of them).
///
/// Per tet `aᵀK_e a = V(λ tr²G + ½µ|G + Gᵀ|²) ≤ V(3λ⁺ + 2µ)|G|²` and `|G|² ≤ λ_max(Σ_i b_i b_iᵀ/m_i) aᵀM_e a`.
///
/// The springs are left out.
pub fn element_bound_rad_per_s(stiffness: &RestStiffness<'_>, inverse_mass_per_kg: &[DVec3]) -> f64 {
    let RestStiffness { mesh, rest_tets, tet_material, materials, .. } = *stiffness;
    let mut volume_of_node = vec![0.0; inverse_mass_per_kg.len()];
    for (nodes, rest) in mesh.tets().iter().zip(rest_tets) {
        for &node in nodes {
            volume_of_node[node as usize] += rest.volume_m3;
        }
    }
    let mut largest_sq = 0.0_f64;
    for ((nodes, rest), &material) in mesh.tets().iter().zip(rest_tets).zip(tet_material) {
        let Lame { lambda_pa, mu_pa } = materials[material as usize].lame;
        let gram = nodes.iter().zip(rest.gradients_per_m).fold(DMat3::ZERO, |sum, (&node, b)| {
            let share = rest.volume_m3 / volume_of_node[node as usize];
            sum + outer(b, b) * (inverse_mass_per_kg[node as usize].max_element() / share)
        });
        let modulus = 3.0 * lambda_pa.max(0.0) + 2.0 * mu_pa;
        largest_sq = largest_sq.max(rest.volume_m3 * modulus * largest_eigenvalue(&gram));
    }
    largest_sq.sqrt()
}

/// Largest eigenvalue of a symmetric positive semi-definite 3×3 matrix, in closed form: with `q = tr A/3`,
/// `p = √(|A − qI|²/6)`, `B = (A − qI)/p`: `λ_max = q + 2p cos(⅓ arccos(½ det B))`.
pub(crate) fn largest_eigenvalue(a: &DMat3) -> f64 {
    let q = trace(a) / 3.0;
    let deviator = *a - DMat3::from_diagonal(DVec3::splat(q));
    let p = (crate::material::stvk::contract(&deviator, &deviator) / 6.0).sqrt();
    if p == 0.0 {
        return q;
    }
    let half_det = (deviator * (1.0 / p)).determinant() * 0.5;
    q + 2.0 * p * (half_det.clamp(-1.0, 1.0).acos() / 3.0).cos()
}

impl RestStiffness<'_> {
    /// `out ← K a`.
    fn apply(&self, a: &[DVec3], out: &mut [DVec3]) {
        out.fill(DVec3::ZERO);
        for ((nodes, rest), &material) in self.mesh.tets().iter().zip(self.rest_tets).zip(self.tet_material) {
            let Lame { lambda_pa, mu_pa } = self.materials[material as usize].lame;
            let g = rest.gradient_of(&nodes.map(|n| a[n as usize]));
            let sigma = (g + g.transpose()) * mu_pa + DMat3::from_diagonal(DVec3::splat(lambda_pa * trace(&g)));
            for (&node, force) in nodes.iter().zip(rest.corner_forces_n(&sigma)) {
                out[node as usize] -= force;
            }
        }
        for ((out, a), spring) in out.iter_mut().zip(a).zip(self.springs_n_per_m) {
            *out += *a * *spring;
        }
    }
}

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

/// Largest eigenvalue θ of `A = D K D`, `D = M^{-½}`, and its residual `r` (both rad²/s²). `apply` overwrites its second argument with K times its
/// first.
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

/// A unit vector of pseudo-random components on the free degrees of freedom: the same on every machine and in every run.
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

/// Largest eigenvalue of a symmetric tridiagonal matrix and the last component of its unit eigenvector (absolute value).
///
/// Bisection on the sign count of `T − σI = L D Lᵀ` (Sylvester's inertia: as many negative pivots as eigenvalues below σ),
/// between the largest diagonal entry and Gershgorin's bound.
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
