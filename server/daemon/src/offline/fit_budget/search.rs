//! The search for numbers whose ticks fit a budget: for every number of coarse tets, as many awake particles as fit.
//!
//! More of either is nearer to the body with all of its particles awake, and which is worth more differs from body to body: so for each
//! number of tets the most awake that fit are found, and of these the ones whose answer is nearest are taken.

/// Numbers of coarse tets that are tried.
pub(super) const TETS: [u32; 6] = [200, 400, 800, 1600, 3200, 6400];
/// Numbers of awake particles that are tried.
pub(super) const AWAKE: [u32; 9] = [100, 140, 200, 280, 400, 560, 800, 1100, 1600];

/// Returns the largest of ascending numbers that fits, where smaller ones fit if a larger one does, and what was measured of it; `None`
/// where none fits. It asks for about `log₂ n` of them.
///
/// # Errors
/// Those of `measure`.
pub(super) fn largest_that_fits<T, E>(
    numbers: &[u32],
    mut measure: impl FnMut(u32) -> Result<(T, bool), E>,
) -> Result<Option<(u32, T)>, E> {
    let (mut fit, mut found) = (0..numbers.len(), None);
    while !fit.is_empty() {
        let middle = usize::midpoint(fit.start, fit.end);
        let (measured, fits) = measure(numbers[middle])?;
        if fits {
            found = Some((numbers[middle], measured));
            fit.start = middle + 1;
        } else {
            fit.end = middle;
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    #[test]
    fn the_largest_that_fits_is_found_with_few_measurements() {
        for limit in [0, 99, 100, 150, 560, 1599, 1600, 9999] {
            let mut asked = Vec::new();
            let found = largest_that_fits(&AWAKE, |number| {
                asked.push(number);
                Ok::<_, Infallible>((number * 2, number <= limit))
            });
            let expected = AWAKE.iter().copied().filter(|number| *number <= limit).max();
            assert_eq!(found, Ok(expected.map(|number| (number, number * 2))), "{limit}");
            assert!(asked.len() <= 4, "{asked:?}");
        }
        assert_eq!(largest_that_fits(&[], |_| Ok::<((), bool), Infallible>(((), true))), Ok(None));
        assert_eq!(largest_that_fits(&[1], |_| Err::<((), bool), _>("no")), Err("no"));
    }
}
