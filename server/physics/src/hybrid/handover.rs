//! From one set of active particles to another: who answers for which volume changes, energy and force do not (`fade`).
use super::{
    body::Hybrid,
    cell::{MODE_WEIGHTS, RestCell},
    composite::PARTS,
    fade::{CellFade, Fading, ShareFade, change},
    partition::{Cell, Partition},
    patch::KEPT,
    running::RunningPatch,
    share::Share,
};
use glam::{DMat3, DVec3};

/// Hourglasses smaller than this, over the spacing, are none.
const NO_MODES: f64 = 1e-9;

/// The patch before a switch, strained as it was.
#[derive(Debug, Clone, Default)]
pub(super) struct Before {
    /// Awake cells, ascending.
    cells: Vec<CellBefore>,
    /// Tets that had lost cells.
    tets: Vec<TetBefore>,
    /// What fades after it, and before.
    next: Fading,
    /// Tets that are touched first.
    first_touched: Vec<u32>,
}

#[derive(Debug, Clone, Copy)]
struct CellBefore {
    cell: u32,
    /// Effective gradients.
    shape: DMat3,
    volume: DMat3,
    /// `(1 − a) Σ_k w_k |q_k|²` (m²).
    modes_m2: f64,
}

#[derive(Debug, Clone, Copy)]
struct TetBefore {
    tet: u32,
    parts: [DMat3; PARTS],
    whole: DMat3,
}

impl Before {
    pub(super) fn with_room(cells: usize, tets: usize) -> Self {
        let next = Fading::with_room(cells, tets);
        Self {
            cells: Vec::with_capacity(cells),
            tets: Vec::with_capacity(2 * tets),
            next,
            first_touched: Vec::with_capacity(tets),
        }
    }

    /// Takes how everything awake is strained, and the coarse tets that lost some of it. The patch is displaced.
    pub(super) fn take(&mut self, body: &Hybrid, patch: &RunningPatch, x: &[DVec3], fading: &Fading) {
        self.cells.clear();
        self.cells.extend(patch.cells().iter().map(|&cell| {
            let fade = fading.of_cell(cell).copied().unwrap_or(CellFade::none(cell));
            let (rest, y) = (body.awake_cell(cell as usize), patch.corners_m(body, cell));
            let [shape, volume] = fade.effective(&rest, &y);
            CellBefore { cell, shape, volume, modes_m2: (1.0 - fade.modes) * modes_m2(&rest, &y) }
        }));
        self.tets.clear();
        self.tets.extend(patch.taken_from().iter().map(|&tet| TetBefore::of(tet, patch.share(tet), x, fading)));
        self.tets.sort_unstable_by_key(|before| before.tet);
    }

    /// Takes the tets, too, that lose cells first now or whose nodes have moved from where they were, and works out what fades: `patch` is the next one,
    /// displaced, `fading` what faded before.
    pub(super) fn fade_into(
        &mut self,
        body: &Hybrid,
        patch: &RunningPatch,
        (were_m, x): (&[DVec3], &[DVec3]),
        fading: &mut Fading,
    ) {
        let known = self.tets.len();
        self.first_touched.clear();
        let has_moved = |node: &u32| were_m[*node as usize] != x[*node as usize];
        for (tet, share) in (0..).zip(body.partition.shares()) {
            let is_known = self.tets[..known].binary_search_by_key(&tet, |before| before.tet).is_ok();
            if !is_known && (share.nodes.iter().any(has_moved) || patch.taken_from().contains(&tet)) {
                self.first_touched.push(tet);
                self.tets.push(TetBefore::of(tet, share, were_m, fading));
            }
        }
        self.tets.sort_unstable_by_key(|before| before.tet);
        self.next.clear();
        for &cell in patch.cells() {
            let fade = self.of_cell(body, patch, cell);
            self.next.cells.extend(Some(fade).filter(CellFade::is_something));
        }
        for number in 0..self.tets.len() {
            let fade = self.of_tet(body, patch, x, &self.tets[number]);
            self.next.tets.extend(Some(fade).filter(ShareFade::is_something));
        }
        // Tets that this leaves alone go on.
        for fade in &fading.tets {
            if self.tets.binary_search_by_key(&fade.tet, |before| before.tet).is_err() {
                self.next.tets.push(*fade);
            }
        }
        self.next.tets.sort_unstable_by_key(|fade| fade.tet);
        std::mem::swap(fading, &mut self.next);
    }

    /// Tets that lost cells, before or after, or whose nodes have moved.
    pub(super) fn tets(&self) -> impl Iterator<Item = u32> + '_ {
        self.tets.iter().map(|before| before.tet)
    }

    /// Those of them that had lost none before.
    pub(super) fn first_touched(&self) -> &[u32] {
        &self.first_touched
    }

    /// What faded before.
    pub(super) fn faded(&self) -> &Fading {
        &self.next
    }

    /// A cell that is awake now: strained as it was, or as its part was. The particles around one that was awake may have fallen asleep.
    fn of_cell(&self, body: &Hybrid, patch: &RunningPatch, cell: u32) -> CellFade {
        let own = self.cells.binary_search_by_key(&cell, |before| before.cell);
        let (shape, volume, before_m2) = if let Ok(at) = own {
            (self.cells[at].shape, self.cells[at].volume, self.cells[at].modes_m2)
        } else {
            let Cell { tet, part, .. } = body.partition.cells()[cell as usize];
            let Ok(at) = self.tets.binary_search_by_key(&tet, |before| before.tet) else {
                return CellFade::none(cell);
            };
            (self.tets[at].parts[part as usize], self.tets[at].whole, 0.0)
        };
        let (rest, y) = (body.awake_cell(cell as usize), patch.corners_m(body, cell));
        let f = rest.gradient_of(&y);
        let now_m2 = modes_m2(&rest, &y);
        let least_m2 = (NO_MODES * body.partition.sites().spacing_m()).powi(2);
        let modes = if now_m2 > least_m2 { (1.0 - before_m2 / now_m2).max(0.0) } else { 0.0 };
        CellFade { cell, shape: change(&f, &shape), volume: change(&f, &volume), modes }
    }

    /// What is left of a tet, with what fell asleep in it.
    fn of_tet(&self, body: &Hybrid, patch: &RunningPatch, x: &[DVec3], before: &TetBefore) -> ShareFade {
        let share = patch.share(before.tet);
        let mut kept_m3 = share.volume_m3;
        let (mut parts, mut whole) = ([DMat3::ZERO; PARTS], DMat3::ZERO);
        for &CellBefore { cell, shape, volume, .. } in self.cells.iter().filter(|own| !patch.is_awake(own.cell)) {
            let Cell { tet, part, .. } = body.partition.cells()[cell as usize];
            if tet == before.tet {
                let volume_m3 = handed_m3(&body.partition, cell);
                kept_m3[part as usize] -= volume_m3;
                parts[part as usize] += shape * volume_m3;
                whole += volume * volume_m3;
            }
        }
        for part in 0..PARTS {
            parts[part] += before.parts[part] * kept_m3[part];
            whole += before.whole * kept_m3[part];
        }
        let gradients = share.gradients(x, DMat3::IDENTITY);
        let mut fade = ShareFade::none(before.tet);
        for part in 0..PARTS {
            let volume_m3 = share.volume_m3[part];
            if volume_m3 > 0.0 {
                fade.parts[part] = change(&gradients[part], &(parts[part] * (1.0 / volume_m3)));
            }
        }
        fade.whole = change(&share.mean(&gradients), &(whole * (1.0 / share.total_m3())));
        fade
    }
}

impl TetBefore {
    fn of(tet: u32, share: &Share, x: &[DVec3], fading: &Fading) -> Self {
        let fade = fading.of_tet(tet).copied().unwrap_or(ShareFade::none(tet));
        let (parts, whole) = fade.effective(share, x);
        Self { tet, parts, whole }
    }
}

/// `Σ_k w_k |q_k|²` (m²).
fn modes_m2(rest: &RestCell, y: &[DVec3; 8]) -> f64 {
    rest.amplitudes(y).iter().zip(MODE_WEIGHTS).map(|(q, w)| w * q.length_squared()).sum()
}

/// `(1 − ε) V_c` (m³).
fn handed_m3(partition: &Partition, cell: u32) -> f64 {
    (1.0 - KEPT) * partition.moments(cell as usize).0
}

impl RunningPatch {
    /// Elastic energy (J) of the awake cells and of what is left to some tets, where [`Self::displace`] put them.
    pub(super) fn elastic_j(
        &self,
        body: &Hybrid,
        x: &[DVec3],
        fading: &Fading,
        tets: impl Iterator<Item = u32>,
    ) -> f64 {
        let of_cell = |&cell: &u32| {
            let (rest, y) = (body.awake_cell(cell as usize), self.corners_m(body, cell));
            let material = body.material_of_cell(cell as usize);
            fading.of_cell(cell).map_or_else(|| rest.energy_j(material, &y), |fade| fade.energy_j(&rest, material, &y))
        };
        self.cells().iter().map(of_cell).sum::<f64>() + tets.map(|tet| self.share_j(body, x, fading, tet)).sum::<f64>()
    }

    /// Elastic energy (J) of what is laid out to fade.
    pub(super) fn fading_j(&self, body: &Hybrid, x: &[DVec3], fading: &Fading) -> f64 {
        let cells = self.fading_cells().iter().map(|own| {
            let (material, y) = (body.material_of_cell(own.cell as usize), self.positions_m(own.points));
            let fade = fading.of_cell(own.cell);
            fade.map_or_else(|| own.rest.energy_j(material, &y), |fade| fade.energy_j(&own.rest, material, &y))
        });
        cells.sum::<f64>() + self.fading_tets().iter().map(|&tet| self.share_j(body, x, fading, tet)).sum::<f64>()
    }

    fn share_j(&self, body: &Hybrid, x: &[DVec3], fading: &Fading, tet: u32) -> f64 {
        let (share, material) = (self.share(tet), body.material_of_tet(tet));
        match fading.of_tet(tet) {
            Some(fade) => fade.energy_j(share, material, x),
            None => share.energy_j(material, x),
        }
    }
}
