//! What was measured of one method at one resolution on one problem.

/// A difference of time, as a fraction, that is a tie: what two runs of one method differ by.
const TIE_TIME: f64 = 0.10;
/// The same of the error.
pub const TIE_ERROR: f64 = 0.01;
/// How many times the unrest of two rows a difference of their times must be to be believed.
const SIGMAS: f64 = 3.0;
/// No difference of time beyond this is a tie, however noisy the run: such a run has to be repeated.
const WIDEST_TIE_TIME: f64 = 0.3;

/// A row of the results. What was not measured is `None`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Row {
    /// Problem.
    pub problem: String,
    /// Method.
    pub method: String,
    /// Whether its material is the problem's: otherwise errors may cancel, and it is shown out of competition.
    pub competes: bool,
    /// Resolution, in the unit of its body.
    pub resolution: u32,
    /// Elements.
    pub elements: usize,
    /// Nodes.
    pub nodes: usize,
    /// Substeps per tick.
    pub substeps: usize,
    /// Median time per tick (µs).
    pub median_us: Option<f64>,
    /// 99th percentile (µs).
    pub p99_us: Option<f64>,
    /// Worst (µs).
    pub worst_us: Option<f64>,
    /// How far the medians of the two halves of the turns are apart, over the median.
    pub unrest: Option<f64>,
    /// Memory it holds (bytes).
    pub memory_bytes: usize,
    /// Answer (N or m), mean over the last ticks.
    pub answer: Option<f64>,
    /// `answer/reference − 1`.
    pub answer_error: Option<f64>,
    /// Displacement field against the reference's, relative L2.
    pub field_l2: Option<f64>,
    /// The same around what is pressed alone, where there is such a part.
    pub field_around: Option<f64>,
    /// The same in the maximum.
    pub field_max: Option<f64>,
    /// Change of the answer over the last ticks, over the answer: how far it still moves.
    pub drift: Option<f64>,
    /// Energy that the ledger misses, over the work done.
    pub energy_error: Option<f64>,
    /// Why it has no answer.
    pub failure: String,
}

impl Row {
    /// The error of the answer without sign.
    pub fn error(&self) -> Option<f64> {
        self.answer_error.map(f64::abs)
    }

    /// Difference of its time to another row's, as a fraction, that may be noise: `SIGMAS` times the unrest of both.
    pub fn noise_with(&self, other: &Self) -> f64 {
        SIGMAS * (self.unrest.unwrap_or(0.0) + other.unrest.unwrap_or(0.0))
    }

    /// Whether its answer stands, to within what counts as a tie of errors: of one that still moves by more the error is not known.
    pub fn stands(&self) -> bool {
        self.drift.is_none_or(|drift| drift <= TIE_ERROR)
    }

    /// Whether it has a part in the front.
    pub fn is_in_competition(&self) -> bool {
        self.competes && self.stands()
    }

    /// Whether no competing row is both faster and nearer to the answer, beyond ties; false without time or answer, or out of competition.
    pub fn is_on_front(&self, all: &[&Self]) -> bool {
        let (Some(time), Some(error), true) = (self.median_us, self.error(), self.is_in_competition()) else {
            return false;
        };
        let better = |other: &&Self| match (other.median_us, other.error()) {
            (Some(t), Some(e)) if other.is_in_competition() => {
                t < (1.0 - self.noise_with(other).clamp(TIE_TIME, WIDEST_TIE_TIME)) * time
                    && e <= (1.0 + TIE_ERROR) * error
                    || t <= time && e < (1.0 - TIE_ERROR) * error
            }
            _ => false,
        };
        !all.iter().any(better)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_has_what_nothing_beats() {
        let row =
            |time, error| Row { median_us: Some(time), answer_error: Some(error), competes: true, ..Row::default() };
        let unfair = Row { competes: false, ..row(0.5, 0.01) };
        let rows = [row(1.0, -0.5), row(2.0, 0.1), row(3.0, -0.2), row(4.0, 0.05), Row::default(), unfair];
        let all: Vec<&Row> = rows.iter().collect();
        let front: Vec<bool> = rows.iter().map(|r| r.is_on_front(&all)).collect();
        assert_eq!(front, [true, true, false, true, false, false]);
    }

    #[test]
    fn an_answer_that_still_moves_is_out_of_competition() {
        let row = |error, drift| Row {
            median_us: Some(1.0 - error),
            answer_error: Some(error),
            drift: Some(drift),
            competes: true,
            ..Row::default()
        };
        let rows = [row(0.2, 1e-3), row(0.1, 0.5)];
        let front: Vec<bool> = rows.iter().map(|r| r.is_on_front(&rows.iter().collect::<Vec<_>>())).collect();
        assert_eq!(front, [true, false]);
    }

    #[test]
    fn a_row_is_not_pushed_off_the_front_by_noise() {
        let row = |time, unrest| Row {
            median_us: Some(time),
            answer_error: Some(0.1),
            unrest: Some(unrest),
            competes: true,
            ..Row::default()
        };
        let on_front = |unrest| {
            let rows = [row(100.0, unrest), row(85.0, 0.01)];
            rows[0].is_on_front(&rows.iter().collect::<Vec<_>>())
        };
        assert!(!on_front(0.03), "15 % faster, and 12 % of noise");
        assert!(on_front(0.05), "15 % faster, and 18 % of noise");
        let noisy = [row(100.0, 1.0), row(65.0, 1.0)];
        assert!(!noisy[0].is_on_front(&noisy.iter().collect::<Vec<_>>()), "35 % faster: no noise excuses that");
    }
}
