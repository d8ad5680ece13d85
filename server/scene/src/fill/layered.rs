//! The layers of prisms between a triangulation of the outer surface and its image on the inner one.
use super::error::FillError;
use super::trimesh::TriMesh;
use super::wall::Wall;
use super::{Fill, FillOptions, optimise, prisms, report, settle};
use crate::shapes::{BoundaryRegion, graded};
use glam::DVec3;
use palpate_physics::TetMesh;
use palpate_physics::mesh::quality::{dihedral_angles_deg, volume_length_ratio};

/// Counts are met within this part of the wanted one, or it is an error.
const COUNT_TOLERANCE: f64 = 0.15;
/// Passes over the nodes in a round.
const SWEEPS: usize = 6;
/// Matching the volume may lower the worst volume-length ratio to this part of what it was.
const WORST_KEPT: f64 = 0.8;

/// Rounds of sliding nodes and settling again.
const SETTLING_ROUNDS: usize = 2;

/// Where a node sits.
#[derive(Clone, Copy)]
struct Place {
    side: Side,
    vertex: usize,
    on_rim: bool,
}

#[derive(Clone, Copy)]
enum Side {
    Inner,
    Between,
    Outer,
}

/// The layers between the outer triangulation and its image on the inner surface.
pub(super) struct Layered<'a> {
    base: &'a TriMesh,
    on_rim: Vec<bool>,
    levels: Vec<Vec<DVec3>>,
}

impl<'a> Layered<'a> {
    pub(super) fn new(base: &'a TriMesh, on_inner: &[DVec3], layers: u32) -> Self {
        let area = |positions: &[DVec3]| TriMesh::area_of(positions, &base.triangles);
        let growth = (area(&base.positions) / area(on_inner).max(f64::MIN_POSITIVE)).sqrt();
        let levels = (0..=layers)
            .map(|k| {
                let fraction = graded(growth, f64::from(k) / f64::from(layers));
                on_inner.iter().zip(&base.positions).map(|(a, b)| a.lerp(*b, fraction)).collect()
            })
            .collect();
        Self { base, on_rim: base.on_boundary(), levels }
    }

    fn split(&self) -> prisms::Split {
        prisms::split(&prisms::Layers { triangles: &self.base.triangles, levels: &self.levels })
    }

    /// Chooses diagonals, then moves nodes: surface nodes on their surface, rim nodes on their rim; the base's inner
    /// nodes stay on the lines between the rims.
    pub(super) fn optimise(&mut self, wall: &Wall) {
        self.improve(|place, p| match place.side {
            Side::Inner => Some(wall.inner_target.project(p, place.on_rim)),
            Side::Outer => Some(wall.outer_target.project(p, place.on_rim)),
            Side::Between => (!place.on_rim).then_some(p),
        });
    }

    /// The same with surface nodes sliding in their tangent planes and rim nodes along their rim's tangents.
    fn slide(&mut self) {
        let rim = self.base.rim_neighbours();
        let frames = |level: usize| {
            let mesh = TriMesh::new(self.levels[level].clone(), self.base.triangles.clone());
            let tangent = |v: usize| {
                let &[before, after] = rim.get(&(v as u32))?;
                Some((mesh.positions[after as usize] - mesh.positions[before as usize]).normalize_or_zero())
            };
            let normals = mesh.vertex_normals();
            (0..normals.len()).map(|v| (mesh.positions[v], normals[v], tangent(v))).collect::<Vec<_>>()
        };
        let (inner, outer) = (frames(0), frames(self.levels.len() - 1));
        let slid = |(origin, normal, tangent): (DVec3, DVec3, Option<DVec3>), p: DVec3| match tangent {
            Some(along) => origin + along * (p - origin).dot(along),
            None => origin + (p - origin).reject_from_normalized(normal),
        };
        self.improve(|place, p| match place.side {
            Side::Inner => Some(slid(inner[place.vertex], p)),
            Side::Outer => Some(slid(outer[place.vertex], p)),
            Side::Between => (!place.on_rim).then_some(p),
        });
    }

    fn improve(&mut self, admissible: impl Fn(Place, DVec3) -> Option<DVec3>) {
        let tets = self.split().tets;
        let vertices = self.base.positions.len();
        let top = self.levels.len() - 1;
        let mut positions = self.levels.concat();
        optimise::improve(&mut positions, &tets, SWEEPS, |node, p| {
            let vertex = node % vertices;
            let side = match node / vertices {
                0 => Side::Inner,
                level if level == top => Side::Outer,
                _ => Side::Between,
            };
            admissible(Place { side, vertex, on_rim: self.on_rim[vertex] }, p)
        });
        self.levels = positions.chunks(vertices).map(<[DVec3]>::to_vec).collect();
        self.straighten_base();
    }

    /// Base nodes between the rims go back on the straight lines, at their parts of them.
    fn straighten_base(&mut self) {
        let top = self.levels.len() - 1;
        for v in (0..self.on_rim.len()).filter(|&v| self.on_rim[v]) {
            let (a, b) = (self.levels[0][v], self.levels[top][v]);
            for level in 1..top {
                let part = (self.levels[level][v] - a).dot(b - a) / (b - a).length_squared();
                if part > 0.0 && part < 1.0 {
                    self.levels[level][v] = a.lerp(b, part);
                }
            }
        }
    }

    /// Moves the boundary to the surfaces' volume, and the layers between along; by less if that spoils the tets.
    pub(super) fn match_volume(&mut self, wall: &Wall) {
        let enough = WORST_KEPT * self.worst_ratio();
        let mut candidate = self.settled(wall, 1.0);
        for _ in 0..SETTLING_ROUNDS {
            candidate.slide();
            candidate = candidate.settled(wall, 1.0);
        }
        for scale in [0.75, 0.5, 0.25] {
            if candidate.worst_ratio() >= enough {
                *self = candidate;
                return;
            }
            candidate = self.settled(wall, scale);
        }
    }

    /// A copy moved by this part of the way to the surfaces' volume.
    fn settled(&self, wall: &Wall, scale: f64) -> Self {
        let top = self.levels.len() - 1;
        let base_normals = self.base_normals();
        let moves = |level: usize, clean, target| {
            let mesh = TriMesh::new(self.levels[level].clone(), self.base.triangles.clone());
            let settled = settle::settled(&mesh, clean, target, &base_normals);
            settled.iter().zip(&self.levels[level]).map(|(new, old)| *new - *old).collect::<Vec<_>>()
        };
        let inner = moves(0, &wall.inner, &wall.inner_target);
        let outer = moves(top, &wall.outer, &wall.outer_target);
        let mut levels = self.levels.clone();
        for (level, positions) in levels.iter_mut().enumerate() {
            let part = level as f64 / top as f64;
            for (v, p) in positions.iter_mut().enumerate() {
                *p += scale * inner[v].lerp(outer[v], part);
            }
        }
        Self { base: self.base, on_rim: self.on_rim.clone(), levels }
    }

    fn worst_ratio(&self) -> f64 {
        let positions = self.levels.concat();
        let tets = self.split().tets;
        tets.iter().map(|t| volume_length_ratio(t.map(|n| positions[n as usize]))).fold(f64::INFINITY, f64::min)
    }

    /// Unit normal of the base at every vertex on the rim: across both the rim and the wall.
    fn base_normals(&self) -> Vec<Option<DVec3>> {
        let rim = self.base.rim_neighbours();
        let (inner, outer) = (&self.levels[0], &self.levels[self.levels.len() - 1]);
        let at = |v: usize| {
            let &[before, after] = rim.get(&(v as u32))?;
            let along = outer[after as usize] - outer[before as usize];
            Some((outer[v] - inner[v]).cross(along).normalize_or(DVec3::Z))
        };
        (0..self.on_rim.len()).map(at).collect()
    }

    pub(super) fn finish(self, wall: &Wall, options: FillOptions) -> Result<Fill, FillError> {
        let mut parts = self.split();
        let positions = self.levels.concat();
        check_quality(&positions, &parts.tets, options.min_dihedral_deg)?;
        let mesh = TetMesh::new(positions, std::mem::take(&mut parts.tets))?;
        let found = mesh.tets().len() as u32;
        if (f64::from(found) / f64::from(options.target_tets) - 1.0).abs() > COUNT_TOLERANCE {
            return Err(FillError::CountMissed { wanted: options.target_tets, found });
        }
        let layers = self.levels.len() as u32 - 1;
        let report = report::measure(&mesh, &parts, wall, layers);
        let mut regions = vec![
            BoundaryRegion { name: "inner", triangles: parts.inner },
            BoundaryRegion { name: "outer", triangles: parts.outer },
        ];
        if !parts.base.is_empty() {
            regions.push(BoundaryRegion { name: "base", triangles: parts.base });
        }
        Ok(Fill { mesh, regions, report })
    }
}

/// Refuses inverted tets and dihedral angles below the wanted one, and says where.
fn check_quality(positions: &[DVec3], tets: &[[u32; 4]], wanted_deg: f64) -> Result<(), FillError> {
    let mut worst = (f64::INFINITY, DVec3::ZERO);
    for tet in tets {
        let corners = tet.map(|n| positions[n as usize]);
        let inverted = volume_length_ratio(corners) <= 1e-6;
        let angle = if inverted { 0.0 } else { dihedral_angles_deg(corners).into_iter().fold(180.0, f64::min) };
        if angle < worst.0 {
            worst = (angle, corners.iter().sum::<DVec3>() / 4.0);
        }
    }
    if worst.0 > 0.0 && worst.0 >= wanted_deg {
        return Ok(());
    }
    Err(FillError::Quality { at_m: worst.1, angle_deg: worst.0, wanted_deg })
}
