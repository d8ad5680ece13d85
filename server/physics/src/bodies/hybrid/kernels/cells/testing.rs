//! Cells and their oracle, for both kernels.
use crate::{
    bodies::hybrid::{
        cell::RestCell,
        testing::{Random, ball_cells, tissue},
    },
    lanes::InstructionSet,
    material::Material,
    settings::Precision,
};
use glam::DVec3;

/// Cells, and how their points moved, for a kernel to compute.
pub(crate) struct Question<'a> {
    pub(crate) cells: &'a [([u32; 8], RestCell)],
    pub(crate) spacing_m: f64,
    pub(crate) fraction: f64,
    pub(crate) u: &'a [DVec3],
    pub(crate) v: &'a [DVec3],
    pub(crate) material: Material,
    pub(crate) precision: Precision,
    pub(crate) set: InstructionSet,
}

/// The forces on all points that a kernel found, and the power of viscous stress.
#[derive(Debug, PartialEq)]
pub(crate) struct Answer {
    pub(crate) forces_n: Vec<DVec3>,
    pub(crate) power_w: f64,
}

/// Asserts that a kernel finds the forces of the plain code, whatever the law and the precision, and the same bits with
/// every instruction set. The cells are those of a ball, all or only the full ones; the largest displacements turn some
/// inside out.
pub(crate) fn agrees_with_oracle(only_full: bool, kernel: impl Fn(&Question<'_>) -> Answer) {
    let (mut cells, rest) = ball_cells();
    let whole = cells.iter().map(|(_, c)| c.volume_m3).fold(0.0, f64::max) * (1.0 - 1e-12);
    cells.retain(|(_, cell)| !only_full || cell.volume_m3 > whole);
    let mut random = Random(21);
    for material in tissue() {
        for size in [1e-5, 0.1e-3, 1.5e-3] {
            let u: Vec<DVec3> = rest.iter().map(|_| random.vector() * size).collect();
            let v: Vec<DVec3> = rest.iter().map(|_| random.vector() * 0.1).collect();
            let mut expected = vec![DVec3::ZERO; rest.len()];
            let mut expected_w = 0.0;
            for (points, cell) in &cells {
                let y = points.map(|p| rest[p as usize] + u[p as usize]);
                let (forces, power) = cell.forces_n(&material, &y, &points.map(|p| v[p as usize]));
                points.iter().zip(forces).for_each(|(&p, f)| expected[p as usize] += f);
                expected_w += power;
            }
            let largest = expected.iter().map(|f| f.length()).fold(0.0, f64::max);
            for (precision, bound) in [(Precision::Double, 1e-11), (Precision::Single, 2e-5)] {
                let (spacing_m, fraction) = (1.1e-3, 0.98);
                let (cells, u, v) = (&cells[..], &u[..], &v[..]);
                let run = |set| kernel(&Question { cells, spacing_m, fraction, u, v, material, precision, set });
                let baseline = run(InstructionSet::Baseline);
                let pairs = baseline.forces_n.iter().zip(&expected);
                let worst = pairs.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
                let law = material.law;
                assert!(worst < bound * largest, "{law:?} {precision:?} {size}: {worst:e} of {largest:e}");
                assert!((baseline.power_w / expected_w - 1.0).abs() < 10.0 * bound);
                for set in InstructionSet::available() {
                    assert_eq!(run(set), baseline, "{set:?}");
                }
            }
        }
    }
}
