//! The page's section on numerical stress.
use super::page::escape;
use crate::measure::Run;
use crate::stress::{Measured, Outcome, Record, Row, number, records, verdict};
use miette::Result;
use std::fmt::Write as _;

pub(super) fn section(out: &mut String, results: &[(Row, Outcome)], run: &Run) -> Result<()> {
    if results.is_empty() {
        return Ok(());
    }
    out.push_str(
        "<h2 id=\"stress\">Numerical stress</h2><p>What the numerics are put through, and what passes. A row that fails says why; \
         <code>docs/stress.md</code> tells more. Open a row for its numbers, which are of the form that is named: <code>palpate-lab stress</code> goes through the short one, with \
         <code>--long</code> through the one that the criterion names; a quick run reduces it further.</p>",
    );
    let quick = run.circumstances.get("options").is_some_and(|options| options.starts_with("quick"));
    let form = if quick { "reduced form" } else { "short form" };
    for (row, outcome) in results {
        let numbers = outcome.measured.iter().map(|m: &Measured| (m.name.as_str(), m.value, m.unit, m.limit));
        entry(out, [row.name, row.criterion, verdict(outcome), &outcome.reason(), form], numbers);
    }
    let records = records()?;
    if !records.is_empty() {
        out.push_str("<h3>Long runs, done once</h3>");
    }
    for Record { row, criterion, verdict, reason, command, date, commit, processor, elapsed_s, numbers } in &records {
        let numbers = numbers.iter().map(|n| (n.name.as_str(), n.value, n.unit.as_str(), n.limit));
        entry(out, [row, criterion, verdict, reason, "long form"], numbers);
        let circumstances = format!("{date}, commit {commit}, {processor}, {elapsed_s} s, by {command}");
        let _ = write!(out, "<p>{}</p>", escape(&circumstances));
    }
    Ok(())
}

fn entry<'a>(
    out: &mut String,
    [name, criterion, verdict, reason, form]: [&str; 5],
    numbers: impl Iterator<Item = (&'a str, f64, &'a str, Option<f64>)>,
) {
    let class = if verdict == "passes" { "yes" } else { "no" };
    let because = if reason.is_empty() { String::new() } else { format!(" Because: {reason}.") };
    let _ = write!(
        out,
        "<details><summary><b>{}</b> <span class=\"{class}\">{verdict}</span> ({form}): {}.{}</summary><table><tr><th>number</th>\
         <th>value</th><th>at most</th><th>unit</th></tr>",
        escape(name),
        escape(criterion),
        escape(&because)
    );
    for (name, value, unit, limit) in numbers {
        let holds = limit.is_none_or(|limit| value <= limit);
        let _ = write!(
            out,
            "<tr><td>{}</td><td{}>{}</td><td>{}</td><td>{}</td></tr>",
            escape(name),
            if holds { "" } else { " class=\"no\"" },
            number(value),
            limit.map_or(String::new(), number),
            escape(unit)
        );
    }
    out.push_str("</table></details>");
}
