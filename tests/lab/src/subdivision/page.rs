//! The page: the figures as plots.
use super::{
    contact::{Run, Touch},
    dome::Dome,
    experiment::{ANCHOR_N_PER_M, Curve, EDGE_M, Figure},
};
use std::fmt::Write as _;

const COLOURS: [&str; 4] = ["#0072b2", "#d55e00", "#009e73", "#8a6fb3"];
const STYLE: &str = "
:root{color-scheme:light}
body{font:16px/1.5 system-ui,sans-serif;color:#1b1f24;background:#fff;max-width:72rem;margin:0 auto;padding:1.5rem}
p{max-width:48rem}svg text{font:12px system-ui,sans-serif;fill:#57606a}.grid{stroke:#e3e7eb}.curve{fill:none;stroke-width:2}
.figures{display:grid;grid-template-columns:repeat(auto-fill,minmax(25rem,1fr));gap:1.2rem}figure{margin:0}svg{width:100%;height:auto}
figcaption{font-size:14px;color:#57606a}table{border-collapse:collapse;font-size:14px}td,th{padding:.15rem .5rem;text-align:right;white-space:nowrap}td:first-child{text-align:left}";
const WIDTH: f64 = 420.0;
const HEIGHT: f64 = 280.0;
const LEFT: f64 = 56.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 10.0;
const BOTTOM: f64 = 40.0;
/// What is so many times its median somewhere is drawn in decades.
const LOGARITHMIC: f64 = 20.0;

/// The page of all figures, at each `K_m/K_h`, and of sheets beneath tools.
pub(super) fn page(all: &[(f64, Vec<Figure>)], domes: &[Dome], contacts: &[(Touch, Vec<Run>)]) -> String {
    let mut out = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>Palpate: haptic subdivision</title><style>{STYLE}</style><body><h1>Haptic subdivision</h1>\
         <p>Figures 5 to 11 of <i>Haptic Subdivision: an Approach to Defining Level-of-detail in Haptic Rendering</i> (Zhang, Payandeh, Dill). \
         A flat sheet of equilateral triangles with edges L = {} mm, anchor springs K<sub>h</sub> = {} N/m; one vertex is pulled out of it by x, all others \
         are at rest. Six or eight rings of triangles about it, their outer edge free.</p>",
        EDGE_M * 1e3,
        ANCHOR_N_PER_M
    );
    for (mesh_over_anchor, figures) in all {
        let _ = write!(out, "<h2>K<sub>m</sub>/K<sub>h</sub> = {mesh_over_anchor}</h2><div class=\"figures\">");
        for figure in figures {
            let _ = write!(
                out,
                "<figure>{}<figcaption>Figure {}. {}{}</figcaption></figure>",
                svg(&format!("figure {}", figure.number), (figure.quantity, "x/L"), &figure.curves),
                figure.number,
                figure.title.replace('\'', "′"),
                legend(&figure.curves)
            );
        }
        out.push_str("</div>");
    }
    out.push_str("<h2>Figure 12</h2><p>A hemisphere pressed by an edge's length at a vertex, all others at rest; refined with constants matched there, so that the force is the same.</p><div class=\"figures\">");
    for dome in domes {
        let _ = write!(
            out,
            "<figure>{}<figcaption>rings refined: {}; {:.4} N</figcaption></figure>",
            dome.svg(),
            dome.rings,
            dome.force_n
        );
    }
    out.push_str("</div>");
    contact_section(&mut out, contacts);
    out.push_str("</body></html>");
    out
}

/// Sheets beneath tools.
fn contact_section(out: &mut String, contacts: &[(Touch, Vec<Run>)]) {
    const DRAWN: [&str; 4] = ["fine everywhere", "coarse", "two rings, table", "two rings, area"];
    out.push_str(
        "<h2>In the loop, against a sheet that is fine everywhere</h2><p>A sphere presses, rests, is drawn along, and leaves. The fine sheet has the same foundation and mass per area. \
         Errors are root mean squares over all ticks, over those of the fine sheet's force and displacements.</p><div class=\"figures\">",
    );
    for (Touch { name, radius, depth }, runs) in contacts {
        let drawn = DRAWN.iter().filter_map(|name| runs.iter().find(|run| run.name == *name));
        let curves: Vec<Curve> = drawn.map(curve).collect();
        let _ = write!(
            out,
            "<figure>{}<figcaption>{name}: radius {radius} L, {depth} L deep{}</figcaption><table><tr><th></th><th>at rest</th><th>force off</th><th>shape off</th><th>µs a tick</th></tr>",
            svg(name, ("force (N)", "t (s)"), &curves),
            legend(&curves)
        );
        for run in runs {
            let (force, shape) = (100.0 * run.force_error, 100.0 * run.shape_error);
            let _ = write!(
                out,
                "<tr><td>{}</td><td>{:.3}</td><td>{force:.1} %</td><td>{shape:.1} %</td><td>{:.0}</td></tr>",
                run.name, run.at_rest, run.tick_us
            );
        }
        out.push_str("</table></figure>");
    }
    out.push_str("</div>");
}

fn curve(run: &Run) -> Curve {
    let ticks = run.force_n.len() as f64;
    let points = run.force_n.iter().enumerate().step_by(4);
    Curve {
        name: run.name.clone(),
        points: points.map(|(tick, force)| ((tick as f64 + 1.0) / ticks, force.length())).collect(),
    }
}

fn legend(curves: &[Curve]) -> String {
    let entry = |(curve, colour): (&Curve, &str)| {
        format!("<br><span style=\"color:{colour}\">{}</span>", curve.name.replace('\'', "′"))
    };
    if curves.len() < 2 { String::new() } else { curves.iter().zip(COLOURS).map(entry).collect() }
}

/// The ordinate: from the least to the largest value, in round steps or in decades.
struct Ordinate {
    low: f64,
    high: f64,
    is_logarithmic: bool,
}

impl Ordinate {
    fn over(values: &[f64]) -> Self {
        let [low, high] = [f64::min, f64::max].map(|pick| values.iter().copied().fold(values[0], pick));
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        if high > LOGARITHMIC * sorted[sorted.len() / 2] {
            return Self { low: low.log10().floor(), high: high.log10().ceil(), is_logarithmic: true };
        }
        let step = round_step(high);
        Self { low: 0.0, high: (high / step).ceil() * step, is_logarithmic: false }
    }

    fn at(&self, value: f64) -> f64 {
        let value = if self.is_logarithmic { value.log10() } else { value };
        HEIGHT - BOTTOM - (value - self.low) / (self.high - self.low) * (HEIGHT - BOTTOM - TOP)
    }

    fn marks(&self) -> Vec<f64> {
        if self.is_logarithmic {
            return (self.low as i32..=self.high as i32).map(|decade| 10_f64.powi(decade)).collect();
        }
        let step = round_step(self.high);
        (0..=(self.high / step).round() as u32).map(|n| f64::from(n) * step).collect()
    }
}

/// Some five steps of 1, 2 or 5 times a power of ten.
fn round_step(high: f64) -> f64 {
    let decade = 10_f64.powf((high / 5.0).log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|n| n * decade).find(|step| high / step <= 6.0).unwrap_or(high)
}

fn svg(label: &str, (ordinate, abscissa): (&str, &str), curves: &[Curve]) -> String {
    let values: Vec<f64> = curves.iter().flat_map(|curve| &curve.points).map(|p| p.1).collect();
    if values.is_empty() {
        return String::new();
    }
    let y = Ordinate::over(&values);
    let x = |part: f64| LEFT + part * (WIDTH - LEFT - RIGHT);
    let mut out = format!(
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{label}\" xmlns=\"http://www.w3.org/2000/svg\">"
    );
    for mark in y.marks() {
        let at = y.at(mark);
        let label = format!("{mark:.10}").trim_end_matches('0').trim_end_matches('.').to_owned();
        let _ = write!(
            out,
            "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{}\" y1=\"{at:.1}\" y2=\"{at:.1}\"/>\
             <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
            WIDTH - RIGHT,
            LEFT - 6.0,
            at + 4.0
        );
    }
    for fifth in 0..=5 {
        let part = f64::from(fifth) / 5.0;
        let _ = write!(
            out,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{part}</text>",
            x(part),
            HEIGHT - BOTTOM + 16.0
        );
    }
    for (number, curve) in curves.iter().enumerate() {
        let colour = COLOURS[number % COLOURS.len()];
        let line: Vec<String> =
            curve.points.iter().map(|(part, value)| format!("{:.1},{:.1}", x(*part), y.at(*value))).collect();
        let _ = write!(out, "<polyline class=\"curve\" stroke=\"{colour}\" points=\"{}\"/>", line.join(" "));
    }
    let _ = write!(
        out,
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{abscissa}</text><text x=\"12\" y=\"{:.1}\" text-anchor=\"middle\" \
         transform=\"rotate(-90 12 {:.1})\">{}</text></svg>",
        x(0.5),
        HEIGHT - 6.0,
        0.5 * HEIGHT,
        0.5 * HEIGHT,
        ordinate.replace('\'', "′")
    );
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round_and_few() {
        for (high, step) in [(1.0, 0.2), (3.68, 1.0), (0.43, 0.1), (1.22, 0.5), (2231.0, 500.0)] {
            assert!((round_step(high) / step - 1.0).abs() < 1e-9, "{high}: {}", round_step(high));
        }
        let y = Ordinate::over(&[1.5, 1.6, 2231.0]);
        assert!(y.is_logarithmic && y.marks() == [1.0, 10.0, 100.0, 1000.0, 10000.0]);
        assert!(y.at(10.0) < y.at(1.5));
    }
}
