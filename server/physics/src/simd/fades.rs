//! What fades in cells (`hybrid::fade`), as both kernels of cells keep it.
use super::{
    cell_stress::faded_stress,
    laws::{Constants, LaneLaw, M3, plus},
    real::{Scalar, Vector},
};
use crate::{
    hybrid::{fade::CellFade, share},
    material::Material,
};

/// Numbers of a cell: `A` of its shape and `A` of its volume, row by row, and `1 − a`.
pub(super) const ENTRIES: usize = 19;

/// Of a cell; `None`: nothing fades.
pub(super) fn entries(fade: Option<&CellFade>) -> [f64; ENTRIES] {
    let mut entries = [0.0; ENTRIES];
    entries[18] = 1.0;
    if let Some(fade) = fade {
        for row in 0..3 {
            for column in 0..3 {
                entries[3 * row + column] = fade.shape.col(column)[row];
                entries[9 + 3 * row + column] = fade.volume.col(column)[row];
            }
        }
        entries[18] = 1.0 - fade.modes;
    }
    entries
}

/// Constants of a material: whole, of its shape and of its volume.
#[derive(Debug, Clone)]
pub(super) struct Split<T> {
    pub(super) material: Material,
    pub(super) whole: Constants<T>,
    pub(super) shape: Constants<T>,
    pub(super) volume: Constants<T>,
}

impl<T: Scalar> Split<T> {
    pub(super) fn of(material: &Material) -> Self {
        let (shape, volume) = share::split(material);
        let [whole, shape, volume] = [material, &shape, &volume].map(Constants::of);
        Self { material: *material, whole, shape, volume }
    }
}

/// Elastic and viscous stress (Pa) where shape and volume fade by `a`, and the power density (W/m³) of the latter.
#[inline(always)]
pub(super) fn fading_stress<V: Vector<Scalar = T>, T: Scalar, L: LaneLaw, const VISCOUS: bool>(
    split: &Split<T>,
    a: &[M3<V>; 2],
    h: &M3<V>,
    h_dot: &M3<V>,
) -> (M3<V>, V) {
    let (shape, density) = faded_stress::<V, T, L, VISCOUS>((&split.shape, &a[0]), h, h_dot);
    let volume = faded_stress::<V, T, L, false>((&split.volume, &a[1]), h, h).0;
    (plus(&shape, &volume), density)
}
