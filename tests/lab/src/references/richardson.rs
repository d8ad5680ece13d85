//! Richardson's extrapolation over three refinements.

/// What three values say about their limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limit {
    /// The limit, or the finest value.
    pub value: f64,
    /// How far it may be off: the way extrapolation went, or the last refinement's.
    pub uncertainty: f64,
    /// The order seen, if it is credible.
    pub order: Option<f64>,
}

/// Orders that are believed: below, three grids do not show a limit; above, differences are rounding or chance.
const CREDIBLE: std::ops::RangeInclusive<f64> = 1.0..=6.0;

/// The limit of `v₁, v₂, v₃` on grids each `ratio` times as fine: with `p = ln((v₂ − v₁)/(v₃ − v₂))/ln ratio`,
/// `v = v₃ + (v₃ − v₂)/(ratioᵖ − 1)`.
pub fn limit([first, second, third]: [f64; 3], ratio: f64) -> Limit {
    let (before, last) = (second - first, third - second);
    let order = (before / last).ln() / ratio.ln();
    if CREDIBLE.contains(&order) {
        let way = last / (ratio.powf(order) - 1.0);
        Limit { value: third + way, uncertainty: way.abs(), order: Some(order) }
    } else {
        Limit { value: third, uncertainty: last.abs(), order: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_is_extrapolated_exactly() {
        let value = |h: f64| 3.0 + 0.7 * h.powf(2.5);
        let found = limit([value(1.0), value(1.0 / 1.5), value(1.0 / 2.25)], 1.5);
        assert!((found.value - 3.0).abs() < 1e-12 && (found.order.unwrap() - 2.5).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn values_without_a_limit_keep_the_finest() {
        for values in [[1.0, 2.0, 1.5], [1.0, 1.1, 1.3], [1.0, 1.0, 1.0]] {
            let found = limit(values, 1.5);
            assert!(found.order.is_none() && found.value == values[2], "{found:?}");
        }
    }
}
