//! Which parts of coarse tets are crushed, so that no particle may wake in them.
//!
//! A cell that wakes is to be strained as the tet was whose volume it takes: in shape as its part, with gradient `F`, in
//! volume as the tet's mean `F̄`, by a prestrain `A` with `F (I + A) = F̄` ([`super::prestrain`]). Where a part is turned inside
//! out although its tet is not, there is no such prestrain. The cell would wake with the energy of a crushed volume,
//! which drives the body as no tool did. Its particles sleep on until the part is itself again.
use super::{body::HybridBody, prestrain::is_in_reach, running::RunningPatch};
use glam::{DMat3, DVec3};

/// Says that a tet was looked at; the bits below it are those of its crushed parts.
const LOOKED_AT: u8 = 1 << 7;

/// What is known of the tets that were looked at.
#[derive(Debug, Clone, Default)]
pub(super) struct CrushedParts {
    of_tet: Vec<u8>,
    looked_at: Vec<u32>,
}

impl CrushedParts {
    pub(super) fn new(body: &HybridBody) -> Self {
        let tets = body.partition.residual_elements().len();
        Self { of_tet: vec![0; tets], looked_at: Vec::with_capacity(tets) }
    }

    /// Removes from an ascending list of particles those that sleep and may not wake now; `x` are the positions (m) of the
    /// coarse nodes.
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
                || body.partition.cells_at(*particle).all(|cell| {
                    let at = body.partition.cells()[cell];
                    patch.is_awake(cell as u32) || self.crushed(patch, x, at.tet) & (1 << at.part) == 0
                })
        });
        for tet in self.looked_at.drain(..) {
            self.of_tet[tet as usize] = 0;
        }
    }

    /// Returns a bit for every crushed part of a tet.
    fn crushed(&mut self, patch: &RunningPatch, x: &[DVec3], tet: u32) -> u8 {
        let known = &mut self.of_tet[tet as usize];
        if *known == 0 {
            let residual = patch.residual_element(tet);
            let gradients = residual.gradients(x, DMat3::IDENTITY);
            let mean = residual.mean(&gradients);
            let is_crushed = |part: &usize| residual.volume_m3[*part] > 0.0 && !is_in_reach(&gradients[*part], &mean);
            *known = (0..gradients.len()).filter(is_crushed).fold(LOOKED_AT, |bits, part| bits | 1 << part);
            self.looked_at.push(tet);
        }
        *known
    }
}
