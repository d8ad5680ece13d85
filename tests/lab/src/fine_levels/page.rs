//! The page: what all cases come to, and a plot of each.
use super::study::{Row, Summary, summaries};
use crate::report::{
    COLOURS, STYLE,
    plot::{Across, Point, Series, svg},
};
use std::fmt::Write as _;

pub(super) fn page(rows: &[Row]) -> String {
    let mut out = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>Palpate: fine levels of a hybrid body</title><style>{STYLE}</style><body><h1>Fine levels of a hybrid body</h1>\
         <p>A small patch is pressed on bodies of composite coarse tets whose particles nearest to it are awake; what is between particles differs. Errors of the \
         displacement conjugate to the load, and of the field around, against the references; at rest.</p>"
    );
    table(&mut out, &summaries(rows));
    let mut names: Vec<&str> = Vec::new();
    for row in rows {
        if !names.contains(&row.method.as_str()) {
            names.push(&row.method);
        }
    }
    out.push_str("<div class=\"legend\">");
    for (name, colour) in names.iter().zip(COLOURS) {
        let _ = write!(out, "<span><i style=\"background:{colour}\"></i>{name}</span>");
    }
    out.push_str("</div>");
    let mut seen: Vec<(&str, &str, usize)> = Vec::new();
    for row in rows {
        let case = (row.problem.as_str(), row.mesh, row.coarse_tets);
        if seen.contains(&case) {
            continue;
        }
        seen.push(case);
        let series: Vec<Series<'_>> = names
            .iter()
            .zip(COLOURS)
            .map(|(name, colour)| {
                let of =
                    rows.iter().filter(|r| (r.problem.as_str(), r.mesh, r.coarse_tets) == case && r.method == *name);
                Series { name, colour, points: of.map(point).collect() }
            })
            .collect();
        let _ = write!(
            out,
            "<h3>{}, {} coarse tets, {} mesh</h3>{}",
            case.0,
            case.2,
            case.1,
            svg(&series, 0.0, &Across::ACTIVE)
        );
    }
    out.push_str("</body></html>");
    out
}

fn point(row: &Row) -> Point {
    let label = format!(
        "{} awake, {} points: field {:.1} %, answer {:+.1} %",
        row.active,
        row.points,
        100.0 * row.field_l2,
        100.0 * row.answer_error
    );
    Point { across: row.active as f64, error: row.field_l2, on_front: false, competes: true, label }
}

fn table(out: &mut String, summaries: &[Summary]) {
    out.push_str(
        "<table><tr><th>method</th><th>active</th><th>answer, median</th><th>largest</th><th>field, median</th><th>largest</th>\
         <th>nearest in</th></tr>",
    );
    for Summary { method, active, answer, field, nearest } in summaries {
        let percents =
            |[median, largest]: [f64; 2]| format!("<td>{:.1} %</td><td>{:.1} %</td>", 100.0 * median, 100.0 * largest);
        let _ = write!(
            out,
            "<tr><td>{method}</td><td>{active}</td>{}{}<td>{} of {}</td></tr>",
            percents(*answer),
            percents(*field),
            nearest[0],
            nearest[1]
        );
    }
    out.push_str("</table>");
}
