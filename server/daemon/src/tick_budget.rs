//! Whether the ticks of a body fit the time that they have.
use crate::bodies::served;
use glam::DVec3;
use palpate_physics::{Model, Scratch, State, TickInput, step};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Longest tick of a session (s).
const LONGEST_PERIOD_S: f64 = 0.5;
/// Most tets times substeps in a tick of a session: some quarter of a second of work.
const MOST_TET_UPDATES: u64 = 50_000_000;
/// Of the period, what a tick may take before a warning: the loop has other things to do.
pub(crate) const USABLE: f64 = 0.8;

/// Why a body's ticks take too long for any session.
#[derive(Debug, Error)]
pub enum BudgetError {
    /// Nobody could stop or ask a loop that is in one tick for so long.
    #[error(
        "a tick of {work} in {substeps} substeps takes too long for a session (at most {MOST_TET_UPDATES} tets times substeps): coarsen the \
         mesh, soften the material or shorten the tick; palpated simulate takes it as it is"
    )]
    TooHeavy {
        /// Tets of the body, and particles that may be awake.
        work: String,
        /// Substeps of a tick.
        substeps: u32,
    },
    /// Orders and viewers wait for the tick's end.
    #[error(
        "scene.tick_period_s = {period_s}: a session needs ticks of {LONGEST_PERIOD_S} s at most; palpated simulate takes it as it is"
    )]
    TooSlow {
        /// The period (s).
        period_s: f64,
    },
}

/// Refuses a body whose ticks nobody would wait for.
///
/// # Errors
/// [`BudgetError`].
pub fn check(model: &Model) -> Result<(), BudgetError> {
    let period_s = model.settings().tick_period_s;
    if period_s > LONGEST_PERIOD_S {
        return Err(BudgetError::TooSlow { period_s });
    }
    let tets = model.body().tets().map_or(0, |mesh| mesh.tets().len());
    let (awake, substeps) = (model.body().most_awake_points(), model.substeps());
    // A particle costs about what a tet does.
    if (tets + awake) as u64 * u64::from(substeps) > MOST_TET_UPDATES {
        let work =
            if awake > 0 { format!("{tets} tets and {awake} particles or vertices") } else { format!("{tets} tets") };
        return Err(BudgetError::TooHeavy { work, substeps });
    }
    Ok(())
}

/// Measures some ticks of the body at rest, all particles awake that may be at once, and says so when they do not fit their period.
pub fn warning(model: &Model) -> Option<String> {
    let cost_s = median_tick_s(model);
    let period_s = model.settings().tick_period_s;
    let (cost_ms, period_ms) = (cost_s * 1e3, period_s * 1e3);
    let what = if cost_s > period_s {
        format!("the body runs about {:.1} times slower than real time", cost_s / period_s)
    } else {
        "too little is left of it for late ticks to catch up".to_owned()
    };
    (cost_s > USABLE * period_s).then(|| {
        format!(
            "a tick costs {cost_ms:.2} ms here and should last {period_ms:.2} ms ({} substeps): {what}; coarsen the mesh, soften the \
             material or lengthen the tick",
            model.substeps()
        )
    })
}

fn median_tick_s(model: &Model) -> f64 {
    let (mut state, mut scratch) = (State::at_rest(model), Scratch::new(model));
    let targets: Vec<_> = state.mechanical.tools.iter().map(|tool| tool.target).collect();
    let load_factors = vec![0.0; model.loads().len()];
    let prescribed = vec![DVec3::ZERO; model.prescribed().len()];
    let input = TickInput {
        tools: &targets,
        load_factors: &load_factors,
        prescribed_displacements_m: &prescribed,
        point_forces: &[],
    };
    let begun = Instant::now();
    let mut costs = Vec::new();
    // A few at least, more while they are cheap.
    while costs.len() < 5 || (costs.len() < 51 && begun.elapsed() < Duration::from_millis(50)) {
        served(model).make_next_tick_the_heaviest(model, &mut state, &mut scratch);
        let before = Instant::now();
        step(model, &mut state, &mut scratch, &input);
        costs.push(before.elapsed().as_secs_f64());
    }
    costs.sort_by(f64::total_cmp);
    costs[costs.len() / 2]
}
