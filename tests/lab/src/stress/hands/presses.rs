//! Random presses.
//!
//! Found by it: at 1.3 tool radii the force of a slow press fell from 2.3 N to nothing and the tool was buried; of thirty
//! quick ones twelve ended in quarantine.
use super::{
    BODIES, Shipped,
    hand::Press,
    spec,
    watch::{Found, watch},
};
use crate::random::Random;
use crate::stress::{Options, Outcome};
use miette::{IntoDiagnostic, Result, WrapErr};
use palpate_physics::{Model, ModelSpec};

pub(in crate::stress) const CRITERION: &str = "random presses of shipped bodies at 0.05 to 5 m/s, to 20 N or 30 mm: finite, no quarantine, no tool inside, \
     force where there is depth; slow ones on blocks: force never down by 5 % in a tick or 20 % in 20 ms while the arm goes deeper";

pub(in crate::stress) fn run(options: &Options) -> Result<Outcome> {
    let as_it_ships =
        |spec: &ModelSpec, _: &mut Random| Ok(Pressed { spec: spec.clone(), may_not_fall: true, told: String::new() });
    press_all(BODIES.iter(), options.pick(2, 12, 1000), options.seed, &as_it_ships)
}

/// What is pressed in a body's place.
pub(super) struct Pressed {
    pub(super) spec: ModelSpec,
    /// Whether the force of a slow press may not fall.
    pub(super) may_not_fall: bool,
    /// What is told of it beside the press: nothing, or words and a comma behind them.
    pub(super) told: String,
}

/// Presses every body so many times at random; `vary` makes what is pressed of it.
pub(super) fn press_all<'b>(
    bodies: impl Iterator<Item = &'b Shipped>,
    presses: u64,
    first_seed: u64,
    vary: &dyn Fn(&ModelSpec, &mut Random) -> Result<Pressed>,
) -> Result<Outcome> {
    let mut outcome = Outcome::passing();
    for shipped in bodies {
        let body = &shipped.body;
        let spec = spec(shipped).wrap_err(body.name)?;
        let bare = Model::build(ModelSpec { tools: Vec::new(), ..spec.clone() }).into_diagnostic()?;
        let mut worst = Found::default();
        for number in 0..presses {
            let seed = first_seed.wrapping_add(number);
            let mut random = Random::new(seed);
            let press = Press::random(&bare, body, &mut random)?;
            let Pressed { spec, may_not_fall, told } = vary(&spec, &mut random)?;
            let found = watch(&spec, body, &press)?;
            found.judge(may_not_fall, &mut outcome, &|| format!("{}, seed {seed} ({told}{press})", body.name));
            worst = worst.worse(&found);
        }
        worst.push(body.name, &mut outcome);
    }
    Ok(outcome)
}
