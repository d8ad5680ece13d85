//! The kernels' layout of a patch's cells.
use super::RunningPatch;
use crate::bodies::hybrid::{
    body::HybridBody,
    kernels::CellRow,
    prestrain::{CellPrestrain, PrestrainDecay},
};

/// Where a cell is laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Slot {
    /// A whole cell: its row, and its number among the cells of all rows.
    Row { row: u32, cell: u32 },
    /// Another: its run, and its number in it.
    Cut { run: u32, number: u32 },
}

impl RunningPatch {
    /// Rows of whole cells, of either size, and blocks of others, material by material; nothing fades in them.
    pub(super) fn lay_out(&mut self, hybrid: &HybridBody) {
        let partition = &hybrid.partition;
        for &cell in &self.fading_cells {
            if let Slot::Row { cell, .. } = self.slots[cell as usize] {
                self.full.put_fade(cell, None);
            }
        }
        self.fading_cells.clear();
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
                    _ => self.rows.push(CellRow { points, cells: 1, material: of_size, first: in_rows, fading: false }),
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

    /// Whether this is what the kernels were told of last.
    pub(in crate::bodies::hybrid) fn knows(&self, fading: &PrestrainDecay) -> bool {
        self.fading_mark == fading.mark()
    }

    /// Tells the kernels what fades.
    pub(in crate::bodies::hybrid) fn put_fades(&mut self, fading: &PrestrainDecay) {
        self.fading_mark = fading.mark();
        let Self { rows, slots, full, cut, fading_cells, cells, .. } = self;
        for row in rows.iter_mut() {
            row.fading = false;
        }
        let mut put = |number: u32, fade: Option<&CellPrestrain>| match slots[number as usize] {
            Slot::Row { row, cell } => {
                rows[row as usize].fading |= fade.is_some();
                full.put_fade(cell, fade);
            }
            Slot::Cut { run, number } => cut.put_fade(run as usize, number as usize, fade),
        };
        for &number in fading_cells.iter() {
            if fading.of_cell(cells[number as usize]).is_none() {
                put(number, None);
            }
        }
        fading_cells.clear();
        let mut number = 0;
        for fade in &fading.cells {
            while cells.get(number).is_some_and(|&cell| cell < fade.cell) {
                number += 1;
            }
            if cells.get(number) == Some(&fade.cell) {
                put(number as u32, Some(fade));
                fading_cells.push(number as u32);
            }
        }
        for &tet in &self.fading_tets {
            if fading.of_tet(tet).is_none() {
                self.share_kernel.put_fade(tet as usize, None);
            }
        }
        self.fading_tets.clear();
        for fade in &fading.tets {
            self.fading_tets.push(fade.tet);
            self.share_kernel.put_fade(fade.tet as usize, Some(fade));
        }
    }
}
