//! Quadratic shape functions on [−1, 1] and their products, and Gauss's quadrature.

/// Gauss's three points on [−1, 1]: exact for polynomials of degree 5.
pub const GAUSS: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];

/// Lagrange's polynomials on the nodes −1, 0, 1 at `s`: `s(s − 1)/2, 1 − s², s(s + 1)/2`.
pub fn values(s: f64) -> [f64; 3] {
    [0.5 * s * (s - 1.0), 1.0 - s * s, 0.5 * s * (s + 1.0)]
}

/// Their derivatives.
pub fn slopes(s: f64) -> [f64; 3] {
    [s - 0.5, -2.0 * s, s + 0.5]
}

/// Values of the nine functions of a face at (a, b), node `i + 3j`.
pub fn face_values(a: f64, b: f64) -> [f64; 9] {
    let (la, lb) = (values(a), values(b));
    std::array::from_fn(|n| la[n % 3] * lb[n / 3])
}

/// Their derivatives by a and by b.
pub fn face_slopes(a: f64, b: f64) -> [[f64; 2]; 9] {
    let ((la, lb), (da, db)) = ((values(a), values(b)), (slopes(a), slopes(b)));
    std::array::from_fn(|n| [da[n % 3] * lb[n / 3], la[n % 3] * db[n / 3]])
}

/// Values of the 27 functions of a hexahedron at (ξ, η, ζ), node `i + 3j + 9k`.
pub fn solid_values(at: [f64; 3]) -> [f64; 27] {
    let l = at.map(values);
    std::array::from_fn(|n| l[0][n % 3] * l[1][n / 3 % 3] * l[2][n / 9])
}

/// Derivatives of the 27 functions of a hexahedron at (ξ, η, ζ), node `i + 3j + 9k`.
pub fn solid_slopes(at: [f64; 3]) -> [[f64; 3]; 27] {
    let (l, d) = (at.map(values), at.map(slopes));
    std::array::from_fn(|n| {
        let [i, j, k] = [n % 3, n / 3 % 3, n / 9];
        [d[0][i] * l[1][j] * l[2][k], l[0][i] * d[1][j] * l[2][k], l[0][i] * l[1][j] * d[2][k]]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_sum_to_one_and_are_one_at_their_node() {
        for s in [-1.0, -0.3, 0.0, 0.7, 1.0] {
            assert!((values(s).iter().sum::<f64>() - 1.0).abs() < 1e-15);
            assert!(slopes(s).iter().sum::<f64>().abs() < 1e-15);
        }
        assert_eq!([values(-1.0), values(0.0), values(1.0)], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    }

    #[test]
    fn slopes_are_the_values_differences() {
        let step = 1e-6;
        for s in [-0.9, 0.1, 0.6] {
            for n in 0..3 {
                let difference = (values(s + step)[n] - values(s - step)[n]) / (2.0 * step);
                assert!((difference - slopes(s)[n]).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn quadrature_is_exact_to_degree_five() {
        for degree in 0..6 {
            let sum: f64 = GAUSS.iter().map(|(s, w)| w * s.powi(degree)).sum();
            let exact = if degree % 2 == 0 { 2.0 / f64::from(degree + 1) } else { 0.0 };
            assert!((sum - exact).abs() < 1e-15, "{degree}: {sum}");
        }
    }
}
