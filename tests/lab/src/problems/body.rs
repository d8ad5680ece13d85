//! The problems' bodies in tetrahedra.
use super::place::{Meridian, Place};
use glam::DVec3;
use miette::{IntoDiagnostic, Result, miette};
use palpate_physics::{PrescribedSpec, Surface, TetMesh, contact::closest_weights};
use palpate_scene::shapes::{self, BoundaryRegion};
use std::collections::BTreeMap;

/// Semi-axes (short, long) of a ventricle outside and inside, and the height of its cut (m).
pub type VentricleM = ((f64, f64), (f64, f64), f64);

/// Width and height (m) of the block.
pub const BLOCK_M: [f64; 2] = [80e-3, 40e-3];
/// The ventricle of human size.
pub const VENTRICLE_M: VentricleM = ((36e-3, 72e-3), (25.2e-3, 61.2e-3), 18e-3);
/// The same of the small ventricle.
pub const SMALL_VENTRICLE_M: VentricleM = ((10e-3, 20e-3), (7e-3, 17e-3), 5e-3);
/// Inner and outer radius (m) of Lamé's sphere.
pub const OCTANT_M: [f64; 2] = [50e-3, 100e-3];
/// Length (m) of the beams.
pub const BEAM_LENGTH_M: f64 = 0.1;

/// A body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Body {
    /// 80 × 80 × 40 mm, centred on the z axis, held at z = 0, touched at the middle of its top.
    Block,
    /// Truncated ellipsoid shell of human size, held at its base, touched somewhere.
    Ventricle(Place),
    /// The same of 20 mm, with semi-axes 10 and 20 mm outside: an animal's; touched from the side.
    SmallVentricle,
    /// An octant of Lamé's sphere.
    Octant,
    /// A square beam along x, its length over its thickness.
    Beam {
        /// Length over thickness.
        slenderness: u32,
    },
}

/// A body in tetrahedra.
#[derive(Debug, Clone)]
pub struct TetBody {
    /// Its mesh.
    pub mesh: TetMesh,
    /// Its boundary.
    pub surface: Surface,
    /// What holds it.
    pub prescribed: Vec<PrescribedSpec>,
    /// Corners of the triangles of the side that is touched, counter-clockwise from outside.
    pub touched: Vec<[u32; 3]>,
    /// A point on the line of the touch (m).
    pub touch_m: DVec3,
    /// The line's direction, outwards.
    pub normal: DVec3,
}

impl Body {
    /// For names.
    pub fn name(self) -> &'static str {
        match self {
            Self::Block => "block",
            Self::Ventricle(place) => place.name(),
            Self::SmallVentricle => "ventricle-20mm",
            Self::Octant => "octant",
            Self::Beam { .. } => "beam",
        }
    }

    /// For sentences.
    pub fn sentence(self) -> &'static str {
        match self {
            Self::Block => "the middle of a block of 80 × 80 × 40 mm held at its lower face",
            Self::Ventricle(place) => place.sentence(),
            Self::SmallVentricle => "the side of a ventricle of 20 mm (25 mm long, wall 3 mm) held at its base",
            Self::Octant => "a thick sphere",
            Self::Beam { .. } => "a clamped beam",
        }
    }

    /// What a resolution counts.
    pub fn resolution_unit(self) -> &'static str {
        match self {
            Self::Block => "cells along 80 mm",
            Self::Ventricle(_) | Self::SmallVentricle => "tets, about",
            Self::Octant => "cells along an arc",
            Self::Beam { .. } => "cells through the thickness",
        }
    }

    /// Its resolutions, ascending: those of a quick run, and all.
    pub fn resolutions(self, full: bool) -> &'static [u32] {
        match (self, full) {
            (Self::Block, false) | (Self::Octant, true) => &[4, 8, 16],
            (Self::Block, true) => &[4, 8, 12, 16, 24],
            (Self::Ventricle(_) | Self::SmallVentricle, false) => &[188, 1_352, 5_000],
            (Self::Ventricle(_) | Self::SmallVentricle, true) => &[188, 1_352, 5_000, 10_000, 50_000],
            (Self::Octant, false) => &[4, 8],
            (Self::Beam { .. }, false) => &[2, 4],
            (Self::Beam { .. }, true) => &[2, 4, 8],
        }
    }

    /// Its mesh and what holds it.
    ///
    /// # Errors
    /// A resolution that no mesh has.
    pub fn tets(self, resolution: u32) -> Result<TetBody> {
        match self {
            Self::Block => block(resolution),
            Self::Ventricle(place) => ventricle(VENTRICLE_M, place, resolution),
            Self::SmallVentricle => ventricle(SMALL_VENTRICLE_M, Place::Side, resolution),
            Self::Octant => octant(resolution as usize),
            Self::Beam { slenderness } => beam(slenderness, resolution),
        }
    }
}

impl TetBody {
    fn new(
        mesh: TetMesh,
        prescribed: Vec<PrescribedSpec>,
        touched: Vec<[u32; 3]>,
        (touch_m, normal): (DVec3, DVec3),
    ) -> Result<Self> {
        let surface = Surface::of(&mesh).into_diagnostic()?;
        Ok(Self { mesh, surface, prescribed, touched, touch_m, normal })
    }

    /// Corners (m) of the touched triangles.
    pub fn touched_corners_m(&self) -> impl Iterator<Item = [DVec3; 3]> {
        self.touched.iter().map(|triangle| triangle.map(|n| self.mesh.positions_m()[n as usize]))
    }

    /// Where the centre (m) of a sphere that comes along the line of the touch first touches *this* mesh: depth is felt from
    /// there, also where a coarse mesh cuts corners. (The bodies are convex towards the tool: the distance falls on the way.)
    pub fn first_touch_m(&self, radius_m: f64) -> DVec3 {
        let distance_m = |along: f64| {
            let centre = self.touch_m + self.normal * along;
            let distances = self.touched_corners_m().map(|corners| {
                let weights = closest_weights(centre, corners);
                (corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2]).distance(centre)
            });
            distances.fold(f64::INFINITY, f64::min)
        };
        let (mut inside, mut outside) = (0.0, 2.0 * radius_m);
        for _ in 0..60 {
            let middle = f64::midpoint(inside, outside);
            if distance_m(middle) < radius_m { inside = middle } else { outside = middle }
        }
        self.touch_m + self.normal * outside
    }
}

fn held(name: &str, nodes: Vec<u32>, axes: [bool; 3]) -> PrescribedSpec {
    PrescribedSpec { name: name.into(), nodes, axes, is_fixed: false }
}

fn region<'a>(shape: &'a shapes::Shape, name: &str) -> Result<&'a BoundaryRegion> {
    shape.region(name).ok_or_else(|| miette!("the shape has no region \"{name}\""))
}

fn block(cells: u32) -> Result<TetBody> {
    let [width, height] = BLOCK_M;
    let shape =
        shapes::box_mesh(DVec3::new(width, width, height), [cells, cells, cells.div_ceil(2)]).into_diagnostic()?;
    let middle = DVec3::new(0.5 * width, 0.5 * width, 0.0);
    let centred = shape.mesh.positions_m().iter().map(|p| *p - middle).collect();
    let mesh = TetMesh::new(centred, shape.mesh.tets().to_vec()).into_diagnostic()?;
    let prescribed = vec![held("floor", region(&shape, "z_min")?.nodes(), [true; 3])];
    TetBody::new(mesh, prescribed, region(&shape, "z_max")?.triangles.clone(), (DVec3::Z * height, DVec3::Z))
}

fn ventricle((outer, inner, cut): VentricleM, place: Place, tets: u32) -> Result<TetBody> {
    let shape = shapes::ventricle(outer, inner, cut, tets).into_diagnostic()?;
    let held = vec![held("base", region(&shape, "base")?.nodes(), [true; 3])];
    let touched = region(&shape, "outer")?.triangles.clone();
    let (meridian, latitude, turn) = (Meridian(outer), place.latitude_rad(), place.turn());
    TetBody::new(shape.mesh, held, touched, (turn * meridian.point_m(latitude), turn * meridian.normal(latitude)))
}

fn beam(slenderness: u32, cells: u32) -> Result<TetBody> {
    let thick = BEAM_LENGTH_M / f64::from(slenderness);
    let shape = shapes::box_mesh(DVec3::new(BEAM_LENGTH_M, thick, thick), [slenderness * cells, cells, cells])
        .into_diagnostic()?;
    let prescribed = vec![held("clamp", region(&shape, "x_min")?.nodes(), [true; 3])];
    let end = region(&shape, "x_max")?.triangles.clone();
    TetBody::new(shape.mesh, prescribed, end, (DVec3::X * BEAM_LENGTH_M, DVec3::X))
}

/// `cells` along each arc and half as many through the wall; prisms in three tets each.
fn octant(cells: usize) -> Result<TetBody> {
    let [inner, outer] = OCTANT_M;
    let layers = (cells / 2).max(1);
    let mut number = BTreeMap::new();
    let mut directions = Vec::new();
    for i in 0..=cells {
        for j in 0..=cells - i {
            number.insert((i, j), directions.len() as u32);
            directions.push(DVec3::new(i as f64, j as f64, (cells - i - j) as f64).normalize());
        }
    }
    let mut triangles = Vec::new();
    for (i, j) in (0..cells).flat_map(|i| (0..cells - i).map(move |j| (i, j))) {
        triangles.push([number[&(i, j)], number[&(i + 1, j)], number[&(i, j + 1)]]);
        if i + j + 1 < cells {
            triangles.push([number[&(i + 1, j)], number[&(i + 1, j + 1)], number[&(i, j + 1)]]);
        }
    }
    let count = directions.len() as u32;
    let radius = |layer: usize| inner + (outer - inner) * layer as f64 / layers as f64;
    let positions: Vec<DVec3> =
        (0..=layers).flat_map(|layer| directions.iter().map(move |d| *d * radius(layer))).collect();
    let mut tets: Vec<[u32; 4]> = Vec::new();
    for layer in 0..layers as u32 {
        for triangle in &triangles {
            let mut base = *triangle;
            base.sort_unstable();
            let (low, high) = (base.map(|v| layer * count + v), base.map(|v| (layer + 1) * count + v));
            tets.push([low[0], low[1], low[2], high[2]]);
            tets.push([low[0], low[1], high[1], high[2]]);
            tets.push([low[0], high[0], high[1], high[2]]);
        }
    }
    for tet in &mut tets {
        let [a, b, c, d] = tet.map(|n| positions[n as usize]);
        if (b - a).cross(c - a).dot(d - a) < 0.0 {
            tet.swap(2, 3);
        }
    }
    let on_plane = |axis: usize| {
        let nodes = positions.iter().enumerate().filter(|(_, p)| p[axis].abs() < 1e-12);
        held(["x", "y", "z"][axis], nodes.map(|(n, _)| n as u32).collect(), [0, 1, 2].map(|a| a == axis))
    };
    let prescribed = (0..3).map(on_plane).collect();
    let mesh = TetMesh::new(positions.clone(), tets).into_diagnostic()?;
    let surface = Surface::of(&mesh).into_diagnostic()?;
    let inside = |t: &[u32; 3]| t.iter().all(|&n| positions[n as usize].length() < inner * (1.0 + 1e-9));
    let touched = (0..surface.triangles.len()).map(|t| surface.triangle_nodes(t)).filter(inside).collect();
    TetBody::new(mesh, prescribed, touched, (DVec3::X * inner, DVec3::NEG_X))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sphere_first_touches_the_true_place_in_the_limit() {
        let block = Body::Block.tets(4).unwrap();
        assert!((block.first_touch_m(0.01) - DVec3::Z * 0.05).length() < 1e-12);
        let gap = |tets| Body::Ventricle(Place::Side).tets(tets).unwrap().first_touch_m(0.01).x - 0.046;
        let (coarse, fine) = (gap(188), gap(5_000));
        assert!(coarse <= 1e-12 && fine <= 1e-12 && fine > -0.5e-3 && coarse > -4e-3, "{coarse} {fine}");
    }
}
