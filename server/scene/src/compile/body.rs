//! `[body]`: shapes, mesh files and surface pairs become one kind of body with named parts.
use super::{
    Files, exactly_one,
    located::Located,
    particles,
    parts::{self, Part},
    seed, springs,
};
use crate::{
    document::{
        body::{BodyTable, LengthUnit, MeshTable, ParticlesTable, SurfacesTable},
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
use palpate_physics::{MeshError, Surface, TetMesh, bodies::mass_spring::topology::Triangulation, contact::is_inside};

/// A body before regions, materials and loads.
pub(crate) struct Body {
    pub(crate) mesh: TetMesh,
    pub(crate) surface: Surface,
    /// The surface over particles: what loads and tools act on.
    pub(crate) skin: Option<FineSurface>,
    /// Its surface, where it is one of springs: nodes are its vertices then, and the skin is it refined everywhere.
    pub(crate) springs: Option<Triangulation>,
    /// Of a skin over a seed body's layer: the number of its first vertex, after the tets' nodes. Other skins have numbers of their own.
    pub(crate) first_vertex: Option<u32>,
    /// Where the shape has flat sides that a lattice should lie on: a point (m) of them.
    pub(crate) lattice_m: Option<DVec3>,
    pub(crate) parts: Vec<Part>,
    pub(crate) origin: String,
    pub(crate) report: Vec<String>,
    pub(crate) warnings: Vec<String>,
}

impl Body {
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

    /// The point of the body nearest to a position (m). With a skin, only its distance means something for a point inside.
    pub(crate) fn locate(&self, point_m: DVec3) -> Located {
        match &self.skin {
            None => Located::locate(&self.mesh, &self.triangles().collect::<Vec<_>>(), point_m),
            Some(skin) if self.first_vertex.is_some() => self.locate_in_seed(skin, point_m),
            Some(skin) if self.springs.is_some() => {
                Located::nearest(&skin.positions_m, skin.triangles.iter().copied(), point_m)
            }
            Some(skin) if is_inside(point_m, &skin.triangles, &skin.positions_m) => {
                Located { nodes: [0; 4], weights: [1.0, 0.0, 0.0, 0.0], distance_m: 0.0 }
            }
            Some(skin) => Located::nearest(&skin.positions_m, skin.triangles.iter().copied(), point_m),
        }
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

    /// In the core, or the nearest of the skin: nothing is known between them.
    fn locate_in_seed(&self, skin: &FineSurface, point_m: DVec3) -> Located {
        let in_core = |tet| Located::inside(&self.mesh, tet, point_m);
        (0..self.mesh.tets().len()).find_map(in_core).unwrap_or_else(|| {
            let nearest = Located::nearest(&skin.positions_m, skin.triangles.iter().copied(), point_m);
            let is_inside = is_inside(point_m, &skin.triangles, &skin.positions_m);
            Located {
                nodes: nearest.nodes.map(|vertex| vertex + self.first_vertex.unwrap_or_default()),
                distance_m: if is_inside { 0.0 } else { nearest.distance_m },
                ..nearest
            }
        })
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

/// Makes the body.
pub(crate) fn make(table: &BodyTable, files: &Files<'_>, progress: &mut dyn FnMut(f64, &str)) -> Result<Body, Fault> {
    let at = Where::root("body");
    let kind = exactly_one(
        &at,
        &[
            ("box", table.block.is_some()),
            ("sphere_shell", table.sphere_shell.is_some()),
            ("ellipsoid_shell", table.ellipsoid_shell.is_some()),
            ("ventricle", table.ventricle.is_some()),
            ("mesh", table.mesh.is_some()),
            ("surfaces", table.surfaces.is_some()),
            ("surface", table.surface.is_some()),
        ],
    )?;
    springs::demand(table)?;
    let at = at.key(kind);
    progress(0.05, "making the body");
    let mut body = match table {
        BodyTable { mesh: Some(mesh), .. } => from_file(mesh, files, &at)?,
        BodyTable { surface: Some(surface), .. } => springs::from_file(surface, files, &at)?,
        BodyTable { surfaces: Some(surfaces), particles, .. } => {
            from_surfaces(surfaces, particles.as_ref(), files, &at, progress)?
        }
        _ => from_shape(table, kind, files.limits, &at)?,
    };
    if let Some(wanted) = &table.particles {
        progress(0.75, "making the skin");
        let skin = if let Some(skin) = body.skin.take() {
            skin
        } else {
            particles::demand(wanted, &body, files.limits)?;
            particles::skin_of(table, &body, wanted.longest_edge_m()).map_err(|error| shape_fault(&at, error))?
        };
        particles::put_on(&mut body, table, skin);
    }
    if let Some(layer) = table.seed.as_ref().and_then(|seed| seed.layer.as_ref()) {
        progress(0.75, "making the skin");
        seed::put_on(&mut body, layer, files.limits)?;
    }
    if let Some(wanted) = &table.springs {
        progress(0.75, "making the surface of springs");
        springs::put_on(&mut body, wanted)?;
    }
    let offset = DVec3::from(table.offset_m);
    if offset != DVec3::ZERO && body.springs.is_some() {
        springs::shift(&mut body, offset)?;
        body.skin.iter_mut().flat_map(|skin| &mut skin.positions_m).for_each(|p| *p += offset);
    } else if offset != DVec3::ZERO {
        let moved = body.mesh.positions_m().iter().map(|p| *p + offset).collect();
        body.mesh = TetMesh::new(moved, body.mesh.tets().to_vec()).map_err(|error| mesh_fault(&at, error))?;
        body.skin.iter_mut().flat_map(|skin| &mut skin.positions_m).for_each(|p| *p += offset);
        body.lattice_m.iter_mut().for_each(|p| *p += offset);
    }
    let warning = implausible_size(table, kind, &body);
    body.warnings.extend(warning);
    Ok(body)
}

/// A body whose size (m) lies outside these was probably given in another unit.
const PLAUSIBLE_SIZE_M: std::ops::RangeInclusive<f64> = 1e-3..=2.0;

/// Says so when a body is as large or small as one in the wrong unit, with the key to change.
fn implausible_size(table: &BodyTable, kind: &str, body: &Body) -> Option<String> {
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

fn from_shape(table: &BodyTable, kind: &str, limits: &Limits, at: &Where) -> Result<Body, Fault> {
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
    Ok(Body { lattice_m: flat_m, ..of_shape(shape, kind, at)? })
}

fn shape_fault(at: &Where, error: ShapeError) -> Fault {
    Fault::value(at.clone(), format!("[{at}]: {error}")).of(Stage::Body).cause(error)
}

fn of_shape(shape: Shape, kind: &str, at: &Where) -> Result<Body, Fault> {
    let surface = Surface::of(&shape.mesh).map_err(|error| mesh_fault(at, error))?;
    let report = if shape.layers > 0 {
        vec![format!("{} through the wall", counted(shape.layers as usize, "layer"))]
    } else {
        Vec::new()
    };
    Ok(Body {
        parts: parts::of_boundary(&shape.regions, &surface),
        surface,
        skin: None,
        springs: None,
        first_vertex: None,
        lattice_m: None,
        origin: format!("shape {kind}"),
        report,
        warnings: Vec::new(),
        mesh: shape.mesh,
    })
}

pub(super) fn file_fault(at: &Where, error: FileError) -> Fault {
    Fault::value(at.clone(), error.to_string()).of(Stage::Body).help(error.problem.help()).cause(error)
}

/// Reads both surfaces and fills the wall between them.
fn from_surfaces(
    table: &SurfacesTable,
    wanted: Option<&ParticlesTable>,
    files: &Files<'_>,
    at: &Where,
    progress: &mut dyn FnMut(f64, &str),
) -> Result<Body, Fault> {
    files.limits.check_tets(&at.key("target_tets"), table.target_tets.into())?;
    let read = |key: &str, file: &str| -> Result<SurfaceFile, Fault> {
        let at = at.key(key);
        let path = files.resolve(&at, file)?;
        files::read_surface(&path).map_err(|error| file_fault(&at, error))
    };
    let (inner, outer) = (read("inner_file", &table.inner_file)?, read("outer_file", &table.outer_file)?);
    let options = FillOptions { layers: table.layers, ..FillOptions::new(table.target_tets) };
    let mut part_of_load = |part: f64, what: &str| progress(0.1 + 0.65 * part, what);
    let inner_input = input(&inner, table.inner_unit.unwrap_or(table.unit).in_m());
    let outer_input = input(&outer, table.unit.in_m());
    let refused = |error: FillError| Fault::value(at.clone(), error.to_string()).of(Stage::Body).cause(error);
    let filled = fill::fill(inner_input, outer_input, options, &mut part_of_load).map_err(refused)?;
    let surface = Surface::of(&filled.mesh).map_err(|error| mesh_fault(at, error))?;
    let warnings = inner.warnings.iter().chain(&outer.warnings).cloned().collect();
    let mut body = Body {
        parts: parts::of_boundary(&filled.regions, &surface),
        surface,
        skin: None,
        springs: None,
        first_vertex: None,
        lattice_m: None,
        origin: format!("wall between {} and {}", table.inner_file, table.outer_file),
        report: filled.report.to_string().lines().map(str::to_owned).collect(),
        warnings,
        mesh: filled.mesh,
    };
    if let Some(wanted) = wanted {
        particles::demand(wanted, &body, files.limits)?;
        body.skin = Some(fill::around(inner_input, outer_input, wanted.spacing_m).map_err(refused)?);
    }
    Ok(body)
}

fn input(file: &SurfaceFile, metres_per_unit: f64) -> SurfaceInput<'_> {
    SurfaceInput { vertices: &file.vertices, triangles: &file.triangles, metres_per_unit }
}

fn from_file(table: &MeshTable, files: &Files<'_>, at: &Where) -> Result<Body, Fault> {
    let at = at.key("file");
    let path = files.resolve(&at, &table.file)?;
    let refused = |error| file_fault(&at, error);
    let volume = files::read_volume(&path).map_err(refused)?;
    files.limits.check_tets(&at, volume.tets.len() as u64)?;
    let grouped = volume.into_tet_mesh(table.unit.in_m(), UnusedNodes::Drop).map_err(refused)?;
    let surface = Surface::of(&grouped.mesh).map_err(|error| mesh_fault(&at, error))?;
    Ok(Body {
        parts: parts::of_groups(&grouped, &surface),
        surface,
        skin: None,
        springs: None,
        first_vertex: None,
        lattice_m: None,
        origin: format!("file {}", table.file),
        report: Vec::new(),
        warnings: grouped.warnings.clone(),
        mesh: grouped.mesh,
    })
}
