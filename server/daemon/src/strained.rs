//! Elements that are strained beyond what they are made for, in words.
use glam::DVec3;
use palpate_physics::{
    Model,
    elements::{
        linear_tet::VolumeRatio,
        strained::{Pressed, Strained},
    },
    material::Law,
};
use palpate_scene::wording::short;
use serde::{Deserialize, Serialize};

/// What to take instead of a law that bears less the more it is pressed.
pub const INSTEAD: Law = Law::StableNeoHookean;

/// `58 %`: a stretch as a part of the length at rest.
pub fn percent(stretch: f64) -> String {
    format!("{:.0} %", 100.0 * stretch)
}

/// Where a tet is (at rest), with a space before it; nothing where there are no tets.
fn near(model: &Model, tet: usize) -> String {
    let middle_mm = model.body().tets().map(|mesh| mesh.corners_m(tet).iter().sum::<DVec3>() * 250.0);
    middle_mm.map_or_else(String::new, |mm| format!(" near ({:.2}, {:.2}, {:.2}) mm at rest", mm.x, mm.y, mm.z))
}

/// The most that was seen of a run, or of one state.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Seen {
    lowest: Option<(VolumeRatio, f64)>,
    pressed: Option<(Pressed, f64)>,
}

impl Seen {
    /// What is seen of one state.
    pub fn of(found: Option<Strained>) -> Self {
        let mut seen = Self::default();
        seen.see(found, 0.0);
        seen
    }

    /// Sees a state at a time (s).
    pub fn see(&mut self, found: Option<Strained>, time_s: f64) {
        let Some(Strained { volume, pressed }) = found else { return };
        if self.lowest.is_none_or(|(lowest, _)| volume.ratio < lowest.ratio) {
            self.lowest = Some((volume, time_s));
        }
        let is_more = |new: &Pressed| self.pressed.is_none_or(|(most, _)| new.stretch < most.stretch);
        if let Some(new) = pressed.filter(is_more) {
            self.pressed = Some((new, time_s));
        }
    }

    /// The least volume ratio, and when (s) it was.
    pub fn lowest(&self) -> Option<(f64, f64)> {
        self.lowest.map(|(volume, time_s)| (volume.ratio, time_s))
    }

    /// The least stretch of an element that was pressed beyond what its law is made for, and when (s) it was.
    pub fn pressed(&self) -> Option<(f64, f64)> {
        self.pressed.map(|(pressed, time_s)| (pressed.stretch, time_s))
    }

    /// The least volume ratio, where and when, if elements were inside out or flat.
    pub fn inverted(&self, model: &Model) -> Option<String> {
        let (VolumeRatio { ratio, tet }, time_s) = self.lowest.filter(|(volume, _)| volume.ratio <= 0.0)?;
        Some(format!("the least volume ratio was {} at {} s{}", short(ratio), short(time_s), near(model, tet)))
    }

    /// Says so where elements are inside out now, in the one state that was seen.
    pub fn inverted_now(&self, model: &Model) -> Option<String> {
        let (VolumeRatio { ratio, tet }, _) = self.lowest.filter(|(volume, _)| volume.ratio <= 0.0)?;
        Some(format!(
            "elements are turned inside out: the least volume ratio is {}{}. No real body does that; let it come back, or reset it",
            short(ratio),
            near(model, tet)
        ))
    }

    /// Says so where an element was pressed beyond what its law is made for; `with_time` tells when.
    pub fn weakened(&self, model: &Model, with_time: bool) -> Option<String> {
        let (Pressed { stretch, law, tet }, time_s) = self.pressed?;
        let when = if with_time { format!(" at {} s", short(time_s)) } else { String::new() };
        let limit = percent(law.weakens_below().unwrap_or_default());
        Some(format!(
            "the body was pressed to {} of its length{when}{}: below {limit} the law \"{}\" bears less the more it is pressed, and what it \
             answers there is not a body's; press less, or take law = \"{}\"",
            percent(stretch),
            near(model, tet),
            law.name(),
            INSTEAD.name()
        ))
    }
}
