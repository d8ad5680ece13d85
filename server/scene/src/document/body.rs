//! `[body]`: where the tetrahedra come from.
use super::{seed::SeedTable, springs::SpringsTable};
use schemars::JsonSchema;
use serde::Deserialize;

/// Exactly one of the sub-tables `box`, `sphere_shell`, `ellipsoid_shell`, `ventricle`, `mesh`, `surfaces` and `surface`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct BodyTable {
    /// A box from the origin. Parts: x_min, x_max, y_min, y_max, z_min, z_max.
    #[serde(rename = "box")]
    pub(crate) block: Option<BoxTable>,
    /// A shell between two spheres about the origin. Parts: inner, outer.
    pub(crate) sphere_shell: Option<SphereShellTable>,
    /// A shell between two ellipsoids about the origin. Parts: inner, outer.
    pub(crate) ellipsoid_shell: Option<EllipsoidShellTable>,
    /// A truncated-ellipsoid ventricle about the z axis, apex at negative z. Parts: inner, outer, base.
    pub(crate) ventricle: Option<VentricleTable>,
    /// A tetrahedral mesh file. Parts: its physical groups.
    pub(crate) mesh: Option<MeshTable>,
    /// The volume between two surface files. Parts: inner, outer, base.
    pub(crate) surfaces: Option<SurfacesTable>,
    /// One surface file (STL, OBJ, PLY), open or closed, for `springs`. It has no parts.
    pub(crate) surface: Option<SurfaceTable>,
    /// Makes its surface, or a part of that, a mass-spring surface; there are no tets then.
    pub(crate) springs: Option<SpringsTable>,
    /// Particles on a lattice within it, of which those near tools are awake: it becomes a hybrid body.
    pub(crate) particles: Option<ParticlesTable>,
    /// Makes it the papers' hybrid, whose core its tets are.
    pub(crate) seed: Option<SeedTable>,
    /// What the elastic energy of a body of tets is taken of; "smoothed" by default.
    pub(crate) elements: Option<ElementsName>,
    /// Whether walls of the body press each other where they meet; by default where its skin faces itself at rest, as around a cavity,
    /// with leapfrog. Surfaces of springs and the papers' hybrid cannot have it.
    pub(crate) self_contact: Option<bool>,
    /// Moves the body (m, world); zero by default.
    #[serde(default)]
    pub(crate) offset_m: [f64; 3],
}

/// What the elastic energy of a body of tets is taken of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ElementsName {
    /// The strain of every tet: too stiff where bodies bend or hardly change their volume.
    Linear,
    /// Mostly the mean strain around every node.
    Smoothed,
}

/// The particles of a hybrid body, whose tets are then the coarse level.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ParticlesTable {
    /// Spacing of the lattice (m), larger than 0.
    pub(crate) spacing_m: f64,
    /// The longest edge (m) of the skin's triangles; by default, and at most, the spacing.
    pub(crate) skin_edge_m: Option<f64>,
    /// How thick (m) the layer of cells of this spacing is at the surface, at least one cell; deeper down they are twice as large. By default all are of one size.
    pub(crate) fine_depth_m: Option<f64>,
    /// Whether tools feel a mean of the particles around them, over a spacing each way, in place of single ones; false by default.
    #[serde(default)]
    pub(crate) smooth_skin: bool,
    /// Most particles awake at once, 1 to 20000.
    #[serde(default = "default_most_active")]
    pub(crate) most_active: u32,
    /// Particles within this distance (m, at rest) of where a tool touches the skin are awake; by default the radius of the half ball
    /// that holds `most_active` of them.
    pub(crate) reach_m: Option<f64>,
    /// Materials whose Poisson's ratio is larger, up to 0.5, are taken to have this one, and to be as stiff beneath a tool; waves of volume
    /// are slower then, and a tick takes fewer substeps. 0.5 leaves all as they are.
    #[serde(default = "default_most_poisson_ratio")]
    pub(crate) most_poisson_ratio: f64,
}

fn default_most_poisson_ratio() -> f64 {
    0.488
}

fn default_most_active() -> u32 {
    600
}

/// A box from the origin, six tets per cell.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct BoxTable {
    /// Edge lengths (m).
    pub(crate) size_m: [f64; 3],
    /// Cells along x, y and z.
    pub(crate) cells: [u32; 3],
}

/// A shell between two spheres about the origin.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SphereShellTable {
    /// Inner radius (m).
    pub(crate) inner_radius_m: f64,
    /// Outer radius (m).
    pub(crate) outer_radius_m: f64,
    /// Wanted number of tets, met within 10 %.
    pub(crate) target_tets: u32,
}

/// A shell between two ellipsoids about the origin.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct EllipsoidShellTable {
    /// Inner semi-axes (m).
    pub(crate) inner_semi_axes_m: [f64; 3],
    /// Outer semi-axes (m).
    pub(crate) outer_semi_axes_m: [f64; 3],
    /// Wanted number of tets, met within 10 %.
    pub(crate) target_tets: u32,
}

/// A truncated-ellipsoid ventricle. The defaults are those of the cardiac mechanics benchmark: outer 10 and 20 mm,
/// inner 7 and 17 mm, cut at z = 5 mm.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct VentricleTable {
    /// Outer semi-axes (m): short, long.
    #[serde(default = "default_outer_m")]
    pub(crate) outer_semi_axes_m: [f64; 2],
    /// Inner semi-axes (m): short, long.
    #[serde(default = "default_inner_m")]
    pub(crate) inner_semi_axes_m: [f64; 2],
    /// Height of the cut (m).
    #[serde(default = "default_cut_m")]
    pub(crate) cut_z_m: f64,
    /// Wanted number of tets, met within 10 %.
    pub(crate) target_tets: u32,
}

fn default_outer_m() -> [f64; 2] {
    [10e-3, 20e-3]
}

fn default_inner_m() -> [f64; 2] {
    [7e-3, 17e-3]
}

fn default_cut_m() -> f64 {
    5e-3
}

/// Unit of a file's coordinates.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
pub(crate) enum LengthUnit {
    /// Metres.
    #[serde(rename = "m")]
    Metre,
    /// Centimetres.
    #[serde(rename = "cm")]
    Centimetre,
    /// Millimetres.
    #[serde(rename = "mm")]
    Millimetre,
    /// Micrometres.
    #[serde(rename = "um")]
    Micrometre,
}

impl LengthUnit {
    /// The likeliest first.
    pub(crate) const BY_USE: [Self; 4] = [Self::Millimetre, Self::Metre, Self::Centimetre, Self::Micrometre];

    /// As it is written.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Metre => "m",
            Self::Centimetre => "cm",
            Self::Millimetre => "mm",
            Self::Micrometre => "um",
        }
    }

    /// Metres per unit.
    pub(crate) fn in_m(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Centimetre => 1e-2,
            Self::Millimetre => 1e-3,
            Self::Micrometre => 1e-6,
        }
    }
}

/// A tetrahedral mesh file: Gmsh MSH, VTK, VTU, TetGen or MEDIT.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeshTable {
    /// Path, relative to the scene file.
    pub(crate) file: String,
    /// Unit of its coordinates.
    pub(crate) unit: LengthUnit,
}

/// A surface file: STL, OBJ or PLY.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SurfaceTable {
    /// Path, relative to the scene file.
    pub(crate) file: String,
    /// Unit of its coordinates.
    pub(crate) unit: LengthUnit,
}

/// Two surface files (STL, OBJ, PLY) whose volume between is filled with tets.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SurfacesTable {
    /// Inner surface, relative to the scene file.
    pub(crate) inner_file: String,
    /// Outer surface, relative to the scene file.
    pub(crate) outer_file: String,
    /// Unit of their coordinates.
    pub(crate) unit: LengthUnit,
    /// Unit of the inner surface alone, where it differs.
    pub(crate) inner_unit: Option<LengthUnit>,
    /// Wanted number of tets.
    pub(crate) target_tets: u32,
    /// Layers of cells through the wall; chosen from the count by default.
    pub(crate) layers: Option<u32>,
}
