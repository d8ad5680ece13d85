//! Displacement to colour: viridis, which keeps its order in grey and for colour-blind eyes.

/// sRGB components in 0..=1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rgb(pub(super) [f32; 3]);

const STOPS: [[f32; 3]; 11] = [
    [0.267, 0.005, 0.329],
    [0.283, 0.141, 0.458],
    [0.254, 0.265, 0.530],
    [0.207, 0.372, 0.553],
    [0.164, 0.471, 0.558],
    [0.128, 0.567, 0.551],
    [0.135, 0.659, 0.518],
    [0.267, 0.749, 0.441],
    [0.478, 0.821, 0.317],
    [0.741, 0.873, 0.150],
    [0.993, 0.906, 0.144],
];

/// The colour of a fraction; outside values, and NaN, take the end colours.
pub(super) fn viridis(fraction: f32) -> Rgb {
    let at = fraction.clamp(0.0, 1.0).max(0.0) * (STOPS.len() - 1) as f32;
    let low = (at as usize).min(STOPS.len() - 2);
    let t = at - low as f32;
    Rgb([0, 1, 2].map(|i| STOPS[low][i] + (STOPS[low + 1][i] - STOPS[low][i]) * t))
}

/// The smallest of 1, 2, 5 × 10ⁿ that is not below `value`; at least `least`.
pub(super) fn nice_ceiling(value: f32, least: f32) -> f32 {
    if value.is_nan() || value <= least {
        return least;
    }
    let power = 10.0_f32.powf(value.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|f| f * power).into_iter().find(|&c| c >= value * (1.0 - 1e-5)).unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ceilings_are_one_two_five() {
        for (value, ceiling) in [(3.1e-4, 5e-4), (2e-3, 2e-3), (0.0, 1e-4), (f32::NAN, 1e-4), (7.3, 10.0)] {
            assert!((nice_ceiling(value, 1e-4) / ceiling - 1.0).abs() < 1e-4, "{value}");
        }
    }

    #[test]
    fn lightness_grows() {
        let grey = |f: f32| {
            let Rgb([r, g, b]) = viridis(f);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        assert!((0..20).all(|i| grey((i + 1) as f32 / 20.0) > grey(i as f32 / 20.0)));
    }
}
