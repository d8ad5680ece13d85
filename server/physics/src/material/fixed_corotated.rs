//! Fixed corotated elasticity (Stomakhin et al. 2012).
use super::Lame;
use glam::DMat3;

/// `Ψ` (J/m³).
pub fn energy_density(_lame: Lame, _f: &DMat3) -> f64 {
    0.0
}

/// `P` (Pa).
pub fn piola(_lame: Lame, _f: &DMat3) -> DMat3 {
    DMat3::ZERO
}

/// `δP` (Pa).
pub fn piola_differential(_lame: Lame, _f: &DMat3, _df: &DMat3) -> DMat3 {
    DMat3::ZERO
}
