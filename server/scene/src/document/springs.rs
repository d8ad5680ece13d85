//! `[body.springs]`: a mass-spring surface, refined where it is touched.
use schemars::JsonSchema;
use serde::Deserialize;

/// Makes the body's surface a mass-spring surface (haptic subdivision): masses at its vertices, springs along its edges
/// and to where they are at rest. Give `mesh_n_per_m` with `anchor_n_per_m`, or `young_modulus_pa` and `thickness_m`
/// with `foundation_pa_per_m`; and one of `area_density_kg_per_m2` and `vertex_mass_kg`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SpringsTable {
    /// The part of the body's surface that it is, for example "outer"; all of it by default.
    pub(crate) part: Option<String>,
    /// Stiffness K_m (N/m) of the springs along edges.
    pub(crate) mesh_n_per_m: Option<f64>,
    /// Stiffness K_h (N/m) of the anchor spring that pulls each vertex to its rest position.
    #[serde(alias = "home_n_per_m")]
    pub(crate) anchor_n_per_m: Option<f64>,
    /// Young's modulus (Pa) of a skin that the springs stand for: K_m = (√3/2) E t. Poisson's ratio is then 1/3,
    /// whatever the material's.
    pub(crate) young_modulus_pa: Option<f64>,
    /// Thickness t (m) of that skin.
    pub(crate) thickness_m: Option<f64>,
    /// What lies behind it: pressure over displacement (Pa/m). K_h is that times the mean area of a vertex.
    pub(crate) foundation_pa_per_m: Option<f64>,
    /// Mass per area (kg/m²); each vertex has that of its part of the surface.
    pub(crate) area_density_kg_per_m2: Option<f64>,
    /// Mass (kg) of each vertex.
    pub(crate) vertex_mass_kg: Option<f64>,
    /// Damping K_d (N s/m) of a vertex of mean mass; others have it in proportion to theirs. In place of
    /// `numerics.mass_damping_per_s`.
    pub(crate) damping_n_s_per_m: Option<f64>,
    /// Anchor springs that stiffen: their force is K_h (u + c u³), with this c (1/m²).
    #[serde(alias = "home_cubic_per_m2")]
    pub(crate) anchor_cubic_per_m2: Option<f64>,
    /// Layers behind the surface that are compressed one after the other, the first one as stiff as K_h. The last one's
    /// thickness means nothing.
    #[serde(alias = "home_layer")]
    pub(crate) anchor_layer: Option<Vec<AnchorLayerTable>>,
    /// Most vertices awake at once: those about tools. By default all, but no more than 20000 of a surface that nothing
    /// loads.
    pub(crate) most_awake: Option<u32>,
    /// Refines it where it is touched; without, it stays as it is.
    pub(crate) refine: Option<RefineTable>,
}

/// A layer under the surface.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct AnchorLayerTable {
    /// How far (m) it can be compressed.
    pub(crate) thickness_m: f64,
    /// Its stiffness over the first layer's.
    pub(crate) stiffness_ratio: f64,
}

/// How the surface is refined. The springs there are told by exactly one of `constants`, `table_file` and
/// `mesh_n_per_m` with `anchor_n_per_m`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RefineTable {
    /// Rings of triangles around the vertex that is touched, 1 to 16.
    pub(crate) rings: u32,
    /// As many rings as the dent needs, `rings` at most: those under the touched part of the tool, and one for each
    /// edge's length of its depth. Not with `table_file`.
    #[serde(default)]
    pub(crate) follows_dent: bool,
    /// How long (s) a triangle takes from coarse to refined beneath a tool that stands still.
    #[serde(default = "default_blend_s", alias = "fade_s")]
    pub(crate) blend_s: f64,
    /// A rule for the constants of the refined springs.
    pub(crate) constants: Option<ConstantsName>,
    /// A file that `palpated calibrate` has made: constants over displacement, for a tool that touches one vertex.
    pub(crate) table_file: Option<String>,
    /// Stiffness K'_m (N/m) of the refined springs along edges.
    pub(crate) mesh_n_per_m: Option<f64>,
    /// Stiffness K'_h (N/m) of the refined vertices' anchor springs.
    #[serde(alias = "home_n_per_m")]
    pub(crate) anchor_n_per_m: Option<f64>,
    /// Most triangles refined at once, or on their way: as many as any one tool needs, at least (6 times the rings
    /// squared, and for capsules 4 times the rings for each edge's length along them); by default enough for every tool
    /// to be followed.
    pub(crate) most_triangles: Option<u32>,
}

fn default_blend_s() -> f64 {
    0.1
}

/// A rule for the constants of refined springs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum ConstantsName {
    /// As coarse: too stiff by the number of vertices that there are more.
    Unchanged,
    /// The same sheet on the same foundation, per area: K'_m = K_m, K'_h = K_h/4. Right for tools that touch many
    /// vertices.
    Area,
}
