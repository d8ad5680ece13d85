//! The page: one file that needs nothing else, for a reader who was not there.
use super::{
    convergence, hearts, peers,
    plot::{self, Across, Point, Series},
    skips, stress,
    verdict::{self, Verdict},
};
use crate::{
    convergence::Convergence,
    hearts::HeartTicks,
    measure::{Row, Run},
    methods::Method,
    problems::{Action, Problem},
    references::Reference,
    skips::{Found, Skip},
    stress::{Outcome, Row as StressRow},
};
use miette::Result;
use std::fmt::Write as _;

/// Okabe and Ito's colours, which the colour-blind can tell apart, and some more.
pub(crate) const COLOURS: [&str; 16] = [
    "#0072b2", "#56b4e9", "#d55e00", "#e69f00", "#009e73", "#cc79a7", "#7a5195", "#222222", "#8c6d31", "#17becf",
    "#a1d34c", "#999999", "#8b0000", "#b39ddb", "#004d40", "#f781bf",
];

/// A colour for each of as many methods as there may be, no two alike: the first are those above, others go around the circle of hues by the
/// golden angle, in three shades.
fn colour(index: usize) -> String {
    COLOURS.get(index).map_or_else(
        || {
            let (hue, lightness) = ((index as f64 * 137.508) % 360.0, [35, 50, 65][index % 3]);
            format!("hsl({hue:.0} 70% {lightness}%)")
        },
        |colour| (*colour).to_owned(),
    )
}

/// The look of all pages.
pub(crate) const STYLE: &str = "
:root{color-scheme:light}
body{font:16px/1.5 system-ui,sans-serif;color:#1b1f24;background:#fff;max-width:72rem;margin:0 auto;padding:1.5rem}
h1{margin:.2em 0}h2{margin-top:2.2em;border-bottom:1px solid #d0d7de}h3{margin:2em 0 .3em}
p{max-width:48rem}svg{width:100%;max-width:46rem;height:auto;display:block}
svg text{font:12px system-ui,sans-serif;fill:#57606a}.grid{stroke:#e3e7eb}.tick{stroke:#c0392b;stroke-dasharray:5 4}
svg .ticktext{fill:#c0392b}.series{fill:none;stroke-width:1.5;opacity:.75}
.front{fill:none;stroke:#1b1f24;stroke-width:7;opacity:.13;stroke-linejoin:round}.ring{stroke:#1b1f24;stroke-width:1.6}
.floor{fill:#f1f3f5}
table{border-collapse:collapse;font-size:14px;margin:.6em 0 1em}td,th{padding:.22em .6em;border-bottom:1px solid #e3e7eb;text-align:right}
td:first-child,th:first-child{text-align:left}.text td,.text th{text-align:left;vertical-align:top}.yes{color:#1a7f37}.no{color:#c0392b}
.legend span{display:inline-block;margin-right:1.2em}.legend i{display:inline-block;width:.8em;height:.8em;border-radius:50%;margin-right:.35em}
details{margin:.3em 0 1em}summary{cursor:pointer}.wide{overflow-x:auto}";

/// What a page shows.
pub(super) struct Results<'a> {
    pub(super) run: &'a Run,
    pub(super) problems: &'a [Problem],
    pub(super) methods: &'a [Box<dyn Method>],
    /// Empty: not computed.
    pub(super) convergence: &'a [Convergence],
    /// Empty: not measured.
    pub(super) hearts: &'a [HeartTicks],
    /// Empty: not measured.
    pub(super) skips: &'a [(Skip, Found)],
    /// Empty: not run.
    pub(super) stress: &'a [(StressRow, Outcome)],
}

/// The page of a run.
///
/// # Errors
/// A problem without reference, or a record that cannot be read.
pub(super) fn page(results: &Results<'_>) -> Result<String> {
    let Results { run, problems, methods, .. } = results;
    let mut out = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>Palpate: run time against error</title><style>{STYLE}</style><body><h1>Run time against error</h1>"
    );
    verdict::section(&mut out, &verdicts(run, problems)?);
    introduction(&mut out, run);
    convergence::section(&mut out, results.convergence);
    out.push_str(
        "<h2>Methods</h2><p>The seeds are the two papers on hybrid deformable models for haptics, of 2005 and 2006, that Palpate sets out from; \
         their schemes are run as they print them.</p><table class=\"text\"><tr><th>method</th><th>what it is</th></tr>",
    );
    for method in *methods {
        let _ = write!(out, "<tr><td>{}</td><td>{}</td></tr>", escape(method.name()), escape(method.what()));
    }
    out.push_str("</table>");
    peers::section(&mut out, run);
    out.push_str("<h2>Problems</h2>");
    for problem in *problems {
        section(&mut out, run, problem, methods)?;
    }
    hearts::section(&mut out, results.hearts);
    skips::section(&mut out, results.skips);
    stress::section(&mut out, results.stress, run)?;
    out.push_str("</body></html>");
    Ok(out)
}

fn introduction(out: &mut String, run: &Run) {
    out.push_str(
        "<h2>What is shown</h2><p>A haptic body must be computed once every millisecond, and what the hand feels should be right. This page shows, for every \
         method that Palpate has, how long one such tick takes and how far its answer is off, on problems whose answer is known: by \
         formula, or from a converged solution on elements of second order that share nothing with the methods but the material's \
         energy.</p><p><b>How to read the plots.</b> Each point is a method at one resolution: further left is faster, further down \
         is nearer to the answer; both axes are logarithmic. Lines join a method's resolutions. Ringed points on the grey band are the \
         Pareto front: nothing is both faster and nearer (1 % of the error counts as a tie, and 10 % of the time, or three times the unrest of both where that is more, but \
         no more than 30 %). Hollow points are out of competition: their material is not the problem's, so that errors may cancel (the 2006 paper's \
         factors halve the stiffness, and coarse meshes are too stiff), or their answer still moves by more than 1 %, so that its error is not known. Right of the dashed red line a tick takes longer than the millisecond it \
         has. In the shaded strip at the bottom errors are below the reference's own uncertainty and say nothing. An error that falls and rises \
         again along a line has changed its sign.</p><p><b>How it was measured.</b> The tool or load comes smoothly and rests, with mass \
         damping near critical for the body's slowest mode, the same for every method; the answer is the mean over the last 20 ticks, and \
         the table says how far it still moves. In dynamic problems (a step, a sweep) the body rings under light damping instead; \
         the answer is compared at every tick, its error is the L2 norm in time of the difference over that of the reference (never negative: a \
         phase that is lost weighs like a missing amplitude), and the table shows the root mean square as the answer. Fields are the displacements of the surface within two radii of the sphere (10 mm) from where it touches; \
         \"around\" counts the outer half of that radius alone, where a hand sees more than it feels. Then all methods of a problem take turns, one untimed tick to warm the caches and one timed, \
         so that a slow moment of the machine strikes all of them. A hand does not stand still, and solvers that begin where they were would have nothing \
         to do if it did: in these ticks tool or load trembles by 5 % at 8 Hz. The unrest of a row is how far the medians of the two halves of its turns are \
         apart: a problem whose rows have more than some 10 % should be run again on a quieter machine.</p><table class=\"text\">",
    );
    for (key, value) in &run.circumstances {
        let _ = write!(out, "<tr><td>{}</td><td>{}</td></tr>", escape(key), escape(value));
    }
    out.push_str("</table>");
}

fn rows_of<'a>(run: &'a Run, problem: &Problem) -> Vec<&'a Row> {
    run.rows.iter().filter(|row| row.problem == problem.name).collect()
}

/// What is nearest within a millisecond, problem by problem.
///
/// # Errors
/// A problem without reference.
pub(super) fn verdicts<'a>(run: &'a Run, problems: &'a [Problem]) -> Result<Vec<Verdict<'a>>> {
    let of = |problem: &'a Problem| {
        let reference = Reference::of(problem)?;
        let floor = reference.uncertainty / reference.value.abs();
        Ok(Verdict::of(&problem.name, floor, &rows_of(run, problem)))
    };
    problems.iter().map(of).collect()
}

fn section(out: &mut String, run: &Run, problem: &Problem, methods: &[Box<dyn Method>]) -> Result<()> {
    let reference = Reference::of(problem)?;
    let rows = rows_of(run, problem);
    let _ = write!(
        out,
        "<h3 id=\"{0}\">{0}</h3><p>{1} E = {2} kPa, ν = {3}, {4:?}. Reference: {5:.5e} {6} ± {7:.2} % ({8}{9}).</p>",
        escape(&problem.name),
        escape(&problem.sentence),
        problem.young_modulus_pa * 1e-3,
        problem.poisson_ratio,
        problem.law,
        reference.value,
        reference.unit,
        100.0 * reference.uncertainty / reference.value.abs(),
        escape(&reference.method),
        reference.observed_order.map_or_else(String::new, |order| format!(", observed order {order:.1}"))
    );
    let mut series = Vec::new();
    out.push_str("<div class=\"legend\">");
    let names = names(run, methods);
    let colours: Vec<String> = (0..names.len()).map(colour).collect();
    for (name, colour) in names.into_iter().zip(&colours) {
        let of_method = rows.iter().filter(|row| row.method == name);
        let points: Vec<Point> = of_method.filter_map(|row| point(row, &rows)).collect();
        if !points.is_empty() {
            let _ = write!(out, "<span><i style=\"background:{colour}\"></i>{}</span>", escape(name));
            series.push(Series { name, colour, points });
        }
    }
    let floor = reference.uncertainty / reference.value.abs();
    let _ = write!(out, "</div>{}", plot::svg(&series, floor, &Across::TIME_US));
    table(out, problem, &rows);
    Ok(())
}

/// Methods, then peers as they come.
fn names<'a>(run: &'a Run, methods: &'a [Box<dyn Method>]) -> Vec<&'a str> {
    let mut names: Vec<&str> = methods.iter().map(|method| method.name()).collect();
    for row in &run.rows {
        if !names.contains(&row.method.as_str()) {
            names.push(&row.method);
        }
    }
    names
}

fn point(row: &Row, rows: &[&Row]) -> Option<Point> {
    let (time_us, error) = (row.median_us?, row.error()?);
    let label = format!("{} elements, {time_us:.1} µs, {}", row.elements, percent(row.answer_error));
    Some(Point { across: time_us, error, on_front: row.is_on_front(rows), competes: row.is_in_competition(), label })
}

fn table(out: &mut String, problem: &Problem, rows: &[&Row]) {
    let _ = write!(
        out,
        "<details><summary>Table</summary><div class=\"wide\"><table><tr><th>method</th><th>{}</th><th>elements</th><th>nodes</th>\
         <th>substeps</th><th>µs median</th><th>p99</th><th>worst</th><th>MB</th><th>answer ({})</th><th>error</th><th>field L2</th>\
         <th>around L2</th><th>field max</th><th>energy</th><th>still moves</th></tr>",
        problem.body.resolution_unit(),
        problem.quantity().unit()
    );
    for row in rows {
        let size = format!(
            "<td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>",
            escape(&row.method),
            row.resolution,
            row.elements,
            row.nodes,
            row.substeps
        );
        if row.failure.is_empty() {
            let _ = write!(
                out,
                "<tr>{size}<td>{}</td><td>{}</td><td>{}</td><td>{:.2}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>\
                 <td>{}</td><td>{}</td></tr>",
                number(row.median_us, 1),
                number(row.p99_us, 1),
                number(row.worst_us, 1),
                row.memory_bytes as f64 * 1e-6,
                row.answer.map_or_else(String::new, |a| format!("{a:.4e}")),
                percent(row.answer_error),
                percent(row.field_l2),
                percent(row.field_around),
                percent(row.field_max),
                scientific(row.energy_error),
                scientific(row.drift)
            );
        } else {
            let _ = write!(out, "<tr>{size}<td colspan=\"11\" class=\"no\">{}</td></tr>", escape(&row.failure));
        }
    }
    out.push_str("</table></div></details>");
    if matches!(problem.action, Action::Sphere { .. }) {
        out.push_str(
            "<p>Depth is counted from where the tool first touches each mesh, as a hand does: a coarse mesh lies inside the true surface.</p>",
        );
    }
}

pub(super) fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "–".into(), |v| format!("{v:.digits$}"))
}

pub(super) fn percent(value: Option<f64>) -> String {
    value.map_or_else(|| "–".into(), |v| format!("{:+.2} %", 100.0 * v))
}

fn scientific(value: Option<f64>) -> String {
    value.map_or_else(|| "–".into(), |v| format!("{v:.0e}"))
}

/// For HTML's text.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{methods, problems};

    #[test]
    fn no_two_methods_have_the_same_colour() {
        let colours: std::collections::BTreeSet<String> = (0..64).map(colour).collect();
        assert!(colours.len() == 64 && methods::all().len() < 48);
    }

    #[test]
    fn a_page_is_one_file_and_shows_failures() {
        let problem = problems::all().into_iter().find(|p| p.name == "lame-nu0.45").unwrap();
        let good = Row {
            problem: problem.name.clone(),
            method: methods::SMOOTHED_TETS.into(),
            competes: true,
            median_us: Some(10.0),
            p99_us: Some(11.0),
            answer_error: Some(-0.05),
            ..Row::default()
        };
        let bad = Row { failure: "became <non-finite>".into(), median_us: None, ..good.clone() };
        let study = Convergence {
            quantity: "what <converges>",
            refined: "cells",
            sizes: vec![1, 2],
            errors: vec![0.4, 0.1],
            demand: 2.1,
        };
        let run = Run { circumstances: [("date".into(), "today".into())].into(), rows: vec![good, bad] };
        let results = Results {
            run: &run,
            problems: &[problem],
            methods: &methods::all(),
            convergence: &[study],
            hearts: &[],
            skips: &[],
            stress: &[],
        };
        let page = page(&results).unwrap();
        assert!(
            page.contains("-5.00 %") && page.contains("became &lt;non-finite&gt;") && page.contains("class=\"yes\"")
        );
        assert!(
            page.contains("what &lt;converges&gt;") && page.contains("<td>2.00</td><td>≥ 2.1</td><td class=\"no\">")
        );
        assert!(!page.contains("src=") && !page.contains("@import") && !page.contains("<link"));
    }
}
