//! Eigenvalues of small dense symmetric matrices by cyclic Jacobi rotations: accurate to rounding, any size up to
//! dozens.

/// Eigenvalues, and eigenvectors as rows, of the symmetric `n × n` matrix in `a` (row-major; overwritten).
///
/// Each rotation zeroes `a_pq`: with `θ = (a_qq − a_pp)/(2a_pq)`, `t = sgn(θ)/(|θ| + √(θ² + 1))`, `c = 1/√(t² + 1)`,
/// `s = tc` (Golub & Van Loan, Matrix Computations, 8.5).
pub(crate) fn symmetric(a: &mut [f64], n: usize) -> (Vec<f64>, Vec<f64>) {
    let mut vectors = vec![0.0; n * n];
    for i in 0..n {
        vectors[i * n + i] = 1.0;
    }
    let scale: f64 = a.iter().map(|v| v * v).sum();
    for _sweep in 0..40 {
        let off: f64 = (0..n).flat_map(|p| (p + 1..n).map(move |q| (p, q))).map(|(p, q)| a[p * n + q].powi(2)).sum();
        if off <= 1e-32 * scale {
            break;
        }
        for p in 0..n {
            for q in p + 1..n {
                rotate(a, &mut vectors, n, p, q);
            }
        }
    }
    ((0..n).map(|i| a[i * n + i]).collect(), vectors)
}

fn rotate(a: &mut [f64], vectors: &mut [f64], n: usize, p: usize, q: usize) {
    let apq = a[p * n + q];
    if apq == 0.0 {
        return;
    }
    let theta = (a[q * n + q] - a[p * n + p]) / (2.0 * apq);
    let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
    let c = 1.0 / (t * t + 1.0).sqrt();
    let s = t * c;
    for k in 0..n {
        let (akp, akq) = (a[k * n + p], a[k * n + q]);
        a[k * n + p] = c * akp - s * akq;
        a[k * n + q] = s * akp + c * akq;
    }
    for k in 0..n {
        let (apk, aqk) = (a[p * n + k], a[q * n + k]);
        a[p * n + k] = c * apk - s * aqk;
        a[q * n + k] = s * apk + c * aqk;
        let (vpk, vqk) = (vectors[p * n + k], vectors[q * n + k]);
        vectors[p * n + k] = c * vpk - s * vqk;
        vectors[q * n + k] = s * vpk + c * vqk;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_with_known_spectrum_comes_apart() {
        // tridiag(−1, 2, −1): λ_k = 2 − 2 cos(kπ/(n + 1)).
        let n = 9;
        let mut a = vec![0.0; n * n];
        for i in 0..n {
            a[i * n + i] = 2.0;
            if i > 0 {
                a[i * n + i - 1] = -1.0;
                a[(i - 1) * n + i] = -1.0;
            }
        }
        let original = a.clone();
        let (values, vectors) = symmetric(&mut a, n);
        let mut sorted = values.clone();
        sorted.sort_by(f64::total_cmp);
        for (k, value) in sorted.iter().enumerate() {
            let exact = 2.0 - 2.0 * ((k + 1) as f64 * std::f64::consts::PI / (n + 1) as f64).cos();
            assert!((value - exact).abs() < 1e-14, "{value} {exact}");
        }
        for k in 0..n {
            let v = &vectors[k * n..(k + 1) * n];
            for i in 0..n {
                let av: f64 = (0..n).map(|j| original[i * n + j] * v[j]).sum();
                assert!((av - values[k] * v[i]).abs() < 1e-13);
            }
        }
    }
}
