//! Prestrain of cells (`hybrid::prestrain`), as both kernels of cells keep it.
use super::cell_stress::prestrained_stress;
use crate::{
    bodies::hybrid::prestrain::CellPrestrain,
    lanes::real::{Real, Scalar, Vector},
    material::{
        ConstitutiveLaw, Material,
        constants::Constants,
        lane_matrix::{M3, plus},
    },
};

/// Number of entries of a cell's prestrain: `A` of its shape and `A` of its volume, row by row, and `a`.
pub(crate) const ENTRIES: usize = 19;

/// Returns the entries of a cell's prestrain, zeros for `None`.
pub(crate) fn entries(prestrain: Option<&CellPrestrain>) -> [f64; ENTRIES] {
    let mut entries = [0.0; ENTRIES];
    if let Some(prestrain) = prestrain {
        for row in 0..3 {
            for column in 0..3 {
                entries[3 * row + column] = prestrain.shape.col(column)[row];
                entries[9 + 3 * row + column] = prestrain.volume.col(column)[row];
            }
        }
        entries[18] = prestrain.modes;
    }
    entries
}

/// Constants of a material: of the whole, and of its parts for shape and volume.
#[derive(Debug, Clone)]
pub(crate) struct Split<T> {
    pub(crate) material: Material,
    pub(crate) whole: Constants<T>,
    pub(crate) shape: Constants<T>,
    pub(crate) volume: Constants<T>,
}

impl<T: Scalar> Split<T> {
    pub(crate) fn of(material: &Material) -> Self {
        let (shape, volume) = material.shape_and_volume();
        let [whole, shape, volume] = [material, &shape, &volume].map(Constants::of);
        Self { material: *material, whole, shape, volume }
    }
}

/// What a pass over cells or tets finds beside forces.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Found {
    /// Power (W) that viscous stress takes.
    pub viscous_w: f64,
    /// `s ∂U/∂s` (J) of the prestrain (`hybrid::prestrain`).
    pub prestrain_j: f64,
}

impl std::ops::AddAssign for Found {
    fn add_assign(&mut self, other: Self) {
        self.viscous_w += other.viscous_w;
        self.prestrain_j += other.prestrain_j;
    }
}

/// Returns elastic and viscous stress (Pa) of a cell with prestrains `a` of shape and volume, the power density (W/m³)
/// of the latter stress, and `s ∂Ψ/∂s` (J/m³).
#[inline(always)]
pub(crate) fn prestrained_cell_stress<V: Vector<Scalar = T>, T: Scalar, L: ConstitutiveLaw, const VISCOUS: bool>(
    split: &Split<T>,
    a: &[M3<V>; 2],
    h: &M3<V>,
    h_dot: &M3<V>,
) -> (M3<V>, V, V) {
    let (shape, density, of_shape) = prestrained_stress::<V, T, L, VISCOUS>(&split.shape, &a[0], h, h_dot);
    let (volume, _, of_volume) = prestrained_stress::<V, T, L, false>(&split.volume, &a[1], h, h);
    (plus(&shape, &volume), density, of_shape + of_volume)
}

/// Returns `m s`.
#[inline(always)]
pub(crate) fn scaled<V: Vector>(m: &M3<V>, s: V) -> M3<V> {
    let mut scaled = *m;
    for row in &mut scaled {
        for entry in row {
            *entry = *entry * s;
        }
    }
    scaled
}

/// Adds lanes to a sum one after the other, so that the result does not depend on the width of the vectors.
#[inline(always)]
pub(crate) fn add_lanes<V: Vector>(lanes: V, sum: &mut f64) {
    let mut stored = [V::Scalar::of(0.0); 16];
    lanes.store(&mut stored);
    for &lane in &stored[..V::WIDTH] {
        *sum += lane.into();
    }
}
