//! `[[region]]`: named parts of the body.
use schemars::JsonSchema;
use serde::Deserialize;

/// A named part of the body. Names that exist without being defined: `whole`, `surface`, the body's parts.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RegionTable {
    /// Name, unique.
    pub(crate) name: String,
    /// What belongs to it.
    pub(crate) select: Selector,
}

/// What belongs to a region. Several keys in one selector must all hold. Nodes are selected by position, surface
/// triangles and tets by their centroid (triangles near a plane: with all three corners).
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Selector {
    /// Another region, or a part of the body.
    pub(crate) region: Option<String>,
    /// A physical group of the mesh file, by name or by number; behind `volume `, `surface ` or `points ` where that
    /// alone means several groups.
    pub(crate) physical_group: Option<String>,
    /// Near a plane.
    pub(crate) plane: Option<PlaneTable>,
    /// On the side of a plane its normal points to.
    pub(crate) half_space: Option<PlaneTable>,
    /// Inside a box.
    #[serde(rename = "box")]
    pub(crate) block: Option<BoxSelector>,
    /// Inside a sphere.
    pub(crate) sphere: Option<SphereSelector>,
    /// What is nearest to a point.
    pub(crate) nearest: Option<NearestSelector>,
    /// In every one of these.
    pub(crate) all_of: Option<Vec<Selector>>,
    /// In at least one of these.
    pub(crate) any_of: Option<Vec<Selector>>,
    /// Not in this.
    pub(crate) not: Option<Box<Selector>>,
}

/// A plane.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlaneTable {
    /// A point of it (m).
    pub(crate) point_m: [f64; 3],
    /// Its normal, of any length.
    pub(crate) normal: [f64; 3],
    /// Largest distance from it (m); a millionth of the body's diagonal by default.
    pub(crate) tolerance_m: Option<f64>,
}

/// An axis-aligned box.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct BoxSelector {
    /// Smallest coordinates (m).
    pub(crate) min_m: [f64; 3],
    /// Largest coordinates (m).
    pub(crate) max_m: [f64; 3],
}

/// A sphere.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SphereSelector {
    /// Centre (m).
    pub(crate) centre_m: [f64; 3],
    /// Radius (m), larger than 0.
    pub(crate) radius_m: f64,
}

/// The nodes, surface triangles and tets nearest to a point.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct NearestSelector {
    /// The point (m).
    pub(crate) point_m: [f64; 3],
    /// How many of each; 1 by default.
    #[serde(default = "one")]
    pub(crate) count: u32,
    /// Only nodes of the surface; false by default.
    #[serde(default)]
    pub(crate) on_surface: bool,
}

fn one() -> u32 {
    1
}
