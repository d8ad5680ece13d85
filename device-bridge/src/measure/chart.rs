//! Histograms of times: bars of text, and a picture.
use palpate_realtime::Histogram;
use std::fmt::Write as _;

/// Edges (us) between bars: five a decade, from 1 us to 100 ms.
const EDGES: usize = 26;
const WIDEST: usize = 50;

/// Upper edge of a bar (us), `10^(n/5)`.
fn edge_us(n: usize) -> f64 {
    10_f64.powf(n as f64 / 5.0)
}

/// Share of the values in each bar that is not empty, from the first to the last of them: its upper edge (us) and the share. The last is of all that is longer.
fn shares(times: &Histogram) -> Vec<(f64, f64)> {
    let total = times.count();
    let mut below = 0;
    let mut all: Vec<(f64, f64)> = (0..EDGES)
        .map(|n| {
            let up_to = times.count_up_to((1e3 * edge_us(n)) as u64);
            let count = up_to.saturating_sub(std::mem::replace(&mut below, up_to));
            (edge_us(n), count as f64 / total.max(1) as f64)
        })
        .collect();
    all.push((f64::INFINITY, total.saturating_sub(below) as f64 / total.max(1) as f64));
    let first = all.iter().position(|(_, share)| *share > 0.0).unwrap_or(all.len());
    let last = all.iter().rposition(|(_, share)| *share > 0.0).map_or(first, |last| last + 1);
    all[first..last].to_vec()
}

/// A line for each bar.
pub fn bars(title: &str, times: &Histogram) -> String {
    let mut text = format!("{title}, {} values\n", times.count());
    let shares = shares(times);
    let most = shares.iter().map(|(_, share)| *share).fold(f64::MIN_POSITIVE, f64::max);
    for (edge_us, share) in shares {
        let length = (share / most * WIDEST as f64).round() as usize;
        let bar = if length == 0 { "·".to_owned() } else { "█".repeat(length) };
        let edge = if edge_us.is_finite() { format!("{edge_us:>8.1}") } else { "  longer".into() };
        // Writing into a String cannot fail.
        let _ = writeln!(text, "  ≤ {edge} us {:>8.4} % {bar}", 100.0 * share);
    }
    text
}

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 190.0;
const LEFT: f64 = 60.0;
const TOP: f64 = 30.0;

/// A picture of several, one beneath another, on common logarithmic axes: a bar's height is the logarithm of its share, from one in a million.
pub fn svg(charts: &[(&str, &Histogram)]) -> String {
    let height = TOP + HEIGHT * charts.len() as f64;
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {height}\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        WIDTH + LEFT + 20.0
    );
    for (n, (title, times)) in charts.iter().enumerate() {
        chart(&mut text, TOP + HEIGHT * n as f64, title, times);
    }
    text.push_str("</svg>\n");
    text
}

fn chart(text: &mut String, top: f64, title: &str, times: &Histogram) {
    let (plot, bar) = (HEIGHT - 60.0, WIDTH / (EDGES + 1) as f64);
    let bottom = top + plot;
    let escaped = title.replace('&', "&amp;").replace('<', "&lt;");
    let _ = writeln!(
        text,
        "<text x=\"{LEFT}\" y=\"{}\" font-size=\"13\">{escaped} ({} values)</text>",
        top - 6.0,
        times.count()
    );
    for decade in 0..=6 {
        let y = top + plot * f64::from(decade) / 6.0;
        let label = ["100 %", "10 %", "1 %", "0.1 %", "100 ppm", "10 ppm", "1 ppm"][decade as usize];
        let _ =
            writeln!(text, "<line x1=\"{LEFT}\" x2=\"{}\" y1=\"{y:.1}\" y2=\"{y:.1}\" stroke=\"#ddd\"/>", LEFT + WIDTH);
        let _ = writeln!(text, "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>", LEFT - 4.0, y + 4.0);
    }
    for (edge, share) in shares(times).into_iter().filter(|(_, share)| *share > 0.0) {
        let n = if edge.is_finite() { (5.0 * edge.log10()).round() } else { EDGES as f64 };
        // One in a million is a bar of no height.
        let h = plot * (1.0 + share.log10() / 6.0).clamp(0.0, 1.0);
        let (x, y) = (LEFT + n * bar, bottom - h);
        let _ = writeln!(
            text,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"{h:.1}\" fill=\"#3b78b5\"><title>{:.4} %</title></rect>",
            bar - 1.0,
            100.0 * share
        );
    }
    for (n, label) in [(0, "1 us"), (5, "10 us"), (10, "100 us"), (15, "1 ms"), (20, "10 ms"), (25, "100 ms")] {
        let x = LEFT + bar * f64::from(n + 1);
        let _ = writeln!(
            text,
            "<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{bottom}\" y2=\"{}\" stroke=\"#555\"/>",
            bottom + 4.0
        );
        let _ = writeln!(text, "<text x=\"{x:.1}\" y=\"{}\" text-anchor=\"middle\">{label}</text>", bottom + 16.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times() -> Histogram {
        let times = Histogram::new();
        for us in [5, 5, 5, 90, 200_000] {
            times.record(1000 * us);
        }
        times
    }

    #[test]
    fn bars_hold_every_value_once() {
        let shares = shares(&times());
        assert!((shares.iter().map(|(_, share)| share).sum::<f64>() - 1.0).abs() < 1e-12);
        let full: Vec<f64> = shares.iter().filter(|(_, share)| *share > 0.0).map(|(edge, _)| edge.round()).collect();
        assert_eq!(full, [6.0, 100.0, f64::INFINITY]);
        let text = bars("trip", &times());
        assert!(text.contains("60.0000 % ███") && text.contains("longer"), "{text}");
        assert_eq!(bars("trip", &Histogram::new()), "trip, 0 values\n");
    }

    #[test]
    fn a_picture_is_svg_with_a_bar_for_each() {
        let picture = svg(&[("a < b", &times()), ("c", &Histogram::new())]);
        assert!(picture.starts_with("<svg") && picture.ends_with("</svg>\n"));
        assert_eq!(picture.matches("<title>").count(), 3);
        assert!(picture.contains("a &lt; b") && !picture.contains("NaN") && !picture.contains("inf"));
    }
}
