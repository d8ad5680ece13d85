//! `[body]`: shapes, mesh files and surface pairs become one kind of body with named parts.
use super::{
    Files, exactly_one,
    kinds::{self, BodyKind},
    located::Located,
    parts::{self, Part},
    surface_alone,
};
use crate::{
    document::{
        body::{BodyTable, LengthUnit, MeshTable, SurfacesTable},
        source::{Fault, Where},
    },
    error::Stage,
    files::{self, FileError, SurfaceFile, UnusedNodes},
    fill::{self, FillError, FillOptions, SurfaceInput},
    limits::Limits,
    shapes::{self, Shape, ShapeError},
    skin::FineSurface,
    wording::counted,
};
use glam::DVec3;
use palpate_physics::{
    MeshError, Surface, TetMesh,
    mesh::{Triangulation, TriangulationError},
};

/// A body before regions, materials and loads.
pub(crate) struct Body {
    pub(crate) kind: &'static dyn BodyKind,
    pub(crate) mesh: BodyMesh,
    /// The surface of the mesh.
    pub(crate) surface: Surface,
    /// The surface that loads and tools act on, where that is another.
    pub(crate) skin: Option<FineSurface>,
    /// The number of the skin's first vertex, where they are numbered after the mesh's nodes. Other skins have numbers of their own.
    pub(crate) first_vertex: Option<u32>,
    /// Where the shape has flat sides that a lattice should lie on: a point (m) of them.
    pub(crate) lattice_m: Option<DVec3>,
    pub(crate) parts: Vec<Part>,
    pub(crate) origin: String,
    pub(crate) report: Vec<String>,
    pub(crate) warnings: Vec<String>,
}

impl Body {
    /// A body with nothing but a mesh, its surface and its origin.
    pub(super) fn new(kind: &'static dyn BodyKind, mesh: BodyMesh, surface: Surface, origin: String) -> Self {
        Self {
            kind,
            mesh,
            surface,
            skin: None,
            first_vertex: None,
            lattice_m: None,
            parts: Vec::new(),
            origin,
            report: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// Its tetrahedra.
    ///
    /// # Errors
    /// It has none.
    pub(crate) fn tets(&self) -> Result<&TetMesh, Fault> {
        self.mesh.tets().ok_or_else(kinds::nothing_inside)
    }

    /// Triangles of the surface: of the skin, where there is one.
    pub(crate) fn triangle_count(&self) -> usize {
        self.skin.as_ref().map_or(self.surface.triangles.len(), |skin| skin.triangles.len())
    }

    /// Corners of the surface's triangles: nodes, or vertices of the skin.
    pub(crate) fn triangles(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        (0..self.triangle_count()).map(|triangle| match &self.skin {
            None => self.surface.triangle_nodes(triangle),
            Some(skin) => skin.triangles[triangle],
        })
    }

    /// Positions (m) of what the surface's triangles have for corners.
    pub(crate) fn surface_positions_m(&self) -> &[DVec3] {
        self.skin.as_ref().map_or(self.mesh.positions_m(), |skin| &skin.positions_m)
    }

    /// The point of the body nearest to a position (m). Where there are no nodes around it, only its distance means something.
    pub(crate) fn locate(&self, point_m: DVec3) -> Located {
        self.kind.locate(self, point_m)
    }

    /// Where a point that was located is at rest (m). A seed body's vertices are numbered after the nodes of its core.
    pub(crate) fn rest_position_m(&self, point: &Located) -> DVec3 {
        let Some(first) = self.first_vertex else { return point.of(self.surface_positions_m()) };
        let at = |node: u32| match node.checked_sub(first) {
            Some(vertex) => self.surface_positions_m()[vertex as usize],
            None => self.mesh.positions_m()[node as usize],
        };
        point.nodes.iter().zip(point.weights).map(|(&node, weight)| at(node) * weight).sum()
    }

    /// The longest edge (m) of the triangles that tools touch.
    pub(crate) fn longest_edge_m(&self) -> f64 {
        let positions_m = self.surface_positions_m();
        let longest_m = |corners: [u32; 3]| {
            let [a, b, c] = corners.map(|node| positions_m[node as usize]);
            a.distance(b).max(b.distance(c)).max(c.distance(a))
        };
        self.triangles().map(longest_m).fold(0.0, f64::max)
    }

    /// Diagonal of the bounding box (m).
    pub(crate) fn diagonal_m(&self) -> f64 {
        let (low, high) = self.mesh.bounds_m();
        low.distance(high)
    }

    /// `from (…) to (…) mm`, for messages about regions that miss the body.
    pub(crate) fn extent(&self) -> String {
        let (low, high) = self.mesh.bounds_m();
        let show = |p: DVec3| format!("({:.4}, {:.4}, {:.4})", p.x * 1e3, p.y * 1e3, p.z * 1e3);
        format!("the body reaches from {} to {} mm", show(low), show(high))
    }
}

/// The nodes of a body, and what is between them.
#[derive(Debug)]
pub(crate) enum BodyMesh {
    /// Corners of tetrahedra.
    Tets(TetMesh),
    /// Vertices (m) of a surface with nothing inside, and the surface of which they are the refined vertices, once it is known.
    Surface { positions_m: Vec<DVec3>, control: Option<Triangulation> },
}

impl BodyMesh {
    /// Positions (m) of the nodes.
    pub(crate) fn positions_m(&self) -> &[DVec3] {
        match self {
            Self::Tets(mesh) => mesh.positions_m(),
            Self::Surface { positions_m, .. } => positions_m,
        }
    }

    /// The tetrahedra, where there are any.
    pub(crate) fn tets(&self) -> Option<&TetMesh> {
        if let Self::Tets(mesh) = self { Some(mesh) } else { None }
    }

    /// How many tetrahedra there are.
    pub(crate) fn tet_count(&self) -> usize {
        self.tets().map_or(0, |mesh| mesh.tets().len())
    }

    /// The middle (m) of every tetrahedron.
    pub(crate) fn tet_middles_m(&self) -> impl Iterator<Item = DVec3> + '_ {
        let middles = |mesh: &'_ TetMesh, tet| mesh.corners_m(tet).iter().sum::<DVec3>() / 4.0;
        self.tets().into_iter().flat_map(move |mesh| (0..mesh.tets().len()).map(move |tet| middles(mesh, tet)))
    }

    /// Corners of the bounding box (m).
    pub(crate) fn bounds_m(&self) -> (DVec3, DVec3) {
        let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        self.positions_m().iter().fold(start, |(low, high), &p| (low.min(p), high.max(p)))
    }

    /// The point of the first tetrahedron that holds a position (m).
    pub(crate) fn inside(&self, point_m: DVec3) -> Option<Located> {
        let mesh = self.tets()?;
        (0..mesh.tets().len()).find_map(|tet| Located::inside(mesh, tet, point_m))
    }

    /// The point of the first tetrahedron that holds a position (m), else the nearest of the boundary's triangles.
    pub(crate) fn locate(&self, boundary: impl Iterator<Item = [u32; 3]>, point_m: DVec3) -> Located {
        self.inside(point_m).unwrap_or_else(|| Located::nearest(self.positions_m(), boundary, point_m))
    }

    /// The same elsewhere by `offset_m`.
    fn moved(self, offset_m: DVec3, at: &Where) -> Result<Self, Fault> {
        let moved = |positions_m: &[DVec3]| positions_m.iter().map(|p| *p + offset_m).collect();
        Ok(match &self {
            Self::Tets(mesh) => {
                let tets = mesh.tets().to_vec();
                Self::Tets(TetMesh::new(moved(mesh.positions_m()), tets).map_err(|error| mesh_fault(at, error))?)
            }
            Self::Surface { positions_m, control } => {
                let control = control.as_ref().map(|surface| surface.moved(moved(surface.positions_m())));
                let refused = |error: TriangulationError| {
                    Fault::value(at.clone(), error.to_string()).of(Stage::Body).cause(error)
                };
                Self::Surface { positions_m: moved(positions_m), control: control.transpose().map_err(refused)? }
            }
        })
    }
}

/// Makes the body.
pub(crate) fn make(table: &BodyTable, files: &Files<'_>, progress: &mut dyn FnMut(f64, &str)) -> Result<Body, Fault> {
    let at = Where::root("body");
    let key = exactly_one(&at, &kinds_given(table))?;
    let at = at.key(key);
    progress(0.05, "making the body");
    let kind = kinds::of(table);
    let mut body = match table {
        BodyTable { mesh: Some(mesh), .. } => from_file(kind, mesh, files, &at)?,
        BodyTable { surface: Some(surface), .. } => surface_alone::read(kind, surface, files, &at)?,
        BodyTable { surfaces: Some(surfaces), .. } => from_surfaces(kind, table, surfaces, files, &at, progress)?,
        _ => from_shape(kind, table, key, files.limits, &at)?,
    };
    kind.put_surface_on(&mut body, table, &at, files, progress)?;
    let offset = DVec3::from(table.offset_m);
    if offset != DVec3::ZERO {
        body.mesh = body.mesh.moved(offset, &at)?;
        body.skin.iter_mut().flat_map(|skin| &mut skin.positions_m).for_each(|p| *p += offset);
        body.lattice_m.iter_mut().for_each(|p| *p += offset);
    }
    let warning = implausible_size(table, &body);
    body.warnings.extend(warning);
    Ok(body)
}

/// A body whose size (m) lies outside these was probably given in another unit.
const PLAUSIBLE_SIZE_M: std::ops::RangeInclusive<f64> = 1e-3..=2.0;

/// The keys that say what a body is made of, and whether a scene gives them.
fn kinds_given(table: &BodyTable) -> [(&'static str, bool); 7] {
    [
        ("box", table.block.is_some()),
        ("sphere_shell", table.sphere_shell.is_some()),
        ("ellipsoid_shell", table.ellipsoid_shell.is_some()),
        ("ventricle", table.ventricle.is_some()),
        ("mesh", table.mesh.is_some()),
        ("surfaces", table.surfaces.is_some()),
        ("surface", table.surface.is_some()),
    ]
}

/// Says so when a body is as large or small as one in the wrong unit, with the key to change.
pub(super) fn implausible_size(table: &BodyTable, body: &Body) -> Option<String> {
    let kind = kinds_given(table).into_iter().find(|(_, given)| *given)?.0;
    let (low, high) = body.mesh.bounds_m();
    let size_m = (high - low).max_element();
    if PLAUSIBLE_SIZE_M.contains(&size_m) {
        return None;
    }
    let size = if size_m > 1.0 { format!("{size_m:.4} m") } else { format!("{:.3e} mm", size_m * 1e3) };
    let of_surface = table.surface.as_ref().map(|surface| surface.unit);
    let of_surfaces = table.surfaces.as_ref().map(|surfaces| surfaces.unit);
    let unit = table.mesh.as_ref().map(|mesh| mesh.unit).or(of_surfaces).or(of_surface);
    let change = if let Some(unit) = unit {
        let fits = |other: &LengthUnit| PLAUSIBLE_SIZE_M.contains(&(size_m / unit.in_m() * other.in_m()));
        let other = LengthUnit::BY_USE.into_iter().find(fits);
        let wanted = other.map_or(String::new(), |other| format!("; should it be unit = \"{}\"?", other.word()));
        format!("[body.{kind}] says unit = \"{}\"{wanted}", unit.word())
    } else {
        let key = match kind {
            "box" => "size",
            "sphere_shell" => "outer_radius",
            _ => "outer_semi_axes",
        };
        let (suffix, name) = if size_m > 1.0 { ("mm", "millimetres") } else { ("m", "metres") };
        format!("if {name} were meant in [body.{kind}], write `{key}_{suffix}`")
    };
    Some(format!("the body is {size} long: {change}"))
}

fn mesh_fault(at: &Where, error: MeshError) -> Fault {
    Fault::value(at.clone(), error.to_string()).of(Stage::Body).cause(error)
}

fn from_shape(
    kind: &'static dyn BodyKind,
    table: &BodyTable,
    key: &str,
    limits: &Limits,
    at: &Where,
) -> Result<Body, Fault> {
    let demand = |target_tets: u32| limits.check_tets(&at.key("target_tets"), target_tets.into());
    let shape = if let Some(block) = &table.block {
        let tets = block.cells.iter().fold(6u64, |product, &cells| product.saturating_mul(cells.into()));
        limits.check_tets(&at.key("cells"), tets)?;
        shapes::box_mesh(DVec3::from(block.size_m), block.cells)
    } else if let Some(shell) = &table.sphere_shell {
        demand(shell.target_tets)?;
        shapes::sphere_shell(shell.inner_radius_m, shell.outer_radius_m, shell.target_tets)
    } else if let Some(shell) = &table.ellipsoid_shell {
        demand(shell.target_tets)?;
        let (inner, outer) = (DVec3::from(shell.inner_semi_axes_m), DVec3::from(shell.outer_semi_axes_m));
        shapes::ellipsoid_shell(inner, outer, shell.target_tets)
    } else if let Some(ventricle) = &table.ventricle {
        demand(ventricle.target_tets)?;
        let (outer, inner) = (ventricle.outer_semi_axes_m.into(), ventricle.inner_semi_axes_m.into());
        shapes::ventricle(outer, inner, ventricle.cut_z_m, ventricle.target_tets)
    } else {
        return Err(Fault::value(at.clone(), "there is no such shape"));
    };
    let shape = shape.map_err(|error| shape_fault(at, error))?;
    let flat_m = match table {
        BodyTable { block: Some(_), .. } => Some(DVec3::ZERO),
        BodyTable { ventricle: Some(ventricle), .. } => Some(DVec3::Z * ventricle.cut_z_m),
        _ => None,
    };
    Ok(Body { lattice_m: flat_m, ..of_shape(kind, shape, key, at)? })
}

pub(super) fn shape_fault(at: &Where, error: ShapeError) -> Fault {
    Fault::value(at.clone(), format!("[{at}]: {error}")).of(Stage::Body).cause(error)
}

fn of_shape(kind: &'static dyn BodyKind, shape: Shape, key: &str, at: &Where) -> Result<Body, Fault> {
    let surface = Surface::of(&shape.mesh).map_err(|error| mesh_fault(at, error))?;
    let report = if shape.layers > 0 {
        vec![format!("{} through the wall", counted(shape.layers as usize, "layer"))]
    } else {
        Vec::new()
    };
    let parts = parts::of_boundary(&shape.regions, &surface);
    let body = Body::new(kind, BodyMesh::Tets(shape.mesh), surface, format!("shape {key}"));
    Ok(Body { parts, report, ..body })
}

pub(super) fn file_fault(at: &Where, error: FileError) -> Fault {
    Fault::value(at.clone(), error.to_string()).of(Stage::Body).help(error.problem.help()).cause(error)
}

/// Reads both surfaces and fills the wall between them.
fn from_surfaces(
    kind: &'static dyn BodyKind,
    of_body: &BodyTable,
    table: &SurfacesTable,
    files: &Files<'_>,
    at: &Where,
    progress: &mut dyn FnMut(f64, &str),
) -> Result<Body, Fault> {
    files.limits.check_tets(&at.key("target_tets"), table.target_tets.into())?;
    let inner = files.read_surface(&at.key("inner_file"), &table.inner_file)?;
    let outer = files.read_surface(&at.key("outer_file"), &table.outer_file)?;
    let options = FillOptions { layers: table.layers, ..FillOptions::new(table.target_tets) };
    let mut part_of_load = |part: f64, what: &str| progress(0.1 + 0.65 * part, what);
    let inner_input = input(&inner, table.inner_unit.unwrap_or(table.unit).in_m());
    let outer_input = input(&outer, table.unit.in_m());
    let refused = |error: FillError| fill_fault(at, error);
    let filled = fill::fill(inner_input, outer_input, options, &mut part_of_load).map_err(refused)?;
    let surface = Surface::of(&filled.mesh).map_err(|error| mesh_fault(at, error))?;
    let warnings = inner.warnings.iter().chain(&outer.warnings).cloned().collect();
    let parts = parts::of_boundary(&filled.regions, &surface);
    let origin = format!("wall between {} and {}", table.inner_file, table.outer_file);
    let lines = filled.report.to_string();
    let report = lines.lines().map(str::to_owned).chain(inner.notes.clone()).chain(outer.notes.clone()).collect();
    let mut body = Body { parts, report, warnings, ..Body::new(kind, BodyMesh::Tets(filled.mesh), surface, origin) };
    let around = |spacing_m| fill::around(inner_input, outer_input, spacing_m).map_err(refused);
    body.skin = kinds::skin_around(&body, of_body, files, around)?;
    Ok(body)
}

/// At the count of tets where another may do.
fn fill_fault(at: &Where, error: FillError) -> Fault {
    let help = match &error {
        FillError::Count { wanted, highest, .. } if wanted > highest => Some(format!("give {highest} or fewer")),
        FillError::Count { lowest, .. } => {
            Some(format!("give {lowest} or more; a thin wall needs many, as they are about as long as it is thick"))
        }
        FillError::CountMissed { found, .. } => Some(format!("give {found}")),
        FillError::Quality { .. } => Some(
            "give another count, half or twice as many, or surfaces that are smoother or farther apart there"
                .to_owned(),
        ),
        _ => None,
    };
    let at = if help.is_some() { at.key("target_tets") } else { at.clone() };
    let fault = Fault::value(at, error.to_string()).of(Stage::Body).cause(error);
    match help {
        Some(help) => fault.help(help),
        None => fault,
    }
}

fn input(file: &SurfaceFile, metres_per_unit: f64) -> SurfaceInput<'_> {
    SurfaceInput { vertices: &file.vertices, triangles: &file.triangles, metres_per_unit }
}

fn from_file(kind: &'static dyn BodyKind, table: &MeshTable, files: &Files<'_>, at: &Where) -> Result<Body, Fault> {
    let at = at.key("file");
    let path = files.resolve(&at, &table.file)?;
    let refused = |error| file_fault(&at, error);
    let volume = files::read_volume(&path).map_err(refused)?;
    files.limits.check_tets(&at, volume.tets.len() as u64)?;
    let grouped = volume.into_tet_mesh(table.unit.in_m(), UnusedNodes::Drop).map_err(refused)?;
    let surface = Surface::of(&grouped.mesh).map_err(|error| mesh_fault(&at, error))?;
    let parts = parts::of_groups(&grouped, &surface);
    let (warnings, report) = (grouped.warnings, grouped.notes);
    let body = Body::new(kind, BodyMesh::Tets(grouped.mesh), surface, format!("file {}", table.file));
    Ok(Body { parts, report, warnings, ..body })
}
