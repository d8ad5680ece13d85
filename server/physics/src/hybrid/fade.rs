//! How cells wake, and volume falls asleep, in a body that is strained: without a step in energy or force.
//!
//! A coarse part strains less than the cells in it do, so a cell that woke as it is would raise the energy. It is given the strain that its part had by a
//! change of its rest state, which then fades: with `A = F⁻¹ F_before − I` at first, the effective gradient is
//! ```text
//! F̃ = F (I + A)       P = P̃(F̃) (I + A)ᵀ       A ← e^{−T/τ} A per tick T
//! ```
//! one `A` for its shape and one for its volume, which is the tet's (`share`), and hourglass stiffness `κ (1 − a)`, `a` from 1 to 0. Only one in [`GROUPS`]
//! cells and tets fades in a tick, by as much more: what it gives has to be worked out exactly. What is left of a part,
//! or what it gets back, has an `A` of its own: its effective gradient is at first the mean of what it is made of, by volume, and by Jensen its energy no more than
//! theirs. Changes of the rest state are objective: momentum does not hear of them. What fading gives or takes is booked in the ledger.
//!
//! Nor do accelerations jump (`balance`).
use super::{
    cell::{MODE_WEIGHTS, RestCell},
    composite::PARTS,
    share::{Share, split},
};
use crate::material::{Material, viscous};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// τ (s).
pub(super) const FADING_S: f64 = 0.03;
/// A change of rest state smaller than this is none.
const NOTHING: f64 = 1e-6;
/// Into how many groups cells and tets fall that take turns.
pub(super) const GROUPS: u32 = 4;

/// A cell that woke strained.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CellFade {
    /// Index of the cell.
    pub cell: u32,
    /// `A` of its shape.
    pub shape: DMat3,
    /// `A` of its volume.
    pub volume: DMat3,
    /// `a`.
    pub modes: f64,
}

/// A coarse tet of which some woke or fell asleep strained.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ShareFade {
    /// The tet.
    pub tet: u32,
    /// `A` of its parts' shape.
    pub parts: [DMat3; PARTS],
    /// `A` of its volume.
    pub whole: DMat3,
}

/// All that fades, ascending.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Fading {
    /// Cells.
    pub cells: Vec<CellFade>,
    /// Coarse tets.
    pub tets: Vec<ShareFade>,
}

/// `e^{−T/τ}`.
pub(super) fn factor(period_s: f64, time_constant_s: f64) -> f64 {
    (-period_s / time_constant_s).exp()
}

/// `F (I + A)`.
pub(super) fn effective(f: &DMat3, a: &DMat3) -> DMat3 {
    *f + *f * *a
}

/// `A` with which `F` counts as `wanted`; none where it is turned inside out.
pub(super) fn change(f: &DMat3, wanted: &DMat3) -> DMat3 {
    if f.determinant() > 0.05 { f.inverse() * (*wanted - *f) } else { DMat3::ZERO }
}

/// `P̃(F (I + A)) (I + A)ᵀ` (Pa).
fn piola(material: &Material, f: &DMat3, a: &DMat3) -> DMat3 {
    let p = material.piola(&effective(f, a));
    p + p * a.transpose()
}

fn largest(a: &DMat3) -> f64 {
    a.to_cols_array().iter().fold(0.0, |most, entry| most.max(entry.abs()))
}

impl Fading {
    pub(super) fn with_room(cells: usize, tets: usize) -> Self {
        Self { cells: Vec::with_capacity(cells), tets: Vec::with_capacity(tets) }
    }

    /// Whether nothing fades.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty() && self.tets.is_empty()
    }

    pub(super) fn clear(&mut self) {
        self.cells.clear();
        self.tets.clear();
    }

    pub(super) fn copy_from(&mut self, other: &Self) {
        self.cells.clone_from(&other.cells);
        self.tets.clone_from(&other.tets);
    }

    pub(super) fn is_finite(&self) -> bool {
        let cells = self.cells.iter().all(|c| c.shape.is_finite() && c.volume.is_finite() && c.modes.is_finite());
        cells && self.tets.iter().all(|t| t.whole.is_finite() && t.parts.iter().all(DMat3::is_finite))
    }

    /// Leaves out what has faded.
    pub(super) fn forget_faded(&mut self) {
        self.cells.retain(CellFade::is_something);
        self.tets.retain(ShareFade::is_something);
    }

    /// Of a cell, if it fades.
    pub(super) fn of_cell(&self, cell: u32) -> Option<&CellFade> {
        self.cells.binary_search_by_key(&cell, |fade| fade.cell).ok().map(|at| &self.cells[at])
    }

    /// Of a tet, if it fades.
    pub(super) fn of_tet(&self, tet: u32) -> Option<&ShareFade> {
        self.tets.binary_search_by_key(&tet, |fade| fade.tet).ok().map(|at| &self.tets[at])
    }
}

impl CellFade {
    /// After fading by a factor.
    pub(super) fn faded(&self, factor: f64) -> Self {
        let faded = Self {
            cell: self.cell,
            shape: self.shape * factor,
            volume: self.volume * factor,
            modes: self.modes * factor,
        };
        if faded.is_something() { faded } else { Self::none(self.cell) }
    }

    pub(super) fn is_something(&self) -> bool {
        largest(&self.shape).max(largest(&self.volume)).max(self.modes * NOTHING.sqrt()) > NOTHING
    }

    /// Nothing of a cell.
    pub(crate) fn none(cell: u32) -> Self {
        Self { cell, shape: DMat3::ZERO, volume: DMat3::ZERO, modes: 0.0 }
    }

    /// Effective gradients of shape and volume.
    pub(super) fn effective(&self, rest: &RestCell, y: &[DVec3; 8]) -> [DMat3; 2] {
        let f = rest.gradient_of(y);
        [effective(&f, &self.shape), effective(&f, &self.volume)]
    }

    /// `U_c` (J).
    pub(super) fn energy_j(&self, rest: &RestCell, material: &Material, y: &[DVec3; 8]) -> f64 {
        let (of_shape, of_volume) = split(material);
        let [shape, volume] = self.effective(rest, y);
        let density = of_shape.energy_density(&shape) + of_volume.energy_density(&volume);
        let kappa = rest.hourglass_m * material.lame.mu_pa * (1.0 - self.modes);
        let modes = rest.amplitudes(y).iter().zip(MODE_WEIGHTS).map(|(q, w)| w * q.length_squared()).sum::<f64>();
        rest.volume_m3 * density + 0.5 * kappa * modes
    }

    /// `f_p` (N), and the power (W) that viscous stress takes.
    pub(super) fn forces_n(
        &self,
        rest: &RestCell,
        material: &Material,
        y: &[DVec3; 8],
        rate: &[DVec3; 8],
    ) -> ([DVec3; 8], f64) {
        let (of_shape, of_volume) = split(material);
        let f = rest.gradient_of(y);
        let mut stress = piola(&of_shape, &f, &self.shape) + piola(&of_volume, &f, &self.volume);
        let mut power_w = 0.0;
        if !material.viscosity.is_zero() {
            let f_dot = rest.gradient_of(rate);
            stress += viscous::piola(material.viscosity, &f, &f_dot);
            power_w = rest.volume_m3 * viscous::power_density(material.viscosity, &f, &f_dot);
        }
        let amplitudes = rest.amplitudes(y).map(|q| q * (1.0 - self.modes));
        (rest.corner_forces_n(material, &stress, &amplitudes), power_w)
    }
}

impl ShareFade {
    /// After fading by a factor.
    pub(super) fn faded(&self, factor: f64) -> Self {
        let faded = Self { tet: self.tet, parts: self.parts.map(|part| part * factor), whole: self.whole * factor };
        if faded.is_something() { faded } else { Self::none(self.tet) }
    }

    pub(super) fn is_something(&self) -> bool {
        self.parts.iter().chain([&self.whole]).any(|a| largest(a) > NOTHING)
    }

    /// Nothing of a tet.
    pub(super) fn none(tet: u32) -> Self {
        Self { tet, parts: [DMat3::ZERO; PARTS], whole: DMat3::ZERO }
    }

    /// Effective gradients of the parts' shape, and of the tet's volume.
    pub(super) fn effective(&self, share: &Share, x: &[DVec3]) -> ([DMat3; PARTS], DMat3) {
        let gradients = share.gradients(x, DMat3::IDENTITY);
        let mean = share.mean(&gradients);
        (std::array::from_fn(|part| effective(&gradients[part], &self.parts[part])), effective(&mean, &self.whole))
    }

    /// `U_e` (J).
    pub(super) fn energy_j(&self, share: &Share, material: &Material, x: &[DVec3]) -> f64 {
        if share.nodes.is_empty() {
            return 0.0;
        }
        let (of_shape, of_volume) = split(material);
        let (shapes, whole) = self.effective(share, x);
        let shape: f64 = shapes.iter().zip(share.volume_m3).map(|(f, v)| v * of_shape.energy_density(f)).sum();
        shape + share.total_m3() * of_volume.energy_density(&whole)
    }

    /// Adds forces (N) to `forces_n`; returns the power (W) that viscous stress takes.
    pub(super) fn add_forces_n(
        &self,
        share: &Share,
        material: &Material,
        x: &[DVec3],
        v: &[DVec3],
        forces_n: &mut [DVec3],
    ) -> f64 {
        if share.nodes.is_empty() {
            return 0.0;
        }
        let (of_shape, of_volume) = split(material);
        let gradients = share.gradients(x, DMat3::IDENTITY);
        let pressure = piola(&of_volume, &share.mean(&gradients), &self.whole);
        let mut power_w = 0.0;
        let mut stresses = [pressure; PARTS];
        for part in 0..PARTS {
            stresses[part] += piola(&of_shape, &gradients[part], &self.parts[part]);
        }
        if !material.viscosity.is_zero() {
            power_w = share.add_viscous_pa(material, &gradients, v, &mut stresses);
        }
        share.scatter(&stresses, forces_n);
        power_w
    }
}
