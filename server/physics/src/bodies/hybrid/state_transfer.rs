//! State transfer from one set of active particles to another: which cell or coarse tet answers for which volume
//! changes, energy and force do not (`prestrain`).
//!
//! It leaves alone what a switch does not change: cells that stay awake and whose particles stay where they are, and
//! coarse tets that keep their volume and whose nodes stay where they are.
use super::{
    body::HybridBody,
    composite::PARTS,
    partition::{Cell, Partition},
    patch::KEPT,
    prestrain::{
        CellPrestrain, PrestrainDecay, ResidualPrestrain, cell_energy_j, change, effective, modes_m2, residual_energy_j,
    },
    residual_element::ResidualElement,
    running::RunningPatch,
};
use glam::{DMat3, DVec3};

/// Hourglass amplitudes smaller than this, over the spacing, count as zero.
const NO_MODES: f64 = 1e-9;

/// A switch from one patch to another.
#[derive(Debug, Clone, Copy)]
pub(super) struct PatchSwitch<'a> {
    pub(super) before: &'a RunningPatch,
    pub(super) after: &'a RunningPatch,
    /// Whether each coarse node is moved by the switch.
    pub(super) is_moved: &'a [bool],
}

/// How a switch moves the coarse nodes.
#[derive(Debug, Clone, Copy)]
pub(super) struct NodeShifts<'a> {
    /// Positions (m) before the switch.
    pub(super) x_before: &'a [DVec3],
    /// Displacements (m) by it.
    pub(super) shifts_m: &'a [DVec3],
    /// Positions (m) after it.
    pub(super) x_after: &'a [DVec3],
}

/// The cells and coarse tets that a switch changes, with their strain before it.
#[derive(Debug, Clone, Default)]
pub(super) struct Before {
    /// Awake cells, ascending.
    cells: Vec<CellBefore>,
    /// Those of the cells that fall asleep: their tet, and their number in `cells`.
    asleep: Vec<(u32, u32)>,
    tets: Vec<TetBefore>,
    /// The prestrain after the switch; a buffer between switches.
    next: PrestrainDecay,
}

#[derive(Debug, Clone, Copy)]
struct CellBefore {
    cell: u32,
    /// Effective gradients of shape and volume.
    shape: DMat3,
    volume: DMat3,
    /// `(1 − a) Σ_k w_k |q_k|²` (m²).
    modes_m2: f64,
}

#[derive(Debug, Clone, Copy)]
struct TetBefore {
    tet: u32,
    /// `F_g`.
    gradients: [DMat3; PARTS],
    /// Whether the switch changes its residual element, and not only the positions of its nodes.
    residual_changes: bool,
    /// Effective gradients of the parts' shape and of the tet's volume.
    parts: [DMat3; PARTS],
    whole: DMat3,
}

impl Before {
    pub(super) fn with_room(cells: usize, tets: usize) -> Self {
        Self {
            cells: Vec::with_capacity(cells),
            asleep: Vec::with_capacity(cells),
            tets: Vec::with_capacity(tets),
            next: PrestrainDecay::with_room(cells, tets),
        }
    }

    /// Records the strain of all that a switch changes; returns its elastic energy (J). The patch before the switch is
    /// displaced to positions `x` (m).
    pub(super) fn take(
        &mut self,
        body: &HybridBody,
        switch: &PatchSwitch<'_>,
        x: &[DVec3],
        decay: &PrestrainDecay,
    ) -> f64 {
        let PatchSwitch { before: patch, after: next, .. } = *switch;
        let mut held_j = 0.0;
        self.cells.clear();
        self.asleep.clear();
        for &cell in patch.cells() {
            if switch.leaves_alone(body, cell) {
                continue;
            }
            let prestrain = decay.of_cell(cell).unwrap_or(CellPrestrain::none(cell));
            let (rest, y) = (body.awake_cell(cell as usize), patch.corners_m(body, cell));
            let [shape, volume] = prestrain.effective(&rest, &y);
            let modes_m2 = (1.0 - prestrain.modes) * modes_m2(&rest, &y);
            held_j += cell_energy_j(&rest, body.material_of_cell(cell as usize), [&shape, &volume], modes_m2);
            if !next.is_awake(cell) {
                self.asleep.push((body.partition.cells()[cell as usize].tet, self.cells.len() as u32));
            }
            self.cells.push(CellBefore { cell, shape, volume, modes_m2 });
        }
        self.asleep.sort_unstable();
        self.tets.clear();
        let first = next.taken_from().iter().filter(|&tet| !patch.taken_from().contains(tet));
        for &tet in patch.taken_from().iter().chain(first) {
            if patch.residual_element(tet) != next.residual_element(tet) {
                held_j += self.take_tet(body, tet, true, patch.residual_element(tet), x, decay);
            }
        }
        self.tets.sort_unstable_by_key(|before| before.tet);
        held_j
    }

    fn take_tet(
        &mut self,
        body: &HybridBody,
        tet: u32,
        residual_changes: bool,
        residual: &ResidualElement,
        x: &[DVec3],
        decay: &PrestrainDecay,
    ) -> f64 {
        let prestrain = decay.of_tet(tet).unwrap_or(ResidualPrestrain::none(tet));
        let gradients = residual.gradients(x, DMat3::IDENTITY);
        let (parts, whole) = prestrain.effective(residual, &gradients);
        self.tets.push(TetBefore { tet, gradients, residual_changes, parts, whole });
        residual_energy_j(residual, body.material_of_tet(tet), &parts, &whole)
    }

    /// Records the tets, too, of which only nodes have moved, and replaces the prestrain `decay` by that after the
    /// switch. The patch after the switch is displaced. Returns the elastic energy (J) that those tets had, and the one
    /// that all that changes has now.
    pub(super) fn prestrain_after(
        &mut self,
        body: &HybridBody,
        switch: &PatchSwitch<'_>,
        nodes: &NodeShifts<'_>,
        decay: &mut PrestrainDecay,
    ) -> (f64, f64) {
        let next = switch.after;
        let (known, mut moved_j, mut now_j) = (self.tets.len(), 0.0, 0.0);
        let has_moved = |node: &u32| nodes.shifts_m[*node as usize] != DVec3::ZERO;
        for tet in 0..body.partition.residual_elements().len() as u32 {
            let is_known = self.tets[..known].binary_search_by_key(&tet, |before| before.tet).is_ok();
            if !is_known && next.residual_element(tet).nodes.iter().any(has_moved) {
                moved_j += self.take_tet(body, tet, false, next.residual_element(tet), nodes.x_before, decay);
            }
        }
        self.tets.sort_unstable_by_key(|before| before.tet);
        self.next.clear();
        for &cell in next.cells() {
            if switch.leaves_alone(body, cell) {
                self.next.cells.extend(decay.of_cell(cell).filter(CellPrestrain::exceeds_a_trace));
                continue;
            }
            let (prestrain, energy_j) = self.of_cell(body, next, cell);
            now_j += energy_j;
            self.next.cells.extend(prestrain);
        }
        for number in 0..self.tets.len() {
            let (prestrain, energy_j) = self.of_tet(body, next, nodes, &self.tets[number]);
            now_j += energy_j;
            self.next.tets.extend(prestrain);
        }
        // Tets that the switch leaves alone keep their prestrain.
        for prestrain in decay.left_of_tets().filter(ResidualPrestrain::exceeds_a_trace) {
            if self.tets.binary_search_by_key(&prestrain.tet, |before| before.tet).is_err() {
                self.next.tets.push(prestrain);
            }
        }
        self.next.start();
        std::mem::swap(decay, &mut self.next);
        (moved_j, now_j)
    }

    /// Returns the prestrain of a cell that is awake now, with which it is strained as it was, or as its part was, and
    /// its energy (J). A cell that was awake may have particles that have fallen asleep.
    fn of_cell(&self, body: &HybridBody, patch: &RunningPatch, cell: u32) -> (Option<CellPrestrain>, f64) {
        let (rest, y) = (body.awake_cell(cell as usize), patch.corners_m(body, cell));
        let (f, now_m2) = (rest.gradient_of(&y), modes_m2(&rest, &y));
        let own = self.cells.binary_search_by_key(&cell, |before| before.cell);
        let before = if let Ok(at) = own {
            Some((self.cells[at].shape, self.cells[at].volume, self.cells[at].modes_m2))
        } else {
            let Cell { tet, part, .. } = body.partition.cells()[cell as usize];
            let at = self.tets.binary_search_by_key(&tet, |before| before.tet).ok();
            at.map(|at| (self.tets[at].parts[part as usize], self.tets[at].whole, 0.0))
        };
        let prestrain = before.map(|(shape, volume, before_m2)| {
            let least_m2 = (NO_MODES * body.partition.sites().spacing_m()).powi(2);
            let modes = if now_m2 > least_m2 { (1.0 - before_m2 / now_m2).max(0.0) } else { 0.0 };
            CellPrestrain { cell, shape: change(&f, &shape), volume: change(&f, &volume), modes }
        });
        let prestrain = prestrain.filter(CellPrestrain::is_something);
        let now = prestrain.unwrap_or(CellPrestrain::none(cell));
        let gradients = [&effective(&f, &now.shape), &effective(&f, &now.volume)];
        let energy_j =
            cell_energy_j(&rest, body.material_of_cell(cell as usize), gradients, (1.0 - now.modes) * now_m2);
        (prestrain, energy_j)
    }

    /// Returns the prestrain of a tet's residual element, which includes what fell asleep in it, and its energy (J).
    fn of_tet(
        &self,
        body: &HybridBody,
        patch: &RunningPatch,
        nodes: &NodeShifts<'_>,
        before: &TetBefore,
    ) -> (Option<ResidualPrestrain>, f64) {
        let residual = patch.residual_element(before.tet);
        let mut kept_m3 = residual.volume_m3;
        let (mut parts, mut whole) = ([DMat3::ZERO; PARTS], DMat3::ZERO);
        let first = self.asleep.partition_point(|(tet, _)| *tet < before.tet);
        for &(_, number) in self.asleep[first..].iter().take_while(|(tet, _)| *tet == before.tet) {
            let CellBefore { cell, shape, volume, .. } = self.cells[number as usize];
            let part = body.partition.cells()[cell as usize].part as usize;
            let volume_m3 = transferred_m3(&body.partition, cell);
            kept_m3[part] -= volume_m3;
            parts[part] += shape * volume_m3;
            whole += volume * volume_m3;
        }
        for part in 0..PARTS {
            parts[part] += before.parts[part] * kept_m3[part];
            whole += before.whole * kept_m3[part];
        }
        let gradients = if before.residual_changes {
            residual.gradients(nodes.x_after, DMat3::IDENTITY)
        } else {
            residual.gradients_after(&before.gradients, nodes.shifts_m)
        };
        let mean = residual.mean(&gradients);
        let mut prestrain = ResidualPrestrain::none(before.tet);
        for part in 0..PARTS {
            let volume_m3 = residual.volume_m3[part];
            if volume_m3 > 0.0 {
                prestrain.parts[part] = change(&gradients[part], &(parts[part] * (1.0 / volume_m3)));
            }
        }
        prestrain.whole = change(&mean, &(whole * (1.0 / residual.total_m3())));
        let prestrain = Some(prestrain).filter(ResidualPrestrain::is_something);
        let now = prestrain.unwrap_or(ResidualPrestrain::none(before.tet));
        let shapes = std::array::from_fn(|part| effective(&gradients[part], &now.parts[part]));
        (
            prestrain,
            residual_energy_j(residual, body.material_of_tet(before.tet), &shapes, &effective(&mean, &now.whole)),
        )
    }
}

impl PatchSwitch<'_> {
    /// Returns whether the switch changes nothing about an awake cell: it stays awake, and its particles stay where
    /// they are, none of them following a coarse node that is moved.
    fn leaves_alone(&self, body: &HybridBody, cell: u32) -> bool {
        self.before.is_awake(cell) && self.after.is_awake(cell) && !self.after.follows(body, cell, self.is_moved)
    }
}

/// Returns `(1 − ε) V_c` (m³), the volume that is transferred between a cell and its tet.
fn transferred_m3(partition: &Partition, cell: u32) -> f64 {
    (1.0 - KEPT) * partition.moments(cell as usize).volume_m3
}
