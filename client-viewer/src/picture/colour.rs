//! Displacement to colour: light flesh at rest to violet, darker with every step (magma reversed), so that it keeps its
//! order in grey and for colour-blind eyes, and shading stays visible where nothing moves.

/// sRGB components in 0..=1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rgb(pub(super) [f32; 3]);

const STOPS: [[f32; 3]; 8] = [
    [0.988, 0.922, 0.780],
    [0.996, 0.800, 0.600],
    [0.992, 0.655, 0.455],
    [0.965, 0.490, 0.370],
    [0.880, 0.345, 0.385],
    [0.730, 0.245, 0.450],
    [0.560, 0.180, 0.485],
    [0.390, 0.120, 0.480],
];

/// The colour of a fraction; outside values, and NaN, take the end colours.
pub(super) fn of_fraction(fraction: f32) -> Rgb {
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
    fn lightness_falls() {
        let grey = |f: f32| {
            let Rgb([r, g, b]) = of_fraction(f);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        assert!((0..20).all(|i| grey((i + 1) as f32 / 20.0) < grey(i as f32 / 20.0)));
    }
}
