//! The kernels' layout of a patch's cells.
use super::{FadingCell, RunningPatch};
use crate::{
    hybrid::{body::Hybrid, fade::Fading},
    simd::CellRow,
};

/// How a cell is laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Full,
    Cut,
    Fading,
}

impl RunningPatch {
    /// Rows of full cells, blocks of cut ones and blocks of those that fade, material by material.
    pub(in crate::hybrid) fn lay_out(&mut self, hybrid: &Hybrid, fading: &Fading) {
        let partition = &hybrid.partition;
        self.rows.clear();
        self.cut.clear();
        self.fading_cells.clear();
        let point_of = &self.point_of;
        let points_of = |cell: usize| partition.corners(cell).map(|particle| point_of[particle as usize]);
        for material in 0..hybrid.materials.len() as u16 {
            let kind_of = |cell: usize| match fading.of_cell(cell as u32) {
                Some(_) => Kind::Fading,
                None if partition.is_cut(cell) => Kind::Cut,
                None => Kind::Full,
            };
            let of_kind = |kind: Kind| {
                self.cells.iter().map(|&cell| cell as usize).filter(move |&cell| {
                    let tet = partition.cells()[cell].tet;
                    hybrid.of_tet[tet as usize] == material && kind_of(cell) == kind
                })
            };
            let first_row = self.rows.len();
            for cell in of_kind(Kind::Full) {
                let points = points_of(cell);
                let points = [points[0], points[2], points[4], points[6]];
                match self.rows[first_row..].last_mut() {
                    Some(row) if row.points.map(|point| point + row.cells) == points => row.cells += 1,
                    _ => self.rows.push(CellRow { points, cells: 1, material }),
                }
            }
            for kind in [Kind::Cut, Kind::Fading] {
                let count = of_kind(kind).count();
                if count == 0 {
                    continue;
                }
                let run = self.cut.runs();
                self.cut.start(material, count, kind == Kind::Fading);
                for (number, cell) in of_kind(kind).enumerate() {
                    let (rest, points) = (hybrid.awake_cell(cell), points_of(cell));
                    self.cut.put(number, points, &rest);
                    if kind == Kind::Fading {
                        self.fading_cells.push(FadingCell { cell: cell as u32, run, number, points, rest });
                    }
                }
            }
        }
        self.fading_cells.sort_unstable_by_key(|fading| fading.cell);
        self.put_fades(fading);
    }

    /// Whether the cells that fade are those that are laid out so.
    pub(in crate::hybrid) fn is_laid_out_for(&self, fading: &Fading) -> bool {
        self.fading_cells.iter().map(|own| own.cell).eq(fading.cells.iter().map(|fade| fade.cell))
    }

    /// Gives the kernels how far everything has faded. The cells are those of [`Self::lay_out`].
    pub(in crate::hybrid) fn put_fades(&mut self, fading: &Fading) {
        for (own, fade) in self.fading_cells.iter().zip(&fading.cells) {
            self.cut.put_fade(own.run, own.number, fade);
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
