//! Which element of a body is strained the most: the one with the least volume ratio, and the one that is pressed the
//! furthest beyond where its law bears more with more compression.
use super::linear_tet::VolumeRatio;
use crate::{
    linalg::tensor::{cofactor, largest_eigenvalue},
    material::Law,
};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// An element that is pressed beyond what its law is made for ([`Law::weakens_below`]).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Pressed {
    /// Its least principal stretch: deformed over rest length, 1 at rest.
    pub stretch: f64,
    /// Its law.
    pub law: Law,
    /// Where it is: a tet's number, of a hybrid body a coarse tet's.
    pub tet: usize,
}

/// The most strained elements of a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strained {
    /// The smallest `J = det F`.
    pub volume: VolumeRatio,
    /// Of the elements that are pressed beyond what their law is made for, the one with the least principal stretch.
    pub pressed: Option<Pressed>,
}

impl Strained {
    /// Returns what there is before any element was looked at.
    pub(crate) fn nothing() -> Self {
        Self { volume: VolumeRatio { ratio: f64::INFINITY, tet: 0 }, pressed: None }
    }

    /// Looks at an element with this deformation gradient and law.
    pub(crate) fn look_at(&mut self, f: &DMat3, law: Law, tet: usize) {
        let ratio = f.determinant();
        if ratio < self.volume.ratio {
            self.volume = VolumeRatio { ratio, tet };
        }
        let Some(limit) = law.weakens_below() else { return };
        let least = self.pressed.map_or(limit, |pressed| pressed.stretch);
        if let Some(stretch) = stretch_below(f, least) {
            self.pressed = Some(Pressed { stretch, law, tet });
        }
    }
}

/// Returns the least principal stretch, where it is below a limit: `C − s² I` is not positive definite then
/// (`C = FᵀF`). Eigenvalues are computed only for elements of which this is so.
fn stretch_below(f: &DMat3, limit: f64) -> Option<f64> {
    let c = f.transpose() * *f;
    let shifted = c - DMat3::from_diagonal(DVec3::splat(limit * limit));
    // Sylvester: all leading minors are positive.
    let minor = cofactor(&shifted).z_axis.z;
    if shifted.x_axis.x > 0.0 && minor > 0.0 && shifted.determinant() > 0.0 {
        return None;
    }
    let stretch = (-largest_eigenvalue(&(c * -1.0))).max(0.0).sqrt();
    (stretch < limit).then_some(stretch)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    /// `F = R₁ diag(s₁, s₂, s₃) R₂` has the principal stretches `|s_i|`.
    #[test]
    fn the_least_principal_stretch_is_found_whatever_turns_it() {
        let turn = |angle: f64| DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(0.48, 0.6, 0.64), angle));
        for stretches in [[0.5, 1.0, 1.3], [1.2, 0.4, 1.1], [1.0, 1.0, 0.57], [-0.3, 1.5, 0.9]] {
            for (first, second) in [(0.0, 0.0), (0.7, -1.9), (2.1, 0.4)] {
                let f = turn(first) * DMat3::from_diagonal(DVec3::from(stretches)) * turn(second);
                let least = stretches.iter().map(|s: &f64| s.abs()).fold(f64::INFINITY, f64::min);
                let found = stretch_below(&f, 0.577).unwrap();
                assert!((found - least).abs() < 1e-7, "{stretches:?}: {found}");
                assert_eq!(stretch_below(&f, least * (1.0 - 1e-6)), None, "{stretches:?}");
            }
        }
        assert_eq!(stretch_below(&DMat3::IDENTITY, 0.577), None);
    }

    #[test]
    fn only_elements_of_a_law_that_weakens_are_told() {
        let (pressed, inverted) = ([0.5, 1.2, 1.2], [-0.1, 1.0, 1.0]);
        let mut strained = Strained::nothing();
        for (tet, (law, stretches)) in
            [(Law::StableNeoHookean, inverted), (Law::StVenantKirchhoff, pressed), (Law::StVenantKirchhoff, [1.0; 3])]
                .into_iter()
                .enumerate()
        {
            strained.look_at(&DMat3::from_diagonal(DVec3::from(stretches)), law, tet);
        }
        assert_eq!((strained.volume.tet, strained.volume.ratio), (0, -0.1));
        let pressed = strained.pressed.unwrap();
        assert_eq!((pressed.tet, pressed.law), (1, Law::StVenantKirchhoff));
        assert!((pressed.stretch - 0.5).abs() < 1e-7);
    }
}
