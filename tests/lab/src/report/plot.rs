//! Plots as SVG: error over time per tick, or over something else, both logarithmic.
use std::fmt::Write as _;

/// A method's points, by resolution.
pub(crate) struct Series<'a> {
    pub(crate) name: &'a str,
    pub(crate) colour: &'a str,
    pub(crate) points: Vec<Point>,
}

/// One resolution.
#[derive(Debug, Clone)]
pub(crate) struct Point {
    /// The abscissa ([`Across`]).
    pub(crate) across: f64,
    /// Relative error.
    pub(crate) error: f64,
    pub(crate) on_front: bool,
    /// Filled; otherwise hollow: out of competition.
    pub(crate) competes: bool,
    /// For the pointer.
    pub(crate) label: String,
}

/// The abscissa.
pub(crate) struct Across {
    /// What it is.
    label: &'static str,
    /// What a decade is called.
    decade: fn(i32) -> String,
    /// A value that all is about, with its name.
    mark: Option<(f64, &'static str)>,
}

impl Across {
    /// Time per tick (µs).
    pub(crate) const TIME_US: Self =
        Self { label: "median time per 1 ms tick", decade: time, mark: Some((TICK_US, "1 ms")) };
    /// Particles awake.
    pub(crate) const ACTIVE: Self =
        Self { label: "particles awake", decade: |decade| 10_f64.powi(decade).to_string(), mark: None };
}

const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 380.0;
const LEFT: f64 = 62.0;
const RIGHT: f64 = 30.0;
const TOP: f64 = 14.0;
const BOTTOM: f64 = 46.0;
/// The tick that all is about (µs).
const TICK_US: f64 = 1000.0;

/// Decades from the one below to the one above.
struct Axis {
    low: i32,
    high: i32,
    from: f64,
    to: f64,
}

impl Axis {
    fn over(values: impl Iterator<Item = f64>, (from, to): (f64, f64)) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.filter(|v| *v > 0.0 && v.is_finite()) {
            (low, high) = (low.min(value.log10()), high.max(value.log10()));
        }
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        let low_decade = low.floor() as i32;
        Self { low: low_decade, high: (high.ceil() as i32).max(low_decade + 1), from, to }
    }

    fn at(&self, value: f64) -> f64 {
        let fraction = (value.log10() - f64::from(self.low)) / f64::from(self.high - self.low);
        self.from + fraction.clamp(0.0, 1.0) * (self.to - self.from)
    }
}

/// The plot; errors below `floor`, the reference's own uncertainty, are shaded.
pub(crate) fn svg(series: &[Series<'_>], floor: f64, across: &Across) -> String {
    let points = || series.iter().flat_map(|s| &s.points);
    let x = Axis::over(points().map(|p| p.across).chain(across.mark.map(|mark| mark.0)), (LEFT, WIDTH - RIGHT));
    let y = Axis::over(points().map(|p| p.error), (HEIGHT - BOTTOM, TOP));
    let mut out = format!(
        "<svg viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"error over {}\" \
         xmlns=\"http://www.w3.org/2000/svg\">",
        across.label
    );
    frame(&mut out, (&x, across), &y, floor);
    let mut front: Vec<&Point> = points().filter(|p| p.on_front).collect();
    front.sort_by(|a, b| a.across.total_cmp(&b.across));
    let place = |p: &Point| format!("{:.1},{:.1}", x.at(p.across), y.at(p.error));
    let line: Vec<String> = front.iter().map(|p| place(p)).collect();
    let _ = write!(out, "<polyline class=\"front\" points=\"{}\"/>", line.join(" "));
    // The first, the default, on top.
    for s in series.iter().rev() {
        let line: Vec<String> = s.points.iter().map(place).collect();
        let _ = write!(out, "<polyline class=\"series\" stroke=\"{}\" points=\"{}\"/>", s.colour, line.join(" "));
        for p in &s.points {
            let (cx, cy) = (x.at(p.across), y.at(p.error));
            let ring = if p.on_front { " class=\"ring\"" } else { "" };
            let fill = if p.competes {
                format!("fill=\"{}\"", s.colour)
            } else {
                format!("fill=\"#fff\" stroke=\"{}\"", s.colour)
            };
            let _ = write!(
                out,
                "<circle cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"{}\" {fill}{ring}><title>{}: {}</title></circle>",
                if p.on_front { 5.5 } else { 4.0 },
                super::page::escape(s.name),
                super::page::escape(&p.label)
            );
        }
    }
    out.push_str("</svg>");
    out
}

fn frame(out: &mut String, (x, across): (&Axis, &Across), y: &Axis, floor: f64) {
    let (bottom, right) = (HEIGHT - BOTTOM, WIDTH - RIGHT);
    if floor > 10f64.powi(y.low) {
        let top = y.at(floor);
        let _ = write!(
            out,
            "<rect class=\"floor\" x=\"{LEFT}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\"/>",
            right - LEFT,
            bottom - top
        );
    }
    for decade in x.low..=x.high {
        let at = x.at(10f64.powi(decade));
        let _ = write!(
            out,
            "<line class=\"grid\" x1=\"{at:.1}\" y1=\"{TOP}\" x2=\"{at:.1}\" y2=\"{bottom}\"/><text x=\"{at:.1}\" y=\"{}\" \
             text-anchor=\"middle\">{}</text>",
            bottom + 17.0,
            (across.decade)(decade)
        );
    }
    for decade in y.low..=y.high {
        let at = y.at(10f64.powi(decade));
        let _ = write!(
            out,
            "<line class=\"grid\" x1=\"{LEFT}\" y1=\"{at:.1}\" x2=\"{right}\" y2=\"{at:.1}\"/><text x=\"{}\" y=\"{:.1}\" \
             text-anchor=\"end\">{}</text>",
            LEFT - 6.0,
            at + 4.0,
            percent(decade)
        );
    }
    if let Some((value, name)) = across.mark {
        let at = x.at(value);
        let _ = write!(
            out,
            "<line class=\"tick\" x1=\"{at:.1}\" y1=\"{TOP}\" x2=\"{at:.1}\" y2=\"{bottom}\"/><text class=\"ticktext\" x=\"{:.1}\" \
             y=\"{:.1}\" text-anchor=\"end\">{name}</text>",
            at - 4.0,
            TOP + 12.0
        );
    }
    let _ = write!(
        out,
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text><text transform=\"translate(13 {:.1}) rotate(-90)\" \
         text-anchor=\"middle\">error</text>",
        f64::midpoint(LEFT, right),
        HEIGHT - 8.0,
        across.label,
        f64::midpoint(TOP, bottom)
    );
}

fn time(decade: i32) -> String {
    match decade {
        3.. => format!("{} ms", 10_i64.pow(decade as u32 - 3)),
        0..=2 => format!("{} µs", 10_i64.pow(decade as u32)),
        _ => format!("10^{decade} µs"),
    }
}

fn percent(decade: i32) -> String {
    match decade {
        -2.. => format!("{} %", 10_i64.pow((decade + 2) as u32)),
        -6..=-3 => format!("{:.*} %", (-2 - decade) as usize, 10f64.powi(decade + 2)),
        _ => format!("1e{} %", decade + 2),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_decade_is_where_it_belongs() {
        let axis = Axis::over([2.0, 300.0].into_iter(), (0.0, 300.0));
        assert_eq!((axis.low, axis.high), (0, 3));
        assert!((axis.at(10.0) - 100.0).abs() < 1e-9);
        assert_eq!([time(1), time(3), time(4)], ["10 µs", "1 ms", "10 ms"]);
        assert_eq!([percent(-2), percent(-3), percent(0)], ["1 %", "0.1 %", "100 %"]);
    }

    #[test]
    fn a_plot_without_points_is_still_a_plot() {
        assert!(svg(&[], 0.0, &Across::TIME_US).ends_with("</svg>"));
    }
}
