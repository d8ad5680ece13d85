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

/// The limit of `v₁, v₂, v₃` on elements of sizes `h₁ > h₂ > h₃`: with the order p that solves
/// `(v₂ − v₁)/(v₃ − v₂) = (h₁ᵖ − h₂ᵖ)/(h₂ᵖ − h₃ᵖ)`, it is `v₃ + (v₃ − v₂) h₃ᵖ/(h₂ᵖ − h₃ᵖ)`.
pub fn limit([first, second, third]: [f64; 3], sizes: [f64; 3]) -> Limit {
    let last = third - second;
    match order((second - first) / last, sizes) {
        Some(order) => {
            let way = last * beyond(order, sizes);
            Limit { value: third + way, uncertainty: way.abs(), order: Some(order) }
        }
        None => Limit { value: third, uncertainty: last.abs(), order: None },
    }
}

/// How far the limit is beyond the third value, over the way from the second to it.
pub(super) fn beyond(order: f64, [_, second, third]: [f64; 3]) -> f64 {
    1.0 / ((second / third).powf(order) - 1.0)
}

/// The order at which differences of successive values have this ratio, if it is credible.
pub(super) fn order(ratio: f64, [first, second, third]: [f64; 3]) -> Option<f64> {
    // (h₁ᵖ − h₂ᵖ)/(h₂ᵖ − h₃ᵖ) grows with p.
    let of = |p: f64| ((first / second).powf(p) - 1.0) / (1.0 - (third / second).powf(p));
    let (mut low, mut high) = (*CREDIBLE.start(), *CREDIBLE.end());
    if !(of(low)..=of(high)).contains(&ratio) {
        return None;
    }
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if of(middle) < ratio { low = middle } else { high = middle }
    }
    Some(f64::midpoint(low, high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_law_is_extrapolated_exactly() {
        let value = |h: f64| 3.0 + 0.7 * h.powf(2.5);
        let sizes = [1.0 / 3.0, 1.0 / 4.0, 1.0 / 6.0];
        let found = limit(sizes.map(value), sizes);
        assert!((found.value - 3.0).abs() < 1e-12 && (found.order.unwrap() - 2.5).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn values_without_a_limit_keep_the_finest() {
        for values in [[1.0, 2.0, 1.5], [1.0, 1.1, 1.3], [1.0, 1.0, 1.0], [1.0, 2.0, 2.0]] {
            let found = limit(values, [1.0, 0.5, 0.25]);
            assert!(found.order.is_none() && found.value == values[2], "{found:?}");
        }
    }
}
