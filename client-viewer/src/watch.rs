//! `watch`: one line a second of what a viewer feels.
use crate::{
    ViewError, cli,
    connect::Server,
    surface::{Surface, Watcher, magnitude},
};
use clap::Args;
use palpate_proto::{connect::causes, v1::LevelOfDetail};
use std::{
    io::Write as _,
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

/// Arguments of `watch`.
#[derive(Debug, Args)]
pub struct WatchArguments {
    /// Stop after so many seconds (until interrupted when absent)
    #[arg(long, value_name = "SECONDS", value_parser = parse_seconds, allow_negative_numbers = true)]
    seconds: Option<Duration>,
    /// Most updates per second to ask for, up to 240; 0: the daemon's display rate
    #[arg(long, default_value_t = 60.0, value_name = "HZ", allow_negative_numbers = true)]
    rate_hz: f64,
    /// Ask for numbers only, without the surface
    #[arg(long)]
    numbers_only: bool,
    /// One JSON object a line instead of a table
    #[arg(long)]
    json: bool,
}

fn parse_seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text.parse().map_err(|error| format!("{error}"))?;
    Duration::try_from_secs_f64(seconds).map_err(|error| format!("{error}"))
}

/// Less than this (s) is no rate.
const SHORTEST_S: f64 = 0.5;

/// What one second of the stream was like.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
struct Second {
    scene_name: String,
    session_id: String,
    time_s: f64,
    rate_hz: f64,
    delay_ms_median: f64,
    delay_ms_worst: f64,
    skipped: u64,
    contact_force_n: f64,
    device_force_n: f64,
    max_displacement_mm: f64,
    tick_cost_us: f32,
    /// Why the body stands, in the daemon's words; empty: it does not.
    quarantine: String,
}

/// Pauses before a lost stream is asked for again.
const PAUSES: [Duration; 5] = [
    Duration::from_millis(250),
    Duration::from_millis(500),
    Duration::from_secs(1),
    Duration::from_secs(2),
    Duration::from_secs(4),
];

/// Runs `watch`: a stream that is lost is asked for again, as long as it is wanted.
///
/// # Errors
/// A daemon that was never reached, or that refuses.
pub async fn run(server: &Server, arguments: &WatchArguments) -> Result<(), ViewError> {
    let ends = arguments.seconds.map(|seconds| Instant::now() + seconds);
    let mut attempts = 0;
    let mut has_watched = false;
    loop {
        let Err(error) = watch_once(server, arguments, ends, &mut attempts, &mut has_watched).await else {
            return Ok(());
        };
        if !(has_watched && may_come_back(&error)) {
            return Err(error);
        }
        let pause = PAUSES[PAUSES.len().min(attempts + 1) - 1];
        if ends.is_some_and(|ends| Instant::now() + pause >= ends) {
            return Err(error);
        }
        // A reader that has gone misses it, no more.
        let _ = writeln!(std::io::stderr(), "{}; trying again in {} s", causes(&error), pause.as_secs_f64());
        attempts += 1;
        tokio::time::sleep(pause).await;
    }
}

/// Whether a daemon that is started anew may answer otherwise.
fn may_come_back(error: &ViewError) -> bool {
    match error {
        ViewError::Unreachable { .. } | ViewError::Lost(_) | ViewError::Stream(_) | ViewError::Silent { .. } => true,
        ViewError::Refused { code, .. } => code == "Unavailable",
        _ => false,
    }
}

/// Watches one stream to its end, or to that of the time; with its first update `attempts` begin anew.
async fn watch_once(
    server: &Server,
    arguments: &WatchArguments,
    ends: Option<Instant>,
    attempts: &mut usize,
    has_watched: &mut bool,
) -> Result<(), ViewError> {
    let detail = if arguments.numbers_only { LevelOfDetail::Numbers } else { LevelOfDetail::Full };
    let mut watcher = Watcher::start(server.connect().await?, arguments.rate_hz, detail).await?;
    let mut second = Window::new(Instant::now());
    let mut named = None;
    loop {
        let left = ends.map(|ends| ends.saturating_duration_since(Instant::now()));
        if left.is_some_and(|left| left.is_zero()) {
            break;
        }
        let next = tokio::time::timeout(left.unwrap_or(Duration::MAX), watcher.next());
        let Ok(next) = next.await else { break };
        let Some(surface) = next? else {
            return Err(ViewError::Stream("was ended by the daemon".into()));
        };
        (*attempts, *has_watched) = (0, true);
        if named != Some(surface.epoch) {
            named = Some(surface.epoch);
            // Numbers of two scenes make no mean.
            second = Window::new(Instant::now());
            if !arguments.json {
                cli::say(&heading(surface))?;
            }
        }
        if let Some(done) = second.take(surface, Instant::now()) {
            cli::say(&row(&done, arguments.json))?;
        }
    }
    // The last second ends a little early: with the time that was asked for.
    let last = watcher.surface.as_ref().filter(|surface| named == Some(surface.epoch));
    let last = last.and_then(|surface| second.close(surface, Instant::now(), SHORTEST_S));
    last.map_or(Ok(()), |last| cli::say(&row(&last, arguments.json)))
}

/// The scene, whose forces are shown, and the columns.
fn heading(surface: &Surface) -> String {
    let header = &surface.header;
    let tool = match header.tools.as_slice() {
        [] => "no tool".to_owned(),
        [tool] => format!("tool {}", tool.name),
        [tool, others @ ..] => format!("forces of tool {}, not of the {} others", tool.name, others.len()),
    };
    format!(
        "{}: {} vertices, {tool}\n{:>9} {:>7} {:>16} {:>8} {:>10} {:>10} {:>10} {:>8}",
        header.scene_name,
        header.vertex_count,
        "time s",
        "Hz",
        "delay ms (worst)",
        "skipped",
        "contact N",
        "arm N",
        "moved mm",
        "tick us"
    )
}

fn row(second: &Second, json: bool) -> String {
    if json {
        // A struct of numbers and a name always has a JSON form.
        return serde_json::to_string(second).unwrap_or_default();
    }
    let numbers = format!(
        "{:>9.2} {:>7.1} {:>8.1} ({:>5.1}) {:>8} {:>10.4} {:>10.4} {:>10.3} {:>8.0}",
        second.time_s,
        second.rate_hz,
        second.delay_ms_median,
        second.delay_ms_worst,
        second.skipped,
        second.contact_force_n,
        second.device_force_n,
        second.max_displacement_mm,
        second.tick_cost_us
    );
    if second.quarantine.is_empty() { numbers } else { format!("{numbers}\nQUARANTINED: {}", second.quarantine) }
}

/// Collects updates over a second.
struct Window {
    begin: Instant,
    delays_ms: Vec<f64>,
}

impl Window {
    fn new(begin: Instant) -> Self {
        Self { begin, delays_ms: Vec::new() }
    }

    fn take(&mut self, surface: &Surface, now: Instant) -> Option<Second> {
        self.delays_ms.push(delay_ms(surface.last.sent_unix_ns));
        self.close(surface, now, 1.0)
    }

    /// What was collected, when that took so long at least (s).
    fn close(&mut self, surface: &Surface, now: Instant, least_s: f64) -> Option<Second> {
        let update = &surface.last;
        let span_s = (now - self.begin).as_secs_f64();
        if span_s < least_s || self.delays_ms.is_empty() {
            return None;
        }
        self.delays_ms.sort_by(f64::total_cmp);
        let tool = update.tools.first();
        let second = Second {
            scene_name: surface.header.scene_name.clone(),
            session_id: surface.header.session_id.clone(),
            time_s: update.time_s,
            rate_hz: self.delays_ms.len() as f64 / span_s,
            delay_ms_median: self.delays_ms[self.delays_ms.len() / 2],
            delay_ms_worst: self.delays_ms[self.delays_ms.len() - 1],
            skipped: update.skipped,
            contact_force_n: tool.map_or(0.0, |t| magnitude(t.contact_force_n.as_ref())),
            device_force_n: tool.map_or(0.0, |t| magnitude(t.device_force_n.as_ref())),
            max_displacement_mm: 1e3 * update.max_displacement_m,
            tick_cost_us: update.tick_cost_us as f32,
            quarantine: update.quarantine.clone(),
        };
        *self = Self::new(now);
        Some(second)
    }
}

/// Age of a time stamp on this machine's clock (ms); meaningful when daemon and viewer share it.
fn delay_ms(sent_unix_ns: u64) -> f64 {
    let now_ns = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |d| d.as_nanos() as f64);
    (now_ns - sent_unix_ns as f64) * 1e-6
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_proto::v1::{SurfaceUpdate, Vec3};

    #[test]
    fn a_second_counts_its_updates() {
        let begin = Instant::now();
        let mut window = Window::new(begin);
        let force = Vec3 { x: 3.0, y: 0.0, z: 4.0 };
        let tool = palpate_proto::v1::ToolState { contact_force_n: Some(force), ..Default::default() };
        let last = SurfaceUpdate { tools: vec![tool], skipped: 3, max_displacement_m: 0.002, ..Default::default() };
        let surface = Surface { last, ..Default::default() };
        for i in 0..10 {
            assert!(window.take(&surface, begin + Duration::from_millis(100 * i)).is_none());
        }
        let second = window.take(&surface, begin + Duration::from_secs(1)).unwrap();
        assert!((second.rate_hz - 11.0).abs() < 1e-9);
        assert_eq!((second.contact_force_n, second.skipped, second.max_displacement_mm), (5.0, 3, 2.0));
        assert!(window.delays_ms.is_empty());
        // `--seconds 1` showed nothing: its second was never over.
        let end = begin + Duration::from_millis(1990);
        assert!(window.close(&surface, end, SHORTEST_S).is_none(), "no updates, no numbers");
        assert!(window.take(&surface, begin + Duration::from_millis(1500)).is_none());
        assert!(window.close(&surface, begin + Duration::from_millis(1499), SHORTEST_S).is_none(), "too short");
        assert!((window.close(&surface, end, SHORTEST_S).unwrap().rate_hz - 1.0 / 0.99).abs() < 1e-9);
        assert_eq!(row(&second, false).lines().count(), 1);
    }

    #[test]
    fn a_quarantine_is_said_with_the_numbers() {
        let last = SurfaceUpdate { quarantine: "tick 7 was refused".into(), ..Default::default() };
        let begin = Instant::now();
        let second = Window::new(begin).take(&Surface { last, ..Default::default() }, begin + Duration::from_secs(1));
        let second = second.unwrap();
        assert!(row(&second, false).ends_with("\nQUARANTINED: tick 7 was refused"));
        assert!(row(&second, true).contains(r#""quarantine":"tick 7 was refused""#));
    }
}
