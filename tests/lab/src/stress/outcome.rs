//! What a row measured, and what follows from it.

/// A number with the most it may be.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// What was measured.
    pub name: String,
    /// Its value; infinite where what was waited for did not happen.
    pub value: f64,
    /// Unit of value and limit; `1` of a ratio.
    pub unit: &'static str,
    /// The most it may be; none of a number that is only told.
    pub limit: Option<f64>,
    /// Why it is known to exceed its limit, and by what it may at most.
    pub shortfall: Option<(&'static str, f64)>,
}

impl Measured {
    /// A number that is only told.
    pub fn value(name: impl Into<String>, value: f64, unit: &'static str) -> Self {
        Self { name: name.into(), value, unit, limit: None, shortfall: None }
    }

    /// A number that must not exceed a limit.
    pub fn bounded(name: impl Into<String>, value: f64, unit: &'static str, limit: f64) -> Self {
        Self { limit: Some(limit), ..Self::value(name, value, unit) }
    }

    /// The same, known to exceed it for a reason, but not to exceed `at_most`.
    #[must_use]
    pub fn known_to_exceed(self, reason: &'static str, at_most: f64) -> Self {
        Self { shortfall: Some((reason, at_most)), ..self }
    }

    /// Beyond its limit, and not as is known of it.
    fn surprises(&self) -> bool {
        let is_known = self.shortfall.is_some_and(|(_, at_most)| self.value <= at_most);
        !self.holds() && !is_known
    }

    /// Within its limit, if it has one. NaN never is.
    pub fn holds(&self) -> bool {
        self.limit.is_none_or(|limit| self.value <= limit)
    }
}

/// What came out of a row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Outcome {
    /// Numbers.
    pub measured: Vec<Measured>,
    /// Demands that were not met, in words.
    pub broken: Vec<String>,
}

impl Outcome {
    pub(super) fn passing() -> Self {
        Self::default()
    }

    pub(super) fn push(&mut self, measured: Measured) {
        self.measured.push(measured);
    }

    /// Notes what is wrong unless `met`.
    pub(super) fn demand(&mut self, met: bool, otherwise: impl FnOnce() -> String) {
        if !met {
            self.broken.push(otherwise());
        }
    }

    /// The criterion is met.
    pub fn passed(&self) -> bool {
        self.broken.is_empty() && self.measured.iter().all(Measured::holds)
    }

    /// Something falls short that is not known to.
    pub fn surprises(&self) -> bool {
        !self.broken.is_empty() || self.measured.iter().any(Measured::surprises)
    }

    /// Why it does not pass; empty if it does.
    pub fn reason(&self) -> String {
        let mut reasons: Vec<String> = self.broken.clone();
        for measured in self.measured.iter().filter(|m| !m.holds()) {
            let reason = match measured.shortfall {
                Some((known, _)) if !measured.surprises() => known.to_owned(),
                _ => format!("{} is too large", measured.name),
            };
            if !reasons.contains(&reason) {
                reasons.push(reason);
            }
        }
        reasons.join("; ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_shortfall_fails_but_does_not_surprise() {
        let known = Measured::bounded("a", 2.0, "1", 1.0).known_to_exceed("it is so", 3.0);
        let outcome = Outcome { measured: vec![known.clone()], broken: vec![] };
        assert!(!outcome.passed() && !outcome.surprises());
        assert_eq!(outcome.reason(), "it is so");
        for value in [3.1, f64::NAN] {
            let more = Outcome { measured: vec![Measured { value, ..known.clone() }], broken: vec![] };
            assert!(more.surprises() && more.reason() == "a is too large");
        }
        let nan = Outcome { measured: vec![Measured::bounded("b", f64::NAN, "1", 1.0)], broken: vec![] };
        assert!(!nan.passed() && nan.surprises());
    }
}
