//! Elastic moduli behind the surface, which contact's foundation is made from.
use crate::{material::Material, mesh::Surface};
use glam::DVec2;

/// Elastic moduli behind a boundary triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceModuli {
    /// `λ + 2µ` (Pa).
    pub p_wave_pa: f64,
    /// `E/(1 − ν²)` (Pa).
    pub indentation_pa: f64,
}

/// Returns `λ + 2µ` and `E/(1 − ν²)` (Pa).
pub(crate) fn moduli_pa(material: &Material) -> DVec2 {
    let lame = material.lame;
    DVec2::new(lame.p_wave_modulus_pa(), lame.young_modulus_pa() / (1.0 - lame.poisson_ratio().powi(2)))
}

/// Returns the moduli behind every triangle: the mean over its corners of [`moduli_pa`] at each node.
pub(crate) fn mean_over_corners(of_node_pa: &[DVec2], surface: &Surface) -> Vec<SurfaceModuli> {
    let mean = |triangle| surface.triangle_nodes(triangle).iter().map(|&n| of_node_pa[n as usize]).sum::<DVec2>() / 3.0;
    (0..surface.triangles.len())
        .map(|triangle| SurfaceModuli { p_wave_pa: mean(triangle).x, indentation_pa: mean(triangle).y })
        .collect()
}
