//! The kernels' layout of a patch's cells.
use super::RunningPatch;
use crate::bodies::hybrid::{
    body::HybridBody,
    kernels::CellRow,
    prestrain::{CellPrestrain, PrestrainDecay},
};

/// Where the kernels have a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Slot {
    /// A whole cell: its row, and its number among the cells of all rows.
    Row { row: u32, cell: u32 },
    /// Another cell: its run, and its number in the run.
    Cut { run: u32, number: u32 },
}

impl RunningPatch {
    /// Lays out rows of whole cells, of either size, and blocks of other cells, material by material, without
    /// prestrain.
    pub(super) fn lay_out(&mut self, hybrid: &HybridBody) {
        let partition = &hybrid.partition;
        for &cell in &self.prestrained_cells {
            if let Slot::Row { cell, .. } = self.slots[cell as usize] {
                self.full.put_prestrain(cell, None);
            }
        }
        self.prestrained_cells.clear();
        self.rows.clear();
        self.cut.clear();
        self.slots.clear();
        self.slots.resize(self.cells.len(), Slot::Row { row: 0, cell: 0 });
        let point_of = &self.point_of;
        let points_of = |cell: usize| partition.corners(cell).map(|particle| point_of[particle as usize]);
        let mut in_rows = 0;
        let materials = hybrid.materials.len() as u16;
        let sizes = if partition.has_doubled() { &[false, true][..] } else { &[false] };
        for (material, doubled) in
            (0..materials).flat_map(|material| sizes.iter().map(move |&doubled| (material, doubled)))
        {
            let some = |is_whole: bool| {
                let cells = self.cells.iter().map(|&cell| cell as usize).enumerate();
                cells.filter(move |&(_, number)| {
                    let cell = partition.cells()[number];
                    partition.is_whole(number) == is_whole
                        && cell.doubled == doubled
                        && hybrid.of_tet[cell.tet as usize] == material
                })
            };
            let first_row = self.rows.len();
            let of_size = if doubled { materials + material } else { material };
            for (number, cell) in some(true) {
                let points = points_of(cell);
                let points = [points[0], points[2], points[4], points[6]];
                match self.rows[first_row..].last_mut() {
                    Some(row) if row.points.map(|point| point + row.cells) == points => row.cells += 1,
                    _ => self.rows.push(CellRow {
                        points,
                        cells: 1,
                        material: of_size,
                        first: in_rows,
                        prestrained: false,
                    }),
                }
                self.slots[number] = Slot::Row { row: self.rows.len() as u32 - 1, cell: in_rows };
                in_rows += 1;
            }
            let count = some(false).count();
            if count == 0 {
                continue;
            }
            let run = self.cut.runs() as u32;
            self.cut.start(material, count);
            for (at, (number, cell)) in some(false).enumerate() {
                self.cut.put(at, points_of(cell), &hybrid.awake_cell(cell));
                self.slots[number] = Slot::Cut { run, number: at as u32 };
            }
        }
    }

    /// Returns whether these are the prestrains that the kernels were given last.
    pub(in crate::bodies::hybrid) fn knows(&self, decay: &PrestrainDecay) -> bool {
        self.prestrain_mark == decay.mark()
    }

    /// Gives the kernels the prestrains.
    pub(in crate::bodies::hybrid) fn put_prestrains(&mut self, decay: &PrestrainDecay) {
        self.prestrain_mark = decay.mark();
        let Self { rows, slots, full, cut, prestrained_cells, cells, .. } = self;
        for row in rows.iter_mut() {
            row.prestrained = false;
        }
        let mut put = |number: u32, prestrain: Option<&CellPrestrain>| match slots[number as usize] {
            Slot::Row { row, cell } => {
                rows[row as usize].prestrained |= prestrain.is_some();
                full.put_prestrain(cell, prestrain);
            }
            Slot::Cut { run, number } => cut.put_prestrain(run as usize, number as usize, prestrain),
        };
        for &number in prestrained_cells.iter() {
            if decay.of_cell(cells[number as usize]).is_none() {
                put(number, None);
            }
        }
        prestrained_cells.clear();
        let mut number = 0;
        for prestrain in &decay.cells {
            while cells.get(number).is_some_and(|&cell| cell < prestrain.cell) {
                number += 1;
            }
            if cells.get(number) == Some(&prestrain.cell) {
                put(number as u32, Some(prestrain));
                prestrained_cells.push(number as u32);
            }
        }
        for &tet in &self.prestrained_tets {
            if decay.of_tet(tet).is_none() {
                self.residual_kernel.put_prestrain(tet as usize, None);
            }
        }
        self.prestrained_tets.clear();
        for prestrain in &decay.tets {
            self.prestrained_tets.push(prestrain.tet);
            self.residual_kernel.put_prestrain(prestrain.tet as usize, Some(prestrain));
        }
    }
}
