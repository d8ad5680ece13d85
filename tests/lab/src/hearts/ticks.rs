//! What ticks of irregular hearts cost: at rest, pressed and dragged, and swaying after it.
use super::{
    Heart, answers,
    place::{self, Place},
};
use crate::timing::quantiles;
use clap::Args;
use glam::DVec3;
use miette::{IntoDiagnostic, Result, bail, miette};
use palpate_physics::{
    BodySpec, Model, ModelSpec, Scratch, SelfContactChoice, State, TickInput,
    bodies::hybrid::Waking,
    contact::{Coupling, ToolShape, ToolSpec, ToolTarget},
    step,
};
use palpate_scene::Limits;
use std::{fmt, time::Instant};

/// Depth (m) to which it presses.
const DEPTH_M: f64 = 12e-3;
/// How far (m) it starts from the heart.
const GAP_M: f64 = 20e-3;
/// Speed (m/s) of the hand.
const SPEED_M_PER_S: f64 = 0.1;
/// How far (m) it is dragged either way.
const DRAG_M: f64 = 15e-3;
/// Distance from rest (m) below which a heart sleeps, and ticks after which it is taken never to.
const SLEEP_TOLERANCE_M: f64 = 1e-6;
const MOST_UNTIL_ASLEEP: u32 = 20_000;
/// Ticks of 1 ms at rest, of dragging, after the hand is back until the heart is taken to be left alone, and of swaying alone.
const REST_TICKS: u32 = 300;
const DRAG_TICKS: u32 = 1_000;
const LEAVES_TICKS: u32 = 400;
const SWAY_TICKS: u32 = 300;

/// Tells what is measured, in two sentences.
pub(crate) fn what() -> String {
    format!(
        "Ticks of 1 ms, in microseconds. A finger of {:.0} mm presses {:.0} mm deep and is dragged {:.0} mm to and fro at {:.0} mm/s.",
        1e3 * place::RADIUS_M,
        1e3 * DEPTH_M,
        1e3 * DRAG_M,
        1e3 * SPEED_M_PER_S
    )
}

/// Which hearts.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// How many hearts; the shipped `hybrid-ventricle` comes before them
    #[arg(long, default_value_t = 5)]
    hearts: u64,
    /// Seed of the first of them
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Most particles awake at once
    #[arg(long, value_delimiter = ',', default_values_t = [200, 600])]
    awake: Vec<usize>,
    /// Walls of the heart pass through each other
    #[arg(long)]
    no_self_contact: bool,
    /// Tell what a finger feels at five places instead, beside many tets alone: some minutes a heart
    #[arg(long, conflicts_with = "no_self_contact")]
    answers: bool,
}

impl Options {
    /// So many hearts, with 200 and with 600 particles awake.
    pub(crate) fn of(hearts: u64) -> Self {
        Self { hearts, seed: 1, awake: vec![200, 600], no_self_contact: false, answers: false }
    }
}

/// Measures and prints, as the rows of a table.
///
/// # Errors
/// A heart that cannot be built.
pub fn print(options: &Options) -> Result<()> {
    if options.answers {
        return answers::print(options.seed..options.seed.saturating_add(options.hearts), &options.awake);
    }
    println!("{}\n", what());
    println!(
        "| heart | awake | substeps | at rest | dragged: median, p99, longest | substeps taken | mean force | swaying | asleep: after, median, p99 |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    measure(options, &mut |ticks| println!("{ticks}"))?;
    Ok(())
}

/// Measures the ticks of `hybrid-ventricle` and of so many hearts, and tells each row as it comes.
///
/// # Errors
/// A heart that cannot be made, or did not survive.
pub fn measure(options: &Options, tell: &mut dyn FnMut(&HeartTicks)) -> Result<Vec<HeartTicks>> {
    let mut all = Vec::new();
    let text = palpate_scene::builtin("hybrid-ventricle").ok_or_else(|| miette!("the built-in scene is missing"))?;
    let shipped = palpate_scene::parse(text, "hybrid-ventricle", None, &Limits::local(), &mut |_, _| {})?;
    let mut keep = |ticks: HeartTicks| {
        tell(&ticks);
        all.push(ticks);
    };
    rows("hybrid-ventricle", &shipped.model, options, &mut keep)?;
    for seed in options.seed..options.seed.saturating_add(options.hearts) {
        let heart = Heart::random(seed)?;
        rows(&format!("{seed}: {}", heart.told), &heart.spec, options, &mut keep)?;
    }
    Ok(all)
}

fn rows(name: &str, spec: &ModelSpec, options: &Options, keep: &mut dyn FnMut(HeartTicks)) -> Result<()> {
    for &awake in &options.awake {
        let mut spec = spec.clone();
        let BodySpec::Hybrid(hybrid) = &mut spec.body else { bail!("{name} has no particles") };
        let particles = &mut hybrid.particles;
        particles.most_active = awake;
        particles.waking = Waking::in_half_ball(particles.spacing_m, particles.fine_depth_m, awake);
        if options.no_self_contact {
            spec.settings.self_contact = SelfContactChoice::Off;
        }
        spec.tools = Vec::new();
        let place = Place::of(&Model::build(spec.clone()).into_diagnostic()?, 0.0);
        spec.settings.sleep_tolerance_m = SLEEP_TOLERANCE_M;
        spec.tools = vec![ToolSpec {
            name: "finger".to_owned(),
            shape: ToolShape::Sphere,
            radius_m: place::RADIUS_M,
            coupling: Coupling::Rigid,
            friction_coefficient: 0.0,
            start_position_m: place.finger_m(-GAP_M, 0.0),
        }];
        let model = Model::build(spec).into_diagnostic()?;
        keep(Session::new(&model, place).run(name, awake)?);
    }
    Ok(())
}

/// What the ticks of a heart take (µs).
#[derive(Debug, Clone, PartialEq)]
pub struct HeartTicks {
    /// Its name, or what it was made of.
    pub name: String,
    /// Most particles awake.
    pub awake: usize,
    /// Substeps of a tick.
    pub substeps: u32,
    /// Median at rest, awake.
    pub rest_us: f64,
    /// Median, p99 and longest while the finger is dragged.
    pub dragged_us: [f64; 3],
    /// Substeps of a tick in the mean while it is dragged.
    pub substeps_taken: f64,
    /// Force (N) on the finger in the mean while it is dragged.
    pub mean_force_n: f64,
    /// Median after the finger has left.
    pub swaying_us: f64,
    /// `None` where it never falls asleep.
    pub asleep: Option<Asleep>,
}

/// What the ticks of a heart take once it sleeps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Asleep {
    /// How long (s) after the finger had left it fell asleep.
    pub after_s: f64,
    /// Median (µs).
    pub median_us: f64,
    /// 99th percentile (µs).
    pub p99_us: f64,
}

impl fmt::Display for Asleep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.1} s, {:.1}, {:.1}", self.after_s, self.median_us, self.p99_us)
    }
}

/// A row of the table that is printed.
impl fmt::Display for HeartTicks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [median, p99, longest] = self.dragged_us;
        write!(
            f,
            "| {} | {} | {} | {:.1} | {median:.0}, {p99:.0}, {longest:.0} | {:.1} | {:.3} N | {:.0} | {} |",
            self.name,
            self.awake,
            self.substeps,
            self.rest_us,
            self.substeps_taken,
            self.mean_force_n,
            self.swaying_us,
            self.asleep.map_or_else(|| "never".to_owned(), |asleep| asleep.to_string())
        )
    }
}

/// A heart under the finger.
struct Session<'a> {
    model: &'a Model,
    place: Place,
    state: State,
    scratch: Scratch,
    prescribed_m: Vec<DVec3>,
    load_factors: Vec<f64>,
    at_m: DVec3,
    substeps: u64,
}

impl<'a> Session<'a> {
    fn new(model: &'a Model, place: Place) -> Self {
        Self {
            state: State::at_rest(model),
            scratch: Scratch::new(model),
            prescribed_m: vec![DVec3::ZERO; model.prescribed().len()],
            load_factors: vec![0.0; model.loads().len()],
            at_m: place.finger_m(-GAP_M, 0.0),
            substeps: 0,
            model,
            place,
        }
    }

    /// A tick with the finger there; its time (s).
    fn tick(&mut self, depth_m: f64, dragged_m: f64) -> Result<f64> {
        let position_m = self.place.finger_m(depth_m, dragged_m);
        let period_s = self.model.settings().tick_period_s;
        let velocity_m_per_s = (position_m - self.at_m) / period_s;
        self.at_m = position_m;
        let tools = [ToolTarget { velocity_m_per_s, ..ToolTarget::at(position_m) }];
        let input = TickInput {
            tools: &tools,
            load_factors: &self.load_factors,
            prescribed_displacements_m: &self.prescribed_m,
            point_forces: &[],
        };
        let start = Instant::now();
        let report = step(self.model, &mut self.state, &mut self.scratch, &input);
        let took_s = start.elapsed().as_secs_f64();
        self.substeps += u64::from(report.substeps);
        match report.quarantined {
            None => Ok(took_s),
            Some(quarantine) => bail!("the heart did not survive: {quarantine:?}"),
        }
    }

    fn run(mut self, name: &str, awake: usize) -> Result<HeartTicks> {
        let step_m = SPEED_M_PER_S * self.model.settings().tick_period_s;
        let mut rest_s = Vec::new();
        for _ in 0..REST_TICKS {
            let took_s = self.tick(-GAP_M, 0.0)?;
            if !self.state.sleep.asleep {
                rest_s.push(took_s);
            }
        }
        let way = ((GAP_M + DEPTH_M) / step_m) as u32;
        for tick in 0..way {
            self.tick(-GAP_M + f64::from(tick) * step_m, 0.0)?;
        }
        self.substeps = 0;
        let (mut dragged_s, mut force_n, mut dragged_m) = (Vec::new(), 0.0, 0.0);
        for tick in 0..DRAG_TICKS {
            // To one side, to the other and on.
            let phase = (f64::from(tick) * step_m / DRAG_M + 1.0).rem_euclid(4.0);
            dragged_m = DRAG_M * (if phase < 2.0 { phase - 1.0 } else { 3.0 - phase });
            dragged_s.push(self.tick(DEPTH_M, dragged_m)?);
            force_n += self.state.mechanical.tools[0].contact_force_n.length() / f64::from(DRAG_TICKS);
        }
        let substeps_taken = self.substeps as f64 / f64::from(DRAG_TICKS);
        for tick in 0..way + LEAVES_TICKS {
            self.tick((DEPTH_M - f64::from(tick) * step_m).max(-GAP_M), dragged_m)?;
        }
        let mut swaying_s = Vec::new();
        for _ in 0..SWAY_TICKS {
            swaying_s.push(self.tick(-GAP_M, dragged_m)?);
        }
        let left = self.state.mechanical.tick;
        let asleep = self.falls_asleep(dragged_m)?;
        let [rest] = quantiles(&mut rest_s, [0.5]);
        let [median, p99, longest] = quantiles(&mut dragged_s, [0.5, 0.99, 1.0]);
        let [swaying] = quantiles(&mut swaying_s, [0.5]);
        Ok(HeartTicks {
            name: name.to_owned(),
            awake,
            substeps: self.model.substeps(),
            rest_us: 1e6 * rest,
            dragged_us: [1e6 * median, 1e6 * p99, 1e6 * longest],
            substeps_taken,
            mean_force_n: force_n,
            swaying_us: 1e6 * swaying,
            asleep: asleep.map(|(at, [median, p99])| Asleep {
                after_s: 1e-3 * (at - left) as f64,
                median_us: 1e6 * median,
                p99_us: 1e6 * p99,
            }),
        })
    }

    /// Waits for the heart to fall asleep. Returns when it did (ticks), and the median and p99 of what its ticks take then (s); `None`
    /// where it does not.
    fn falls_asleep(&mut self, dragged_m: f64) -> Result<Option<(u64, [f64; 2])>> {
        for _ in 0..MOST_UNTIL_ASLEEP {
            if self.state.sleep.asleep {
                let at = self.state.mechanical.tick;
                let mut asleep_s = Vec::new();
                for _ in 0..REST_TICKS {
                    asleep_s.push(self.tick(-GAP_M, dragged_m)?);
                }
                return Ok(Some((at, quantiles(&mut asleep_s, [0.5, 0.99]))));
            }
            self.tick(-GAP_M, dragged_m)?;
        }
        Ok(None)
    }
}
