//! What `simulate` tells of walls of the body that met.
use palpate_physics::contact::MeetingWalls;
use palpate_scene::wording::{counted, short};
use serde::{Deserialize, Serialize};

/// Walls of the body that met in the ticks of a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct WallNumbers {
    /// Ticks at whose end they did.
    pub(super) ticks: u64,
    /// Most vertices of the surface that were pressed at once.
    pub(super) most_vertices: u32,
    /// The least gap (m) between them, negative where they overlapped.
    pub(super) least_gap_m: f64,
    /// Most pairs that could not be looked at at once, as there was no room or the skin was torn: walls may have passed there.
    pub(super) most_missed: u32,
}

impl WallNumbers {
    /// Counts a tick.
    pub(super) fn add(&mut self, seen: &MeetingWalls) {
        self.most_missed = self.most_missed.max(seen.missed);
        if seen.vertices > 0 {
            self.least_gap_m = if self.ticks == 0 { seen.least_gap_m } else { self.least_gap_m.min(seen.least_gap_m) };
            self.ticks += 1;
            self.most_vertices = self.most_vertices.max(seen.vertices);
        }
    }

    /// Says it in words.
    pub(super) fn line(&self) -> String {
        let (ticks, vertices) = (counted(self.ticks as usize, "tick"), self.most_vertices);
        let missed = match self.most_missed {
            0 => String::new(),
            _ => "; not all that was near could be looked at, so that walls may have passed".to_owned(),
        };
        let apart = apart(self.least_gap_m);
        format!("walls of the body met in {ticks}: up to {vertices} of their vertices were pressed, {apart}{missed}")
    }
}

/// How near vertices came to other walls, given the least gap (m). Edges that cross between vertices may overlap by more.
pub(super) fn apart(least_gap_m: f64) -> String {
    match short(least_gap_m.abs() * 1e3) {
        mm if least_gap_m < 0.0 => format!("up to {mm} mm within the other wall"),
        mm => format!("{mm} mm from the other wall at least"),
    }
}
