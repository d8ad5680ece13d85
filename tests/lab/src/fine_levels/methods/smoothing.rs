//! Nodal smoothing of tets nested in the lattice's cells, with stabilisation.
//!
//! Every cell is cut in six tets along its diagonal, with a sixth of what the body has of the cell each. A particle n answers for a quarter of the tets around it, with their
//! mean gradient (Dohrmann et al. 2000); what that hides of the tets' own gradients, a part γ of the stiffness in shear resists (Puso & Solberg 2006):
//! ```text
//! V_n = Σ_{t∋n} V_t/4          F_n = (1/V_n) Σ_{t∋n} (V_t/4) F_t
//! U = Σ_n V_n [Ψ(F_n) − γΨ̃(F_n)] + γ Σ_n Σ_{t∋n} (V_t/4) Ψ̃(F_t)          Ψ̃: λ̃ = min(λ, µ)
//! ```
//! The sums run over the particles n that are awake, so that volume is counted once in either law: a tet has a quarter for each of its corners that is. With γ = 0
//! fields that alternate from particle to particle cost nothing.
use super::points::{Handed, Points, Role, Row, Term};
use glam::DVec3;
use palpate_physics::bodies::hybrid::partition::Partition;
use std::collections::{BTreeMap, BTreeSet};

/// Corners of a cell's tets: ways along its edges from its first corner to its last.
const TETS: [[usize; 4]; 6] = [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]];

/// `h b_t` of the corners of one: along a way over axes a, b, c the shape functions are `1 − x_a, x_a − x_b, x_b − x_c, x_c`.
fn gradients(tet: [usize; 4]) -> [DVec3; 4] {
    let [a, b, c] = [1, 2, 3].map(|step| match tet[step] - tet[step - 1] {
        1 => DVec3::X,
        2 => DVec3::Y,
        _ => DVec3::Z,
    });
    [-a, a - b, b - c, c]
}

/// The particles whose tets touch an active one, and those tets.
pub(super) fn points(partition: &Partition, gamma: f64, active: &BTreeSet<u32>) -> Points {
    let cells = active.iter().flat_map(|&particle| partition.cells_at(particle));
    let near: BTreeSet<u32> = cells.flat_map(|cell| partition.corners(cell)).collect();
    let (mut rows, mut handed) = (Vec::new(), Vec::new());
    let mut quarters: BTreeMap<(usize, usize), u32> = BTreeMap::new();
    for node in near {
        let tets = tets_at(partition, node);
        let is_active = |&(cell, tet): &(usize, usize)| {
            let corners = partition.corners(cell);
            TETS[tet].iter().any(|&corner| active.contains(&corners[corner]))
        };
        if tets.iter().any(is_active) {
            rows.push(at_node(partition, gamma, node, &tets));
            for tet in tets {
                *quarters.entry(tet).or_default() += 1;
                handed.push(Handed { cell: tet.0, part: 1.0 / 24.0 });
            }
        }
    }
    if gamma > 0.0 {
        rows.extend(quarters.into_iter().map(|((cell, tet), count)| in_tet(partition, gamma, cell, tet, count)));
    }
    Points { rows, handed }
}

/// Cells and which of their tets.
fn tets_at(partition: &Partition, node: u32) -> Vec<(usize, usize)> {
    let of_cell = |cell: usize| {
        let corners = partition.corners(cell);
        let has_node = move |tet: &usize| TETS[*tet].iter().any(|&corner| corners[corner] == node);
        (0..TETS.len()).filter(has_node).map(move |tet| (cell, tet))
    };
    partition.cells_at(node).flat_map(of_cell).collect()
}

fn at_node(partition: &Partition, gamma: f64, node: u32, tets: &[(usize, usize)]) -> Row {
    let spacing_m = partition.sites().spacing_m();
    let mut volume_m3 = 0.0;
    let mut sums: BTreeMap<u32, DVec3> = BTreeMap::new();
    for &(cell, tet) in tets {
        let quarter_m3 = partition.moments(cell).volume_m3 / 24.0;
        volume_m3 += quarter_m3;
        let corners = partition.corners(cell);
        for (corner, gradient) in TETS[tet].into_iter().zip(gradients(TETS[tet])) {
            *sums.entry(corners[corner]).or_default() += gradient * (quarter_m3 / spacing_m);
        }
    }
    let terms = sums.into_iter().map(|(particle, sum)| (particle, sum / volume_m3));
    row(partition, Role::Smoothed { gamma }, partition.anchor(node).tet, node, volume_m3, terms)
}

fn in_tet(partition: &Partition, gamma: f64, cell: usize, tet: usize, quarters: u32) -> Row {
    let corners = partition.corners(cell);
    let spacing_m = partition.sites().spacing_m();
    let terms = TETS[tet].into_iter().zip(gradients(TETS[tet])).map(|(corner, g)| (corners[corner], g / spacing_m));
    let volume_m3 = f64::from(quarters) * partition.moments(cell).volume_m3 / 24.0;
    row(partition, Role::Stabilising { gamma }, partition.cells()[cell].tet, corners[0], volume_m3, terms)
}

fn row(
    partition: &Partition,
    role: Role,
    tet: u32,
    origin: u32,
    volume_m3: f64,
    gradients_per_m: impl Iterator<Item = (u32, DVec3)>,
) -> Row {
    let origin_m = partition.particle_m(origin);
    let others = gradients_per_m.filter(|(particle, gradient)| *particle != origin && *gradient != DVec3::ZERO);
    let term = |(particle, gradient_per_m)| Term {
        particle,
        gradient_per_m,
        span_m: partition.particle_m(particle) - origin_m,
        control_m: 0.0,
    };
    Row { volume_m3, origin, tet, role, terms: others.map(term).collect() }
}
