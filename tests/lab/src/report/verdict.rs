//! The first lines of the page, and the last that a run prints: what is nearest to the answer within a millisecond, beside what is served and beside peers.
use super::page::{escape, number, percent};
use crate::{
    measure::{Row, TIE_ERROR},
    methods,
    peers::PREFIX,
};
use std::fmt::Write as _;

/// What fits into a tick (µs).
const TICK_US: f64 = 1000.0;

/// One problem's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Verdict<'a> {
    pub problem: &'a str,
    /// The reference's uncertainty, over its value: nearer than that nothing is told apart.
    pub floor: f64,
    /// What a scene gets that asks for nothing else.
    pub served: Option<&'a Row>,
    /// The nearest of ours, whatever it is.
    pub nearest: Option<&'a Row>,
    /// The nearest peer.
    pub peer: Option<&'a Row>,
}

impl<'a> Verdict<'a> {
    /// Of a problem's rows that compete and fit into a tick. Bodies that have no hybrid are served as smoothed tets.
    pub(super) fn of(problem: &'a str, floor: f64, rows: &[&'a Row]) -> Self {
        let fits = |row: &&Row| row.is_in_competition() && row.median_us.is_some_and(|time_us| time_us < TICK_US);
        let (peers, ours): (Vec<&Row>, Vec<&Row>) =
            rows.iter().copied().filter(fits).partition(|row| row.method.starts_with(PREFIX));
        let by = |name: &str| {
            let of: Vec<&Row> = ours.iter().copied().filter(|row| row.method == name).collect();
            nearest(&of, floor)
        };
        Self {
            problem,
            floor,
            served: by(methods::SERVED).or_else(|| by(methods::SMOOTHED_TETS)),
            nearest: nearest(&ours, floor),
            peer: nearest(&peers, floor),
        }
    }

    fn error(&self, row: &Row) -> f64 {
        row.error().unwrap_or(f64::INFINITY).max(self.floor)
    }

    /// Whether nothing of ours and no peer is nearer than what is served, ties aside.
    fn is_won(&self) -> bool {
        let Some(served) = self.served else { return false };
        let others = [self.nearest, self.peer].into_iter().flatten();
        others.into_iter().all(|other| self.error(served) <= (1.0 + TIE_ERROR) * self.error(other))
    }

    /// How many times farther off the nearest peer is than what is served.
    fn times_nearer(&self) -> Option<f64> {
        Some(self.error(self.peer?) / self.error(self.served?))
    }
}

/// The smallest error's, by the fastest that ties with it.
fn nearest<'a>(rows: &[&'a Row], floor: f64) -> Option<&'a Row> {
    let error = |row: &Row| row.error().map_or(f64::INFINITY, |error| error.max(floor));
    let smallest = rows.iter().copied().map(error).fold(f64::INFINITY, f64::min);
    let ties = rows.iter().copied().filter(|row| error(row) <= (1.0 + TIE_ERROR) * smallest);
    let time_us = |row: &Row| row.median_us.unwrap_or(f64::INFINITY);
    ties.min_by(|a, b| time_us(a).total_cmp(&time_us(b)))
}

/// The median of some numbers, the lower one of two.
fn median(mut of: Vec<f64>) -> Option<f64> {
    of.sort_by(f64::total_cmp);
    of.get(of.len().saturating_sub(1) / 2).copied()
}

/// What the verdicts come to, in a sentence or two.
pub(super) fn sentences(verdicts: &[Verdict<'_>]) -> Vec<String> {
    let served: Vec<&Verdict<'_>> =
        verdicts.iter().filter(|v| v.served.is_some_and(|row| row.method == methods::SERVED)).collect();
    let mut told = Vec::new();
    let of_served = |what: fn(&Row) -> Option<f64>| median(served.iter().filter_map(|v| what(v.served?)).collect());
    if let (Some(error), Some(time_us)) = (of_served(Row::error), of_served(|row| row.median_us)) {
        told.push(format!(
            "What is served ({}) is {} off in {} µs, medians over {} problems; within a millisecond nothing is nearer on {} of them.",
            methods::SERVED,
            percent(Some(error)).trim_start_matches('+'),
            number(Some(time_us), 0),
            served.len(),
            served.iter().filter(|v| v.is_won()).count()
        ));
    }
    let beside: Vec<&Verdict<'_>> = served.iter().copied().filter(|v| v.peer.is_some()).collect();
    let ratios: Vec<f64> = beside.iter().filter_map(|v| v.times_nearer()).collect();
    let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
    let most = ratios.iter().copied().fold(0.0, f64::max);
    let peers = |what: fn(&Row) -> Option<f64>| median(beside.iter().filter_map(|v| what(v.peer?)).collect());
    if let (Some(times), Some(error), Some(time_us)) = (median(ratios), peers(Row::error), peers(|row| row.median_us)) {
        told.push(format!(
            "The nearest peer within a millisecond is {} off in {} µs, medians over the {} of them that peers were given: {times:.1} times farther off in the \
             median, {least:.1} to {most:.1} times.",
            percent(Some(error)).trim_start_matches('+'),
            number(Some(time_us), 0),
            beside.len()
        ));
    } else if !verdicts.is_empty() {
        told.push("No peer was run: palpate-lab run --peers puts other simulators beside these.".to_owned());
    }
    told
}

/// The section, with a line for each problem.
pub(super) fn section(out: &mut String, verdicts: &[Verdict<'_>]) {
    out.push_str("<h2>At a millisecond</h2>");
    for sentence in sentences(verdicts) {
        let _ = write!(out, "<p><b>{}</b></p>", escape(&sentence));
    }
    out.push_str(
        "<p>For each problem what is served, the method of ours that is nearest to the answer, and the nearest peer, each at the resolution at which it is nearest among those whose \
         median tick is below 1 ms, and the fastest of those that are as near to within 1 %. Bodies that particles cannot fill are served as smoothed tets. Errors below the reference's own \
         uncertainty count as that. Resolutions are cells or tets, as in the tables below.</p><div class=\"wide\"><table><tr><th>problem</th><th>served</th><th>at</th><th>µs</th><th>error</th>\
         <th>nearest of ours</th><th>at</th><th>µs</th><th>error</th><th>nearest peer</th><th>at</th><th>µs</th><th>error</th><th>times farther off than what is served</th></tr>",
    );
    for verdict in verdicts {
        let _ = write!(out, "<tr><td><a href=\"#{0}\">{0}</a></td>", escape(verdict.problem));
        for row in [verdict.served, verdict.nearest, verdict.peer] {
            let _ = match row {
                Some(row) => write!(
                    out,
                    "<td>{}</td><td>{}</td><td>{}</td><td>{}</td>",
                    escape(row.method.trim_start_matches(PREFIX)),
                    row.resolution,
                    number(row.median_us, 1),
                    percent(row.answer_error)
                ),
                None => write!(out, "<td colspan=\"4\">–</td>"),
            };
        }
        let class = if verdict.is_won() { "yes" } else { "no" };
        let _ = write!(out, "<td class=\"{class}\">{}</td></tr>", number(verdict.times_nearer(), 1));
    }
    out.push_str("</table></div>");
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a test that cannot build its subject has failed
    use super::*;

    fn row(method: &str, time_us: f64, error: f64) -> Row {
        Row {
            problem: "p".into(),
            method: method.into(),
            competes: true,
            median_us: Some(time_us),
            answer_error: Some(error),
            ..Row::default()
        }
    }

    #[test]
    fn what_is_served_is_judged_beside_ours_and_peers_within_a_millisecond() {
        let rows = [
            row(methods::SERVED, 200.0, -0.02),
            row(methods::SERVED, 1500.0, 0.001),
            row(methods::SMOOTHED_TETS, 100.0, 0.2),
            row("hybrid 600 awake", 400.0, 0.005),
            row("peer: a", 300.0, 0.5),
            row("peer: b", 900.0, 0.4),
            row("peer: late", 2000.0, 0.0),
        ];
        let all: Vec<&Row> = rows.iter().collect();
        let verdict = Verdict::of("p", 1e-3, &all);
        assert_eq!(verdict.served, Some(&rows[0]));
        assert_eq!(verdict.nearest, Some(&rows[3]));
        assert_eq!(verdict.peer, Some(&rows[5]));
        assert!((verdict.times_nearer().unwrap() - 20.0).abs() < 1e-9);
        assert!(!verdict.is_won());
        // What nothing tells apart is won.
        assert!(Verdict::of("p", 0.05, &all).is_won());
        let told = sentences(&[verdict]);
        assert!(told[0].contains("2.00 % off in 200 µs") && told[0].contains("nearer on 0 of them"), "{told:?}");
        assert!(told[1].contains("40.00 % off in 900 µs") && told[1].contains("20.0 times farther"), "{told:?}");
    }

    #[test]
    fn a_body_without_particles_is_served_as_smoothed_tets() {
        let rows = [row(methods::LINEAR_TETS, 10.0, 0.5), row(methods::SMOOTHED_TETS, 20.0, 0.1)];
        let all: Vec<&Row> = rows.iter().collect();
        let verdict = Verdict::of("p", 0.0, &all);
        assert_eq!(verdict.served, Some(&rows[1]));
        assert!(verdict.is_won() && verdict.times_nearer().is_none());
    }
}
