//! What a run did, as JSON for programs and as lines for people.
use super::{folder, probe_rows::ProbeRows, say::say, walls::WallNumbers};
use crate::whole_file::{self, PUBLIC};
use miette::{IntoDiagnostic, WrapErr};
use palpate_physics::{AwakeFor, Energies, Model, State, snapshot, world};
use palpate_scene::{Scene, wording::counted};
use serde::Serialize;
use std::{collections::BTreeMap, path::Path};

/// What every offline run reports.
#[derive(Debug, Serialize)]
pub(super) struct Summary {
    pub(super) palpate_version: &'static str,
    pub(super) command: &'static str,
    pub(super) scene: String,
    pub(super) body: BodyNumbers,
    /// Of a run `duration`, `interrupted` or `quarantined`; of a static solve `equilibrium`, or what is wrong with it: `inverted`,
    /// `unstable` or `unbalanced`.
    pub(super) ended_by: &'static str,
    pub(super) simulated_s: f64,
    /// Since the run began, or was resumed.
    pub(super) wall_s: f64,
    /// Where the run was resumed last; what ticks cost is counted from there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) resumed_at_s: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) time: Option<TimeNumbers>,
    /// Where walls of the body met.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) walls: Option<WallNumbers>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) solve: Option<SolveNumbers>,
    pub(super) energies_j: EnergyNumbers,
    /// Smallest deformed over rest volume of a tet; below 0: inverted. 1 of springs.
    pub(super) min_volume_ratio: f64,
    /// The least that was seen of that ratio in a run over time, and when.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) lowest_volume_ratio: Option<PeakNumbers>,
    /// The least principal stretch of an element that was pressed beyond what its law is made for, and when; absent where none was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) least_stretch_beyond_law: Option<PeakNumbers>,
    /// Newest value of every probe: unit, and value by column.
    pub(super) probes: BTreeMap<String, ProbeNumbers>,
    pub(super) samples: u64,
    pub(super) frames: usize,
    /// Equal states have equal hashes on every machine.
    pub(super) state_hash: String,
    pub(super) warnings: Vec<String>,
}

#[derive(Debug, Serialize)]
pub(super) struct BodyNumbers {
    pub(super) origin: String,
    pub(super) nodes: usize,
    pub(super) tets: usize,
    pub(super) volume_m3: f64,
    pub(super) mass_kg: f64,
    /// Of a hybrid or seed body.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) particles: Option<ParticleNumbers>,
}

/// The particles of a hybrid or seed body.
#[derive(Debug, Serialize)]
pub(super) struct ParticleNumbers {
    pub(super) count: usize,
    pub(super) spacing_m: f64,
    /// Most awake at once.
    pub(super) most_active: usize,
    /// Awake at the end.
    pub(super) active: usize,
    /// What for; absent of a seed body.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) active_for: Option<AwakeForNumbers>,
    /// Those that never wake, because the coarse tets do not hold them; 0 of a seed body.
    pub(super) outside: usize,
    pub(super) skin_triangles: usize,
}

/// How many of the awake particles are awake for what. One that several want counts for the first of them, in this order.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct AwakeForNumbers {
    pub(super) tools: usize,
    pub(super) loads: usize,
    pub(super) injected_forces: usize,
    /// For nothing any more: they have not come to rest, or are about to be put to sleep.
    pub(super) nothing: usize,
}

impl AwakeForNumbers {
    fn of(AwakeFor { tools, loads, injected, nothing }: AwakeFor) -> Self {
        Self { tools, loads, injected_forces: injected, nothing }
    }

    /// `98 for tools, 2 for nothing any more`; nothing where none is awake.
    fn told(self) -> String {
        let Self { tools, loads, injected_forces, nothing } = self;
        let all = [
            (tools, "for tools"),
            (loads, "for loads"),
            (injected_forces, "for injected forces"),
            (nothing, "for nothing any more"),
        ];
        let some = all.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}"));
        some.collect::<Vec<_>>().join(", ")
    }
}

impl ParticleNumbers {
    pub(super) fn of(model: &Model, state: &State) -> Option<Self> {
        (model.body().particle_count() > 0).then(|| Self {
            count: model.body().particle_count(),
            spacing_m: model.body().particle_spacing_m(),
            most_active: model.body().most_awake_particles(),
            active: state.awake_particles(),
            active_for: state.awake_for(model, &[]).map(AwakeForNumbers::of),
            outside: model.body().particles_that_never_wake(),
            skin_triangles: model.surface().triangles.len(),
        })
    }
}

/// The cost of time integration.
#[derive(Debug, Serialize)]
pub(super) struct TimeNumbers {
    pub(super) tick_period_s: f64,
    pub(super) ticks: u64,
    pub(super) substeps_per_tick: u32,
    /// Ticks that proved unstable and were repeated in more substeps.
    pub(super) repeated_ticks: u64,
    /// Ticks that a body at rest slept through.
    pub(super) asleep_ticks: u64,
    pub(super) tick_wall_us: Percentiles,
    /// Simulated time over the wall time of its ticks.
    pub(super) real_time_factor: f64,
}

#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Percentiles {
    pub(super) mean: f64,
    pub(super) p50: f64,
    pub(super) p99: f64,
    pub(super) max: f64,
}

/// The cost and quality of a static solve.
#[derive(Debug, Serialize)]
pub(super) struct SolveNumbers {
    pub(super) iterations: u32,
    pub(super) load_steps: u32,
    pub(super) residual_n: f64,
    /// Residual over the forces in play; absent when there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) relative_residual: Option<f64>,
    /// What rounding of positions alone leaves (N).
    pub(super) rounding_n: f64,
    pub(super) stable: bool,
    pub(super) inverted_tets: u32,
    /// Of a body with particles: loads on more of the skin than may be awake, which the coarse tets carry alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) spread_loads: Option<u32>,
}

#[derive(Debug, Serialize)]
pub(super) struct EnergyNumbers {
    pub(super) kinetic: f64,
    pub(super) elastic: f64,
    pub(super) gravitational: f64,
    pub(super) external_work: f64,
    pub(super) dissipated: f64,
    /// Held − work + dissipated: 0 but for the error of time integration. A static solve tracks no work and has none, nor has a seed body.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) balance: Option<f64>,
}

#[derive(Debug, Serialize)]
pub(super) struct ProbeNumbers {
    pub(super) unit: &'static str,
    pub(super) values: BTreeMap<&'static str, f64>,
    /// In a run over time, the row with the largest magnitude of the vector or of each value (the volume ratio's smallest).
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) peaks: BTreeMap<&'static str, PeakNumbers>,
}

#[derive(Debug, Serialize)]
pub(super) struct PeakNumbers {
    pub(super) value: f64,
    pub(super) time_s: f64,
}

/// How a run ended.
pub(super) struct Ending {
    pub(super) command: &'static str,
    pub(super) by: &'static str,
    pub(super) simulated_s: f64,
    pub(super) wall_s: f64,
    pub(super) frames: usize,
}

impl Summary {
    pub(super) fn new(scene: &Scene, model: &Model, state: &State, rows: &ProbeRows<'_>, ending: &Ending) -> Self {
        let energies = Energies::of(model, state);
        let mut probes: BTreeMap<String, ProbeNumbers> = BTreeMap::new();
        for (probe, column, value) in rows.newest() {
            let new = || ProbeNumbers { unit: probe.unit(), values: BTreeMap::new(), peaks: BTreeMap::new() };
            probes.entry(probe.name().to_owned()).or_insert_with(new).values.insert(column, value);
        }
        for (probe, of, peak) in rows.peaks().filter(|_| rows.count() > 1) {
            if let Some(numbers) = probes.get_mut(probe.name()) {
                numbers.peaks.insert(of, PeakNumbers { value: peak.value, time_s: peak.time_s });
            }
        }
        Self {
            palpate_version: env!("CARGO_PKG_VERSION"),
            command: ending.command,
            scene: scene.name.clone(),
            body: BodyNumbers {
                origin: scene.summary.origin.clone(),
                nodes: scene.summary.nodes,
                tets: scene.summary.tets,
                volume_m3: scene.summary.volume_m3,
                mass_kg: scene.summary.mass_kg,
                particles: ParticleNumbers::of(model, state),
            },
            ended_by: ending.by,
            simulated_s: ending.simulated_s,
            wall_s: ending.wall_s,
            resumed_at_s: None,
            time: None,
            walls: None,
            solve: None,
            energies_j: EnergyNumbers {
                kinetic: energies.kinetic_j,
                elastic: energies.elastic_j,
                gravitational: energies.gravitational_j,
                external_work: energies.external_work_j,
                dissipated: energies.dissipated_j,
                balance: (ending.command == "simulate" && model.body().books_energy()).then(|| energies.balance_j()),
            },
            min_volume_ratio: world::min_volume_ratio(model, state).map_or(1.0, |smallest| smallest.ratio),
            lowest_volume_ratio: None,
            least_stretch_beyond_law: None,
            probes,
            samples: rows.count(),
            frames: ending.frames,
            state_hash: format!("{:016x}", snapshot::state_hash(state)),
            warnings: scene.warnings.clone(),
        }
    }

    /// Adds what was seen to be wrong to the warnings, and tells it on standard error.
    pub(super) fn warn(&mut self, warning: Option<String>) {
        if let Some(warning) = warning {
            eprintln!("warning: {warning}");
            self.warnings.push(warning);
        }
    }

    /// Writes summary.json into a folder.
    pub(super) fn write(&self, out: &Path) -> miette::Result<()> {
        let path = out.join(folder::SUMMARY);
        let text = serde_json::to_string_pretty(self).into_diagnostic()?;
        whole_file::write(&path, (text + "\n").as_bytes(), PUBLIC)
            .into_diagnostic()
            .wrap_err_with(|| format!("cannot write {}", path.display()))
    }

    /// Prints it: JSON when asked for, else lines for people.
    pub(super) fn print(&self, json: bool, out: Option<&Path>) -> miette::Result<()> {
        if json {
            say(format_args!("{}", serde_json::to_string_pretty(self).into_diagnostic()?));
            return Ok(());
        }
        let ended = match self.ended_by {
            "equilibrium" => "in equilibrium".to_owned(),
            "inverted" => "NOT in equilibrium: elements inside out".to_owned(),
            wrong @ ("unstable" | "unbalanced") => format!("NOT in equilibrium: {wrong}"),
            by => format!("ended by {by}"),
        };
        say(format_args!("{}: {} tets, {} nodes, {ended}", self.scene, self.body.tets, self.body.nodes));
        if let Some(particles) = &self.body.particles {
            let what_for = particles.active_for.map(AwakeForNumbers::told).filter(|told| !told.is_empty());
            say(format_args!(
                "  {} particles {:.3} mm apart, {} of at most {} awake at the end{}",
                particles.count,
                particles.spacing_m * 1e3,
                particles.active,
                particles.most_active,
                what_for.map_or_else(String::new, |told| format!(": {told}"))
            ));
        }
        if let Some(time) = &self.time {
            let us = time.tick_wall_us;
            say(format_args!(
                "  {:.3} s simulated in {:.3} s, {} of {}",
                self.simulated_s,
                self.wall_s,
                counted(time.ticks as usize, "tick"),
                counted(time.substeps_per_tick as usize, "substep")
            ));
            if time.asleep_ticks > 0 {
                say(format_args!("  {} slept through, at rest", counted(time.asleep_ticks as usize, "tick")));
            }
            if time.repeated_ticks > 0 {
                let ticks = counted(time.repeated_ticks as usize, "tick");
                say(format_args!("  {ticks} proved unstable and had to be repeated in more substeps"));
            }
            say(format_args!(
                "  tick: p50 {:.1} us, p99 {:.1} us, max {:.1} us; {:.1} times real time",
                us.p50, us.p99, us.max, time.real_time_factor
            ));
        }
        if let Some(walls) = &self.walls {
            say(format_args!("  {}", walls.line()));
        }
        if let Some(solve) = &self.solve {
            say(format_args!("  {}, in {:.3} s", solve.line(), self.wall_s));
            if let Some(spread) = solve.spread_loads.filter(|spread| *spread > 0) {
                say(format_args!(
                    "  {} on more of the skin than may be awake: carried by the coarse tets alone",
                    counted(spread as usize, "load")
                ));
            }
        }
        for (name, probe) in &self.probes {
            print_probe(name, probe);
        }
        if self.body.tets > 0 {
            let lowest = match &self.lowest_volume_ratio {
                Some(lowest) if lowest.value < self.min_volume_ratio => {
                    format!(" at the end, {:.4} at {:.3} s", lowest.value, lowest.time_s)
                }
                _ => String::new(),
            };
            say(format_args!(
                "  smallest volume ratio {:.4}{lowest}, state {}",
                self.min_volume_ratio, self.state_hash
            ));
        } else {
            say(format_args!("  state {}", self.state_hash));
        }
        if let Some(balance) = self.energies_j.balance {
            say(format_args!("  energy balance {balance:.2e} J"));
        }
        match out {
            Some(out) => say(format_args!(
                "  written to {}: {}, {}",
                out.display(),
                counted(self.samples as usize, "row"),
                counted(self.frames, "frame")
            )),
            None => say(format_args!("  nothing was saved; add --out DIR for probes.csv, frames and summary.json")),
        }
        Ok(())
    }
}

impl SolveNumbers {
    fn line(&self) -> String {
        let stable = if self.stable { "stable" } else { "NOT stable" };
        let iterations = counted(self.iterations as usize, "Newton iteration");
        match self.relative_residual {
            Some(relative) => {
                format!("{iterations}, residual {:.2e} N ({relative:.2e} of the forces), {stable}", self.residual_n)
            }
            None => format!(
                "no load: nothing presses, pulls or moves the body; residual {:.2e} N, rounding {:.2e} N, {stable}",
                self.residual_n, self.rounding_n
            ),
        }
    }
}

fn print_probe(name: &str, probe: &ProbeNumbers) {
    let unit = if probe.unit == "1" { String::new() } else { format!(" ({})", probe.unit) };
    let told = |column: &str, value: f64| {
        // The sign of zero says nothing.
        let value = if value == 0.0 { "0".to_owned() } else { format!("{value:.6e}") };
        if column == "value" { value } else { format!("{column} {value}") }
    };
    let values: Vec<String> = probe.values.iter().map(|(column, value)| told(column, *value)).collect();
    say(format_args!("  {name}{unit}: {}", values.join(", ")));
    let peak = |(of, peak): (&&str, &PeakNumbers)| format!("{} at {:.3} s", told(of, peak.value), peak.time_s);
    let peaks: Vec<String> = probe.peaks.iter().map(peak).collect();
    if !peaks.is_empty() {
        say(format_args!("    peak: {}", peaks.join(", ")));
    }
}
