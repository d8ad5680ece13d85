//! Answers by formula.
use super::{
    Action, Problem,
    body::{BEAM_LENGTH_M, Body, OCTANT_M},
};

/// The exact answer of a problem that has one (m).
pub fn answer_m(problem: &Problem) -> Option<f64> {
    let (young, nu) = (problem.young_modulus_pa, problem.poisson_ratio);
    match (problem.body, problem.action) {
        (Body::Octant, Action::Pressure { pressure_pa }) => Some(lame_m(OCTANT_M[0], pressure_pa, young, nu)),
        (Body::Beam { slenderness }, Action::Shear { force_n }) => {
            Some(BEAM_LENGTH_M * reissner(force_n, young, nu, f64::from(slenderness)))
        }
        _ => None,
    }
}

/// Lamé's thick sphere: `u(r) = p a³/(E(b³ − a³)) · [(1 − 2ν) r + (1 + ν) b³/(2r²)]`.
pub fn lame_m(r: f64, pressure_pa: f64, young_pa: f64, nu: f64) -> f64 {
    let (a3, b3) = (OCTANT_M[0].powi(3), OCTANT_M[1].powi(3));
    pressure_pa * a3 / (young_pa * (b3 - a3)) * ((1.0 - 2.0 * nu) * r + (1.0 + nu) * b3 / (2.0 * r * r))
}

/// Force (N) for `α = PL²/EI` on a square beam: `I = h⁴/12`.
pub(super) fn elastica_force_n(alpha: f64, young_pa: f64, slenderness: f64) -> f64 {
    alpha * young_pa * (BEAM_LENGTH_M / slenderness).powi(4) / 12.0 / BEAM_LENGTH_M.powi(2)
}

/// Tip deflection over length of a square beam under a dead force across its end (Timoshenko's where it is small), with Cowper's
/// shear factor `k = 10(1 + ν)/(12 + 11ν)`.
fn reissner(force_n: f64, young_pa: f64, nu: f64, slenderness: f64) -> f64 {
    let alpha = force_n / elastica_force_n(1.0, young_pa, slenderness);
    let stretch = 1.0 / (12.0 * slenderness * slenderness);
    let k = 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu);
    // EI/(EA L²), EI/(kGA L²)
    deflection(alpha, stretch, stretch * 2.0 * (1.0 + nu) / k)
}

/// By shooting: `x' = (1 + ε) cos θ − γ sin θ`, `w' = (1 + ε) sin θ + γ cos θ`, `ε = α·stretch·sin θ`, `γ = α·shear·cos θ`,
/// `θ'' = −α x'`, `θ(0) = 0`, `θ'(1) = 0`.
fn deflection(alpha: f64, stretch: f64, shear: f64) -> f64 {
    const STEPS: u32 = 2000;
    let rates = |[theta, curvature, _]: [f64; 3]| {
        let (sin, cos) = theta.sin_cos();
        let (epsilon, gamma) = (alpha * stretch * sin, alpha * shear * cos);
        [curvature, -alpha * ((1.0 + epsilon) * cos - gamma * sin), (1.0 + epsilon) * sin + gamma * cos]
    };
    let shoot = |start: f64| {
        let h = 1.0 / f64::from(STEPS);
        (0..STEPS).fold([0.0, start, 0.0], |y: [f64; 3], _| {
            let at = |k: [f64; 3], h: f64| rates(std::array::from_fn(|i| y[i] + h * k[i]));
            let k1 = rates(y);
            let k2 = at(k1, 0.5 * h);
            let k3 = at(k2, 0.5 * h);
            let k4 = at(k3, h);
            std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
        })
    };
    let (mut low, mut high) = (0.0, alpha);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if shoot(middle)[1] > 0.0 { high = middle } else { low = middle }
    }
    shoot(f64::midpoint(low, high))[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_numbers_come_out() {
        for (alpha, expected) in [(1.0, 0.301721), (2.0, 0.493457), (5.0, 0.713792)] {
            assert!((deflection(alpha, 0.0, 0.0) - expected).abs() < 5e-7, "{alpha}");
        }
        for (nu, expected) in [(0.3, 4.0), (0.45, 4.2143), (0.49, 4.2714)] {
            assert!((lame_m(0.05, 1.0, 10e3, nu) * 1e6 - expected).abs() < 5e-5);
        }
        // Timoshenko's 4.0240 mm at 1 mN, at a hundredth of it.
        assert!((BEAM_LENGTH_M * reissner(1e-5, 100e3, 0.0, 10.0) / 4.0240e-5 - 1.0).abs() < 2e-5);
    }
}
