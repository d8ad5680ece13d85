//! What the lab and a peer's script tell each other; `tests/lab/peers/README.md` describes it for those who write one.
use crate::{
    measure::LAST,
    methods::{Pace, tremor},
    problems::{Problem, load},
};
use miette::{Result, miette};
use palpate_physics::elements::mass::lumped_kg;
use serde::{Deserialize, Serialize};

/// Version of the format.
pub const FORMAT: u32 = 1;
/// What the lab's bodies weigh.
const DENSITY_KG_PER_M3: f64 = 1000.0;
const TICK_S: f64 = 1e-3;

/// A problem for a peer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// [`FORMAT`].
    pub format: u32,
    /// The problem's name.
    pub problem: String,
    /// Nodes at rest (m).
    pub rest_positions_m: Vec<[f64; 3]>,
    /// Nodes of each tet, of positive volume.
    pub tets: Vec<[u32; 4]>,
    /// Nodes that do not move.
    pub held_nodes: Vec<u32>,
    /// Lumped masses (kg).
    pub masses_kg: Vec<f64>,
    /// The law the reference obeys.
    pub law: String,
    /// Young's modulus (Pa).
    pub young_modulus_pa: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Dead forces (N) on nodes at full load.
    pub nodal_forces_n: Vec<(u32, [f64; 3])>,
    /// Their sum (N) along the direction of the answer.
    pub force_sum_n: f64,
    /// Tick (s).
    pub tick_s: f64,
    /// Fraction of the load, tick by tick: ramp and rest.
    pub fractions: Vec<f64>,
    /// The same of timed ticks, over and over: a tremor.
    pub timed_fractions: Vec<f64>,
    /// Mass damping (1/s).
    pub damping_per_s: f64,
    /// Ticks at the end over which the answer is averaged.
    pub last_ticks: usize,
    /// Longest time (s) for a variant to come to rest.
    pub budget_s: f64,
}

impl Task {
    /// Of a problem at a resolution.
    ///
    /// # Errors
    /// A body that cannot be built, or an action that is not a load on nodes.
    pub fn new(problem: &Problem, resolution: u32, pace: &Pace, budget_s: f64) -> Result<Self> {
        let body = problem.body.tets(resolution)?;
        let load = load::on_tets(problem.action, &body).ok_or_else(|| miette!("{} has no nodal load", problem.name))?;
        let held = body.prescribed.iter().filter(|held| held.axes == [true; 3]);
        let masses_kg = lumped_kg(&body.mesh, |_| DENSITY_KG_PER_M3);
        let ticks = pace.ramp_ticks + pace.rest_ticks;
        Ok(Self {
            format: FORMAT,
            problem: problem.name.clone(),
            rest_positions_m: body.mesh.positions_m().iter().map(glam::DVec3::to_array).collect(),
            tets: body.mesh.tets().to_vec(),
            held_nodes: held.flat_map(|held| held.nodes.iter().copied()).collect(),
            masses_kg,
            law: format!("{:?}", problem.law),
            young_modulus_pa: problem.young_modulus_pa,
            poisson_ratio: problem.poisson_ratio,
            nodal_forces_n: load.forces_n.iter().map(|(node, force)| (*node, force.to_array())).collect(),
            force_sum_n: load.sum_n,
            tick_s: TICK_S,
            fractions: (1..=ticks).map(|tick| pace.fraction(tick)).collect(),
            timed_fractions: tremor().collect(),
            damping_per_s: pace.damping_per_s,
            last_ticks: LAST,
            budget_s,
        })
    }
}

/// A script's first line: all its variants are at rest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settled {
    /// [`FORMAT`].
    pub format: u32,
    /// Which simulator.
    pub peer: String,
    /// Its variants.
    pub rows: Vec<SettledRow>,
}

/// A variant at rest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SettledRow {
    /// Its name, without commas.
    pub name: String,
    /// Its settings, in words.
    pub settings: String,
    /// Its constitutive law, in words.
    pub law: String,
    /// Whether its law is the problem's.
    pub same_law: bool,
    /// Time steps per tick.
    pub steps_per_tick: usize,
    /// Answers (m) of the last ticks.
    pub answers_m: Vec<f64>,
    /// Displacements (m) of all nodes at the end.
    pub displacements_m: Vec<[f64; 3]>,
    /// Why it has no answer; otherwise empty.
    pub failure: String,
}

/// A script's answer to `time ROUNDS SECONDS`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Times {
    /// Times (s) of ticks, of each variant.
    pub times_s: Vec<Vec<f64>>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problems;

    #[test]
    fn a_task_is_whole_and_comes_back_as_it_was() {
        let problem = problems::all().into_iter().find(|p| p.name == "ventricle-20mm-patch-nu0.40").unwrap();
        let pace = Pace { ramp_ticks: 3, rest_ticks: 2, damping_per_s: 4.0, motion: problems::Motion::ToRest };
        let task = Task::new(&problem, 188, &pace, 1.0).unwrap();
        let text = serde_json::to_string(&task).unwrap();
        assert_eq!(serde_json::from_str::<Task>(&text).unwrap(), task);
        assert_eq!(task.fractions.len(), 5);
        assert_eq!(task.fractions[4], 1.0);
        assert!(!task.held_nodes.is_empty() && task.masses_kg.len() == task.rest_positions_m.len());
        // The patch presses along −x.
        let sum: f64 = task.nodal_forces_n.iter().map(|(_, force)| force[0]).sum();
        assert!((sum / -task.force_sum_n - 1.0).abs() < 1e-12);
    }
}
