//! What a fill came out like.
use super::bvh::SurfaceIndex;
use super::prisms::Split;
use super::relation::enclosed_volume;
use super::repair::{CleanSurface, Repairs};
use super::trimesh::TriMesh;
use super::wall::Wall;
use crate::wording::counted;
use glam::DVec3;
use palpate_physics::TetMesh;
use palpate_physics::mesh::quality::{Quality, measure as measure_quality};
use std::fmt;

/// How a surface was repaired and met.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceReport {
    /// What was repaired.
    pub repairs: Repairs,
    /// Largest distance (m) from the file's surface to the mesh's: from its vertices and the middles of its triangles.
    pub input_to_mesh_m: f64,
    /// Largest distance (m) from the mesh's boundary to the file's surface: from vertices, edge and triangle middles.
    pub mesh_to_input_m: f64,
}

impl SurfaceReport {
    /// Hausdorff distance (m): the larger of both.
    pub fn hausdorff_m(&self) -> f64 {
        self.input_to_mesh_m.max(self.mesh_to_input_m)
    }
}

/// What a fill came out like.
#[derive(Debug, Clone, PartialEq)]
pub struct FillReport {
    /// Number of tets.
    pub tets: usize,
    /// Number of nodes.
    pub nodes: usize,
    /// Layers through the wall.
    pub layers: u32,
    /// Mean wall thickness (m) of the input.
    pub thickness_m: f64,
    /// Mean edge (m) of the outer boundary.
    pub outer_edge_m: f64,
    /// Shapes of the tets.
    pub quality: Quality,
    /// The inner surface.
    pub inner: SurfaceReport,
    /// The outer surface.
    pub outer: SurfaceReport,
    /// Volume of the tets (m³).
    pub volume_m3: f64,
    /// Volume (m³) between the surfaces as given and, where they are open, the mesh's base.
    pub input_volume_m3: f64,
}

/// What is not said of every body: layers, how much of the volume is met, and how well either surface.
impl fmt::Display for FillReport {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let percent = 100.0 * (self.volume_m3 / self.input_volume_m3 - 1.0).abs();
        let layers = counted(self.layers as usize, "layer");
        writeln!(out, "{layers} through the wall; volume {percent:.2} % off that between the surfaces")?;
        for (name, surface) in [("inner", &self.inner), ("outer", &self.outer)] {
            let distance = surface.hausdorff_m();
            let part = 100.0 * distance / self.outer_edge_m;
            writeln!(out, "{name}: {}; within {:.3} mm ({part:.0} % of an edge)", surface.repairs, distance * 1e3)?;
        }
        Ok(())
    }
}

pub(super) fn measure(mesh: &TetMesh, parts: &Split, wall: &Wall, layers: u32) -> FillReport {
    let (inner, outer) = (&parts.inner, &parts.outer);
    let surface = |clean: &CleanSurface, input: &SurfaceIndex, triangles: &[[u32; 3]]| SurfaceReport {
        repairs: clean.repairs,
        input_to_mesh_m: farthest(
            &clean.mesh.positions,
            &clean.mesh.triangles,
            &SurfaceIndex::new(mesh.positions_m(), triangles),
        ),
        mesh_to_input_m: farthest(mesh.positions_m(), triangles, input),
    };
    FillReport {
        tets: mesh.tets().len(),
        nodes: mesh.positions_m().len(),
        layers,
        thickness_m: wall.thickness_m,
        outer_edge_m: mean_edge(mesh.positions_m(), outer),
        quality: measure_quality(mesh),
        inner: surface(&wall.inner, &wall.inner_target.surface, inner),
        outer: surface(&wall.outer, &wall.outer_target.surface, outer),
        volume_m3: mesh.total_volume_m3(),
        input_volume_m3: input_volume(mesh, parts, wall),
    }
}

/// Σ (a−o)·((b−o)×(c−o))/6 over the surfaces as given and the mesh's base. The base's rims differ from the given ones
/// within an edge; with o in the middle of the rim the cones over those slivers have next to no volume.
fn input_volume(mesh: &TetMesh, parts: &Split, wall: &Wall) -> f64 {
    let rim = wall.inner.rim.iter().map(|&v| wall.inner.mesh.positions[v as usize]);
    let apex = rim.sum::<DVec3>() / wall.inner.rim.len().max(1) as f64;
    let base = TriMesh::new(mesh.positions_m().to_vec(), parts.base.clone());
    enclosed_volume(&wall.outer.mesh, &[], apex) - enclosed_volume(&wall.inner.mesh, &[], apex)
        + enclosed_volume(&base, &[], apex)
}

fn mean_edge(positions: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
    let edges = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let sum: f64 = edges.map(|[a, b]| positions[a as usize].distance(positions[b as usize])).sum();
    sum / (3 * triangles.len()).max(1) as f64
}

/// Largest distance to `to` from the corners, edge middles and middles of triangles.
fn farthest(positions: &[DVec3], triangles: &[[u32; 3]], to: &SurfaceIndex) -> f64 {
    let distance = |p: DVec3| to.nearest(p).distance_squared;
    let samples = triangles.iter().flat_map(|t| {
        let [a, b, c] = t.map(|v| positions[v as usize]);
        [a, b, c, (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0, (a + b + c) / 3.0]
    });
    samples.map(distance).fold(0.0, f64::max).sqrt()
}
