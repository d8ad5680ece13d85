//! `[body.seed]`: the papers' hybrid.
use schemars::JsonSchema;
use serde::Deserialize;

/// Makes the body the hybrid of Mero and Susín (2005, 2006): its tets are the core of that, in the papers' own scheme.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SeedTable {
    /// Longest step (s), the papers' Δt; the tick's period by default. A tick is taken in equal steps that are no longer.
    pub(crate) step_s: Option<f64>,
    /// False: without the three repairs that can be left out. It then flutters, and may burst.
    #[serde(default = "default_repairs")]
    pub(crate) repairs: bool,
    /// Particles around the core, and the surface outside them; without it the core's boundary is touched.
    pub(crate) layer: Option<SeedLayerTable>,
}

fn default_repairs() -> bool {
    true
}

/// The layer of particles around the core, up to an ellipsoid about the origin.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SeedLayerTable {
    /// Semi-axes (m) of the outer surface. Like the core's, it must be seen whole from the mass centre.
    pub(crate) outer_semi_axes_m: [f64; 3],
    /// Wanted number of its triangles, 20 or more. What is awake are the particles under the touched one and its neighbours.
    pub(crate) triangles: u32,
    /// Wanted number of particles.
    pub(crate) particles: u32,
}
