//! Which sleeping cells are crushed, so that their particles may not wake.
//!
//! A cell that wakes is to be strained as the tet was whose volume it takes: in shape as its part, in volume as the mean
//! of the tet. The gradient `F` that its corners have where they follow the tet is another one, and a prestrain `A` makes up for
//! it, `F (I + A) = F̄` ([`super::prestrain`]). Where the cell is squeezed flat or turned inside out although its tet is not, there
//! is no such prestrain, or one that would make it many times stiffer: it would wake with energy that drives the body as
//! no tool did. Its particles sleep on until it is itself again.
use super::{body::HybridBody, composite::PARTS, prestrain::is_in_reach, running::RunningPatch};
use glam::{DMat3, DVec3};

/// A tet of which no part has a smaller volume ratio than this, nor a smaller one than this times the whole tet's, is taken to
/// have no crushed cell: its cells are not looked at.
const SOUND: f64 = 0.6;

/// What is known of a tet.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
enum Known {
    /// It was not looked at.
    #[default]
    Nothing,
    /// None of its cells is crushed.
    Sound,
    /// Its cells have to be looked at: number in [`CrushedCells::strained`].
    Strained(u32),
}

/// Gradients of a tet.
#[derive(Debug, Clone, Copy)]
struct Strained {
    tet: u32,
    parts: [DMat3; PARTS],
    mean: DMat3,
}

/// What is known of the tets that were looked at.
#[derive(Debug, Clone, Default)]
pub(super) struct CrushedCells {
    of_tet: Vec<Known>,
    sound: Vec<u32>,
    strained: Vec<Strained>,
}

impl CrushedCells {
    pub(super) fn new(body: &HybridBody) -> Self {
        let tets = body.partition.residual_elements().len();
        Self { of_tet: vec![Known::Nothing; tets], sound: Vec::with_capacity(tets), strained: Vec::with_capacity(tets) }
    }

    /// Removes from a list of particles those that sleep and may not wake now; `x` are the positions (m) of the coarse
    /// nodes.
    pub(super) fn leave_asleep(
        &mut self,
        body: &HybridBody,
        patch: &RunningPatch,
        x: &[DVec3],
        particles: &mut Vec<u32>,
    ) {
        let active = patch.active();
        particles.retain(|particle| {
            active.binary_search(particle).is_ok()
                || body.partition.cells_at(*particle).all(|cell| !self.is_crushed(body, patch, x, cell))
        });
        for tet in self.sound.drain(..).chain(self.strained.drain(..).map(|strained| strained.tet)) {
            self.of_tet[tet as usize] = Known::Nothing;
        }
    }

    fn is_crushed(&mut self, body: &HybridBody, patch: &RunningPatch, x: &[DVec3], cell: usize) -> bool {
        if patch.is_awake(cell as u32) {
            return false;
        }
        let at = body.partition.cells()[cell];
        let Some(Strained { parts, mean, .. }) = self.look_at(patch, x, at.tet) else { return false };
        let y = body.partition.corners(cell).map(|particle| body.partition.anchor(particle).of(x));
        let f = body.awake_cell(cell).gradient_of(&y);
        // What of the tet's volume stays asleep has to be strained as the whole was, too.
        !parts.iter().chain([&f]).all(|own| is_in_reach(own, &mean)) || !is_in_reach(&f, &parts[at.part as usize])
    }

    /// Returns the gradients of a tet some of whose cells may be crushed.
    fn look_at(&mut self, patch: &RunningPatch, x: &[DVec3], tet: u32) -> Option<Strained> {
        match self.of_tet[tet as usize] {
            Known::Sound => None,
            Known::Strained(number) => Some(self.strained[number as usize]),
            Known::Nothing => {
                let residual = patch.residual_element(tet);
                let parts = residual.gradients(x, DMat3::IDENTITY);
                let mean = residual.mean(&parts);
                let least = parts.iter().map(DMat3::determinant).fold(f64::INFINITY, f64::min);
                if least >= SOUND && least >= SOUND * mean.determinant() {
                    self.of_tet[tet as usize] = Known::Sound;
                    self.sound.push(tet);
                    return None;
                }
                self.of_tet[tet as usize] = Known::Strained(self.strained.len() as u32);
                let strained = Strained { tet, parts, mean };
                self.strained.push(strained);
                Some(strained)
            }
        }
    }
}
