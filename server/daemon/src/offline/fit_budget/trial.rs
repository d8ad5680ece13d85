//! One choice of numbers, tried: the first tool presses the body where it is nearest to it, and is dragged.
use super::super::{load, simulate::Run, summary::Percentiles};
use crate::bodies::{FirstTouch, served};
use glam::DVec3;
use miette::Report;
use palpate_physics::Model;
use palpate_scene::{Limits, Scene, parse};
use std::path::Path;

/// Depth to which the device goes, in radii of the tool.
pub(super) const DEPTH: f64 = 0.5;
/// How far the device is dragged to either side, in radii of the tool.
pub(super) const ASIDE: f64 = 1.0;
/// Speed (m/s) at which it is dragged.
pub(super) const DRAG_M_PER_S: f64 = 0.1;
/// Time (s) in which it comes down, and then waits.
const DOWN_S: f64 = 0.1;
const WAIT_S: f64 = 0.1;

/// A scene with some numbers, and its body.
pub(super) struct Trial {
    pub(super) scene: Scene,
    pub(super) model: Model,
    touch: FirstTouch,
}

/// What a press told.
pub(super) struct Pressed {
    /// Wall times of ticks with particles awake.
    pub(super) tick_wall_us: Percentiles,
    /// Most particles that were awake at once.
    pub(super) most_awake: usize,
    /// Force (N) of the body on the tool at every tick.
    force_n: Vec<DVec3>,
}

/// How far forces on a tool are from others that it had on the same way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Off {
    /// `Σ f·g / Σ g·g − 1` of forces `f` over others `g`: how much larger they are.
    pub(super) larger: f64,
    /// `√(Σ |f − g|² / Σ |g|²)`.
    pub(super) in_all: f64,
}

impl Trial {
    /// Loads a scene's text with numbers in it, and builds its body.
    ///
    /// # Errors
    /// A scene that is refused, or a body that no tool of the scene wakes particles of.
    pub(super) fn new(path: &Path, text: &str, limits: &Limits) -> miette::Result<Self> {
        let folder = path.parent().unwrap_or(Path::new("."));
        let name = path.display().to_string();
        let scene = parse(text, &name, Some(folder), limits, &mut |_, _| ()).map_err(Report::new)?;
        let model = load::build_showing(&scene, None, &mut |_| ())?;
        let touch = served(&model).first_touch(&scene).ok_or_else(|| {
            miette::miette!(
                help = "let the body have a skin that is not held, and the scene a tool",
                "no tool of {name} wakes particles of its body: there is nothing to measure"
            )
        })?;
        Ok(Self { scene, model, touch })
    }

    /// The part of the body's volume that is in whole cells of the lattice.
    pub(super) fn part_in_whole_cells(&self) -> f64 {
        served(&self.model).part_in_whole_cells()
    }

    /// Number of the body's coarse tets.
    pub(super) fn coarse_tets(&self) -> usize {
        self.model.body().tets().map_or(0, |mesh| mesh.tets().len())
    }

    /// Presses and drags the first tool.
    ///
    /// # Errors
    /// A state that is refused.
    pub(super) fn press(&self) -> miette::Result<Pressed> {
        let mut run = Run::new(&self.scene, &self.model)?;
        run.start_above(&self.touch);
        let tick_s = self.model.settings().tick_period_s;
        let side = self.touch.outward.any_orthonormal_vector();
        let radius_m = self.touch.radius_m;
        let drag_s = 4.0 * ASIDE * radius_m / DRAG_M_PER_S;
        let ticks = ((DOWN_S + WAIT_S + drag_s) / tick_s).ceil() as u64;
        let mut force_n = Vec::with_capacity(ticks as usize);
        for tick in 1..=ticks {
            let time_s = tick as f64 * tick_s;
            let depth = DEPTH * (time_s / DOWN_S).min(1.0);
            let aside = ASIDE * there_and_back((time_s - DOWN_S - WAIT_S).max(0.0) / drag_s);
            run.send_first_tool(self.touch.at(-depth, side * (aside * radius_m)));
            run.tick();
            run.refuse_quarantined()?;
            force_n.push(run.state.mechanical.tools[0].contact_force_n);
        }
        let (tick_wall_us, _, most_awake) = run.cost_awake();
        Ok(Pressed { tick_wall_us, most_awake, force_n })
    }
}

/// From 0 to 1, to −1 and back to 0, as `part` goes from 0 to 1.
fn there_and_back(part: f64) -> f64 {
    let quarter = 4.0 * part.min(1.0);
    if quarter < 1.0 {
        quarter
    } else if quarter < 3.0 {
        2.0 - quarter
    } else {
        quarter - 4.0
    }
}

impl Pressed {
    /// Returns how far its forces are from those of another press on the same way; `None` where that one felt nothing.
    pub(super) fn off(&self, other: &Self) -> Option<Off> {
        off(&self.force_n, &other.force_n)
    }
}

fn off(force_n: &[DVec3], other_n: &[DVec3]) -> Option<Off> {
    let of = |pairs: fn(DVec3, DVec3) -> f64| -> f64 { force_n.iter().zip(other_n).map(|(f, g)| pairs(*f, *g)).sum() };
    let size_n2 = of(|_, g| g.length_squared());
    (size_n2 > 0.0)
        .then(|| Off { larger: of(DVec3::dot) / size_n2 - 1.0, in_all: (of(DVec3::distance_squared) / size_n2).sqrt() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_goes_to_either_side_and_comes_back_at_one_speed() {
        let at: Vec<f64> = (0..=40).map(|step| there_and_back(f64::from(step) / 40.0)).collect();
        assert_eq!([at[0], at[10], at[20], at[30], at[40], there_and_back(2.0)], [0.0, 1.0, 0.0, -1.0, 0.0, 0.0]);
        assert!(at.windows(2).all(|pair| ((pair[1] - pair[0]).abs() - 0.1).abs() < 1e-12), "{at:?}");
    }

    #[test]
    fn forces_that_are_larger_and_forces_that_point_elsewhere_are_off() {
        let other_n = [DVec3::X, 2.0 * DVec3::X];
        let larger = off(&other_n.map(|g| g * 1.03), &other_n).unwrap();
        assert!((larger.larger - 0.03).abs() < 1e-12 && (larger.in_all - 0.03).abs() < 1e-12, "{larger:?}");
        let elsewhere = off(&other_n.map(|g| g + g.length() * 0.1 * DVec3::Y), &other_n).unwrap();
        assert!(elsewhere.larger.abs() < 1e-12 && (elsewhere.in_all - 0.1).abs() < 1e-12, "{elsewhere:?}");
        assert_eq!(off(&other_n, &[DVec3::ZERO; 2]), None);
    }
}
