//! Prestrain: a change of rest state, with which cells of a strained body wake, and volume falls asleep, without a step
//! in energy or force.
//!
//! A coarse part strains less than the cells in it do, so a cell that woke as it is would raise the energy. It is given
//! the strain that its part had by a change of its rest state, the prestrain, which then decays: with
//! `A = F⁻¹ F_before − I` at first, the effective gradient is
//! ```text
//! F̃ = F (I + A)       P = P̃(F̃) (I + A)ᵀ       A = s A_0,  s = e^{−t/τ}
//! ```
//! There is one `A` for its shape and one for its volume, whose strain is the tet's (`residual_element`), and the
//! hourglass stiffness is `κ (1 − a)`, with `a` from 1 to 0. A part that loses volume, or gets some back, has an `A` of
//! its own: its effective gradient is at first the mean, by volume, of those of what it is made of. Where these are
//! strained little and turn little against each other its energy is no more than theirs (Jensen); no objective energy is
//! convex, so where they turn much it may be more, and what it changes by is booked. Changes of the rest state are
//! objective: they do not change momentum.
//! The energy that the decay takes, `−ds/dt ∂U/∂s`, is booked in the ledger.
//!
//! Which cell or part wakes or falls asleep with which prestrain is worked out in `state_transfer`. Accelerations do not
//! jump, either (`transition_force`).
use super::{cell::RestCell, composite::PARTS, residual_element::ResidualElement};
use crate::hash::Chain;
use crate::material::{Material, viscous};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// `τ` (s), the time constant of the decay.
pub(super) const DECAY_S: f64 = 0.04;
/// A prestrain smaller than this is left out, and what is left of its energy booked.
const NOTHING: f64 = 1e-6;
/// A prestrain smaller than this is left out, its energy being negligible.
const TRACE: f64 = 1e-13;
/// Largest entry of a prestrain `A`. The stiffness of what wakes grows by `‖I + A‖²`, so that cells which wake while they
/// are crushed would need many times more substeps than others.
const MOST: f64 = 2.0;

/// The prestrain of a cell: `A` and `a` when it woke.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CellPrestrain {
    /// Index of the cell.
    pub cell: u32,
    /// `A` of its shape.
    pub shape: DMat3,
    /// `A` of its volume.
    pub volume: DMat3,
    /// `a` of its hourglass stiffness.
    pub modes: f64,
}

/// The prestrain of a coarse tet's residual element, of which volume woke or fell asleep while it was strained.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ResidualPrestrain {
    /// Index of the tet.
    pub tet: u32,
    /// `A` of its parts' shape.
    pub parts: [DMat3; PARTS],
    /// `A` of its volume.
    pub whole: DMat3,
}

/// All prestrains of a body, and how far they have decayed.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PrestrainDecay {
    /// Prestrains of cells, ascending, as are those of tets. [`Self::start`] has to be called after either list was
    /// changed.
    pub(super) cells: Vec<CellPrestrain>,
    pub(super) tets: Vec<ResidualPrestrain>,
    progress: Progress,
    /// Largest entry of all prestrains.
    most: f64,
    /// A checksum of cells and tets, by which kernels tell whether they have them.
    mark: u64,
}

/// How far the prestrains have decayed.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Progress {
    /// `s`, the fraction that is left.
    left: f64,
    /// `s ∂U/∂s` (J) of coarse tets and of cells when their forces were last computed.
    along_j: [f64; 2],
}

/// Determinant of a gradient up to which it counts as inverted.
const LEAST_J: f64 = 0.05;

/// Returns `e^{−T/τ}`, by which a decay goes on in a period `T`.
pub(super) fn factor(period_s: f64, time_constant_s: f64) -> f64 {
    (-period_s / time_constant_s).exp()
}

/// Returns the effective gradient `F (I + A)`.
pub(super) fn effective(f: &DMat3, a: &DMat3) -> DMat3 {
    *f + *f * *a
}

/// Returns `A` with which the effective gradient of `F` is `wanted`; it is shortened where it would have an entry above 2,
/// and zero where `F` is (nearly) inverted. The energy then jumps, and the jump is booked.
pub(super) fn change(f: &DMat3, wanted: &DMat3) -> DMat3 {
    if f.determinant() <= LEAST_J {
        return DMat3::ZERO;
    }
    let a = f.inverse() * (*wanted - *f);
    a * (MOST / largest(&a)).min(1.0)
}

/// Returns whether there is an `A` with which the effective gradient of `F` is `wanted`, neither zero nor shortened.
pub(super) fn is_in_reach(f: &DMat3, wanted: &DMat3) -> bool {
    f.determinant() > LEAST_J && largest(&(f.inverse() * (*wanted - *f))) <= MOST
}

/// Returns the stress `P̃(F (I + A)) (I + A)ᵀ` (Pa).
fn piola(material: &Material, f: &DMat3, a: &DMat3) -> DMat3 {
    let p = material.piola(&effective(f, a));
    p + p * a.transpose()
}

/// Returns `U_c` (J) of a cell's effective gradients, of shape and of volume, and of its hourglasses'
/// `(1 − a) Σ_k w_k |q_k|²` (m²).
pub(super) fn cell_energy_j(rest: &RestCell, material: &Material, [shape, volume]: [&DMat3; 2], modes_m2: f64) -> f64 {
    let (of_shape, of_volume) = material.shape_and_volume();
    let density = of_shape.energy_density(shape) + of_volume.energy_density(volume);
    rest.volume_m3 * density + 0.5 * rest.hourglass_m * material.lame.mu_pa * modes_m2
}

/// Returns `U_e` (J) of a residual element's effective gradients, of the parts' shape and of the tet's volume.
pub(super) fn residual_energy_j(
    residual: &ResidualElement,
    material: &Material,
    shapes: &[DMat3; PARTS],
    whole: &DMat3,
) -> f64 {
    let (of_shape, of_volume) = material.shape_and_volume();
    let shape: f64 = shapes.iter().zip(residual.volume_m3).map(|(f, v)| v * of_shape.energy_density(f)).sum();
    shape + residual.total_m3() * of_volume.energy_density(whole)
}

/// Returns `Σ_k w_k |q_k|²` (m²).
pub(super) fn modes_m2(rest: &RestCell, y: &[DVec3; 8]) -> f64 {
    rest.modes_m2(&rest.amplitudes(y))
}

fn largest(a: &DMat3) -> f64 {
    a.to_cols_array().iter().fold(0.0, |most, entry| most.max(entry.abs()))
}

impl PrestrainDecay {
    pub(super) fn with_room(cells: usize, tets: usize) -> Self {
        Self { cells: Vec::with_capacity(cells), tets: Vec::with_capacity(tets), ..Self::default() }
    }

    /// Makes prestrains of these cells and tets, both ascending, whose decay starts now.
    pub fn new(cells: Vec<CellPrestrain>, tets: Vec<ResidualPrestrain>) -> Self {
        let mut decay = Self { cells, tets, ..Self::default() };
        decay.start();
        decay
    }

    /// Adds all prestrains, and how far they have decayed, to a hash.
    pub(super) fn chain(&self, chain: &mut Chain) {
        chain.list(&self.cells, |chain, prestrain| {
            chain.whole(u64::from(prestrain.cell));
            chain.matrix(&prestrain.shape);
            chain.matrix(&prestrain.volume);
            chain.real(prestrain.modes);
        });
        chain.list(&self.tets, |chain, prestrain| {
            chain.whole(u64::from(prestrain.tet));
            prestrain.parts.iter().for_each(|part| chain.matrix(part));
            chain.matrix(&prestrain.whole);
        });
        chain.real(self.progress.left);
        self.progress.along_j.into_iter().for_each(|along_j| chain.real(along_j));
    }

    /// Returns `s`, the fraction that is left.
    pub fn left(&self) -> f64 {
        self.progress.left
    }

    pub(super) fn progress(&self) -> Progress {
        self.progress
    }

    /// Restores what [`Self::progress`] was.
    pub(super) fn go_back(&mut self, progress: Progress) {
        self.progress = progress;
    }

    pub(super) fn mark(&self) -> u64 {
        self.mark
    }

    /// Returns whether nothing has prestrain.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty() && self.tets.is_empty()
    }

    pub(super) fn clear(&mut self) {
        self.cells.clear();
        self.tets.clear();
        (self.progress, self.most, self.mark) = (Progress::default(), 0.0, 0);
    }

    /// Starts the decay, once all prestrains are in the lists: sorts the tets, and computes the largest entry and the
    /// checksum.
    pub(super) fn start(&mut self) {
        self.tets.sort_unstable_by_key(|prestrain| prestrain.tet);
        self.progress = Progress { left: 1.0, along_j: [0.0; 2] };
        let of_cells = self.cells.iter().map(CellPrestrain::largest);
        self.most = of_cells.chain(self.tets.iter().map(ResidualPrestrain::largest)).fold(0.0, f64::max);
        // FNV-1a, word by word.
        let mix = |mark: u64, word: u64| (mark ^ word).wrapping_mul(0x0100_0000_01b3);
        let of_matrix =
            |mark: u64, a: &DMat3| a.to_cols_array().iter().fold(mark, |mark, entry| mix(mark, entry.to_bits()));
        let of_cell = |mark: u64, prestrain: &CellPrestrain| {
            let mark = mix(mix(mark, u64::from(prestrain.cell)), prestrain.modes.to_bits());
            of_matrix(of_matrix(mark, &prestrain.shape), &prestrain.volume)
        };
        let of_tet = |mark: u64, prestrain: &ResidualPrestrain| {
            prestrain.parts.iter().chain([&prestrain.whole]).fold(mix(mark, u64::from(prestrain.tet)), of_matrix)
        };
        let mark = self.cells.iter().fold(0xcbf2_9ce4_8422_2325, of_cell);
        self.mark = self.tets.iter().fold(mix(mark, self.cells.len() as u64), of_tet);
    }

    /// Lets the prestrains decay for some time (s).
    pub(crate) fn advance(&mut self, time_s: f64) {
        self.progress.left *= factor(time_s, DECAY_S);
    }

    /// Returns whether there are prestrains, and so little is left of them that they can be left out.
    pub(super) fn has_decayed(&self) -> bool {
        !self.is_empty() && self.most * self.left() < NOTHING
    }

    /// Returns `s ∂U/∂s` (J) when forces were last computed.
    pub(super) fn along_j(&self) -> f64 {
        self.progress.along_j.iter().sum()
    }

    /// Records `s ∂U/∂s` (J) of coarse tets (level 0) or of cells (level 1); returns the energy (J) that the decay took
    /// in the time (s) since the last record.
    pub(crate) fn take_along(&mut self, level: usize, along_j: f64, time_s: f64) -> f64 {
        let before_j = std::mem::replace(&mut self.progress.along_j[level], along_j);
        0.5 * (before_j + along_j) * time_s / DECAY_S
    }

    pub(super) fn copy_from(&mut self, other: &Self) {
        self.cells.clone_from(&other.cells);
        self.tets.clone_from(&other.tets);
        (self.progress, self.most, self.mark) = (other.progress, other.most, other.mark);
    }

    pub(super) fn is_finite(&self) -> bool {
        let rest = (0.0..=1.0).contains(&self.left()) && self.most.is_finite() && self.along_j().is_finite();
        let cells =
            rest && self.cells.iter().all(|c| c.shape.is_finite() && c.volume.is_finite() && c.modes.is_finite());
        cells && self.tets.iter().all(|t| t.whole.is_finite() && t.parts.iter().all(DMat3::is_finite))
    }

    /// Returns what is left of a cell's prestrain, if it has any.
    pub(super) fn of_cell(&self, cell: u32) -> Option<CellPrestrain> {
        let at = self.cells.binary_search_by_key(&cell, |prestrain| prestrain.cell).ok()?;
        let CellPrestrain { shape, volume, modes, .. } = self.cells[at];
        let left = self.left();
        Some(CellPrestrain { cell, shape: shape * left, volume: volume * left, modes: modes * left })
    }

    /// Returns what is left of a tet's prestrain, if it has any.
    pub(super) fn of_tet(&self, tet: u32) -> Option<ResidualPrestrain> {
        let at = self.tets.binary_search_by_key(&tet, |prestrain| prestrain.tet).ok()?;
        let ResidualPrestrain { parts, whole, .. } = self.tets[at];
        Some(ResidualPrestrain { tet, parts: parts.map(|part| part * self.left()), whole: whole * self.left() })
    }

    /// Returns what is left of the prestrains of all tets, ascending.
    pub(super) fn left_of_tets(&self) -> impl Iterator<Item = ResidualPrestrain> + '_ {
        self.tets.iter().filter_map(|prestrain| self.of_tet(prestrain.tet))
    }

    /// Returns whether cells and tets are in ascending order.
    pub(super) fn is_sorted(&self) -> bool {
        self.cells.is_sorted_by(|a, b| a.cell < b.cell) && self.tets.is_sorted_by(|a, b| a.tet < b.tet)
    }
}

impl CellPrestrain {
    fn largest(&self) -> f64 {
        // An hourglass stiffness that is too small shows less than a strain of the same size.
        largest(&self.shape).max(largest(&self.volume)).max(self.modes * NOTHING.sqrt())
    }

    pub(super) fn is_something(&self) -> bool {
        self.largest() > NOTHING
    }

    /// Returns whether it is more than what may be left out without being booked.
    pub(super) fn exceeds_a_trace(&self) -> bool {
        self.largest() > TRACE
    }

    /// Returns the prestrain of a cell that has none.
    pub(crate) fn none(cell: u32) -> Self {
        Self { cell, shape: DMat3::ZERO, volume: DMat3::ZERO, modes: 0.0 }
    }

    /// Returns the effective gradients of shape and volume.
    pub(super) fn effective(&self, rest: &RestCell, y: &[DVec3; 8]) -> [DMat3; 2] {
        let f = rest.gradient_of(y);
        [effective(&f, &self.shape), effective(&f, &self.volume)]
    }

    /// Returns the elastic energy `U_c` (J).
    pub(super) fn energy_j(&self, rest: &RestCell, material: &Material, y: &[DVec3; 8]) -> f64 {
        let [shape, volume] = self.effective(rest, y);
        cell_energy_j(rest, material, [&shape, &volume], (1.0 - self.modes) * modes_m2(rest, y))
    }

    /// Returns the forces `f_p` (N), and the power (W) that viscous stress takes.
    pub(super) fn forces_n(
        &self,
        rest: &RestCell,
        material: &Material,
        y: &[DVec3; 8],
        rate: &[DVec3; 8],
    ) -> ([DVec3; 8], f64) {
        let (of_shape, of_volume) = material.shape_and_volume();
        let f = rest.gradient_of(y);
        let mut stress = piola(&of_shape, &f, &self.shape) + piola(&of_volume, &f, &self.volume);
        let mut power_w = 0.0;
        if !material.viscosity.is_zero() {
            let f_dot = rest.gradient_of(rate);
            stress += viscous::piola(material.viscosity, &f, &f_dot);
            power_w = rest.volume_m3 * viscous::power_density(material.viscosity, &f, &f_dot);
        }
        let amplitudes = rest.stiffened(&rest.amplitudes(y)).map(|q| q * (1.0 - self.modes));
        (rest.corner_forces_n(material.lame.mu_pa, &stress, &amplitudes), power_w)
    }
}

impl ResidualPrestrain {
    fn largest(&self) -> f64 {
        self.parts.iter().chain([&self.whole]).map(largest).fold(0.0, f64::max)
    }

    pub(super) fn is_something(&self) -> bool {
        self.largest() > NOTHING
    }

    /// Returns whether it is more than what may be left out without being booked.
    pub(super) fn exceeds_a_trace(&self) -> bool {
        self.largest() > TRACE
    }

    /// Returns the prestrain of a tet that has none.
    pub(super) fn none(tet: u32) -> Self {
        Self { tet, parts: [DMat3::ZERO; PARTS], whole: DMat3::ZERO }
    }

    /// Returns the effective gradients of the parts' shape, and of the tet's volume.
    pub(super) fn effective(&self, residual: &ResidualElement, gradients: &[DMat3; PARTS]) -> ([DMat3; PARTS], DMat3) {
        let mean = residual.mean(gradients);
        (std::array::from_fn(|part| effective(&gradients[part], &self.parts[part])), effective(&mean, &self.whole))
    }

    /// Returns the elastic energy `U_e` (J).
    pub(super) fn energy_j(&self, residual: &ResidualElement, material: &Material, x: &[DVec3]) -> f64 {
        if residual.nodes.is_empty() {
            return 0.0;
        }
        let (shapes, whole) = self.effective(residual, &residual.gradients(x, DMat3::IDENTITY));
        residual_energy_j(residual, material, &shapes, &whole)
    }

    /// Adds forces (N) to `forces_n`; returns the power (W) that viscous stress takes.
    pub(super) fn add_forces_n(
        &self,
        residual: &ResidualElement,
        material: &Material,
        x: &[DVec3],
        v: &[DVec3],
        forces_n: &mut [DVec3],
    ) -> f64 {
        if residual.nodes.is_empty() {
            return 0.0;
        }
        let (of_shape, of_volume) = material.shape_and_volume();
        let gradients = residual.gradients(x, DMat3::IDENTITY);
        let pressure = piola(&of_volume, &residual.mean(&gradients), &self.whole);
        let mut power_w = 0.0;
        let mut stresses = [pressure; PARTS];
        for part in 0..PARTS {
            stresses[part] += piola(&of_shape, &gradients[part], &self.parts[part]);
        }
        if !material.viscosity.is_zero() {
            power_w = residual.add_viscous_pa(material, &gradients, v, &mut stresses);
        }
        residual.scatter(&stresses, forces_n);
        power_w
    }
}
