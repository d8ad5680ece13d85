//! A tetrahedral mesh at rest, checked once so that nothing behind it needs to check again.
use glam::{DMat3, DVec3};
use thiserror::Error;

/// Tetrahedra over nodes. Every tet is positively oriented: `(x1−x0)×(x2−x0)·(x3−x0) > 0`.
#[derive(Debug, Clone, PartialEq)]
pub struct TetMesh {
    positions_m: Vec<DVec3>,
    tets: Vec<[u32; 4]>,
}

/// Why a mesh cannot carry a body.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MeshError {
    /// No tetrahedra at all.
    #[error("the mesh has no tetrahedra (it has {nodes} nodes); a body needs at least one")]
    Empty {
        /// Number of nodes present.
        nodes: usize,
    },
    /// More nodes or tets than 32-bit indices can name.
    #[error("the mesh has {count} {what}, more than 4294967295")]
    TooLarge {
        /// `nodes` or `tets`.
        what: &'static str,
        /// How many.
        count: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("node {node} has a coordinate that is not finite: {position}")]
    NonFinite {
        /// Index of the node, from 0.
        node: usize,
        /// Its position.
        position: DVec3,
    },
    /// A tet names a node that does not exist.
    #[error("tet {tet} refers to node {node}, but there are only {nodes} nodes (counting from 0)")]
    NodeOutOfRange {
        /// Index of the tet, from 0.
        tet: usize,
        /// The node it names.
        node: u32,
        /// Number of nodes.
        nodes: usize,
    },
    /// A tet names one node twice.
    #[error("tet {tet} uses node {node} more than once")]
    RepeatedNode {
        /// Index of the tet.
        tet: usize,
        /// The node repeated.
        node: u32,
    },
    /// A tet has (nearly) no volume.
    #[error("tet {tet} is degenerate: volume {volume_m3:e} m³ with longest edge {longest_edge_m:e} m")]
    Degenerate {
        /// Index of the tet.
        tet: usize,
        /// Signed volume (m³).
        volume_m3: f64,
        /// Longest edge (m).
        longest_edge_m: f64,
    },
    /// A tet has negative volume.
    #[error("tet {tet} is inverted (volume {volume_m3:e} m³); swap two of its nodes")]
    Inverted {
        /// Index of the tet.
        tet: usize,
        /// Signed volume (m³).
        volume_m3: f64,
    },
    /// A node belongs to no tet: it would have no mass.
    #[error("node {node} belongs to no tet ({count} such nodes); remove unused nodes")]
    UnusedNode {
        /// The first such node.
        node: usize,
        /// How many there are.
        count: usize,
    },
    /// Two tets lie on the same side of a face.
    #[error(
        "tets {} and {} overlap: both lie on the same side of face ({}, {}, {}); is one there twice?",
        tets[0], tets[1], face[0], face[1], face[2]
    )]
    Overlapping {
        /// Their indices.
        tets: [usize; 2],
        /// Node indices of the face, ascending.
        face: [u32; 3],
    },
    /// A face belongs to more than two tets.
    #[error("face ({}, {}, {}) belongs to more than two tets; the mesh is not a manifold", face[0], face[1], face[2])]
    NonManifoldFace {
        /// Node indices of the face, ascending.
        face: [u32; 3],
    },
}

/// Volume below this fraction of (longest edge)³ counts as degenerate: rounding would decide its sign.
const DEGENERATE_VOLUME_RATIO: f64 = 1e-12;

impl TetMesh {
    /// Checks and takes a mesh: `positions_m` (m), `tets` as node indices from 0.
    ///
    /// # Errors
    /// The first [`MeshError`] found; the mesh is not repaired silently.
    pub fn new(positions_m: Vec<DVec3>, tets: Vec<[u32; 4]>) -> Result<Self, MeshError> {
        if tets.is_empty() {
            return Err(MeshError::Empty { nodes: positions_m.len() });
        }
        for (what, count) in [("nodes", positions_m.len()), ("tets", tets.len())] {
            if u32::try_from(count).is_err() {
                return Err(MeshError::TooLarge { what, count });
            }
        }
        if let Some(node) = positions_m.iter().position(|p| !p.is_finite()) {
            return Err(MeshError::NonFinite { node, position: positions_m[node] });
        }
        let mesh = Self { positions_m, tets };
        for tet in 0..mesh.tets.len() {
            mesh.check_tet(tet)?;
        }
        mesh.check_every_node_used()?;
        Ok(mesh)
    }

    fn check_tet(&self, tet: usize) -> Result<(), MeshError> {
        let nodes = self.tets[tet];
        for (corner, &node) in nodes.iter().enumerate() {
            if node as usize >= self.positions_m.len() {
                return Err(MeshError::NodeOutOfRange { tet, node, nodes: self.positions_m.len() });
            }
            if nodes[..corner].contains(&node) {
                return Err(MeshError::RepeatedNode { tet, node });
            }
        }
        let volume_m3 = self.volume_m3(tet);
        let longest_edge_m = self.longest_edge_m(tet);
        if volume_m3.abs() <= DEGENERATE_VOLUME_RATIO * longest_edge_m.powi(3) {
            return Err(MeshError::Degenerate { tet, volume_m3, longest_edge_m });
        }
        if volume_m3 < 0.0 {
            return Err(MeshError::Inverted { tet, volume_m3 });
        }
        Ok(())
    }

    fn check_every_node_used(&self) -> Result<(), MeshError> {
        let mut used = vec![false; self.positions_m.len()];
        for &node in self.tets.iter().flatten() {
            used[node as usize] = true;
        }
        match used.iter().position(|u| !u) {
            Some(node) => Err(MeshError::UnusedNode { node, count: used.iter().filter(|&&u| !u).count() }),
            None => Ok(()),
        }
    }

    /// Rest positions (m), one per node.
    pub fn positions_m(&self) -> &[DVec3] {
        &self.positions_m
    }

    /// Node indices of every tet.
    pub fn tets(&self) -> &[[u32; 4]] {
        &self.tets
    }

    /// Corner positions (m) of a tet.
    pub fn corners_m(&self, tet: usize) -> [DVec3; 4] {
        self.tets[tet].map(|node| self.positions_m[node as usize])
    }

    /// Edge matrix `D = [x1−x0, x2−x0, x3−x0]` (m).
    pub fn edge_matrix_m(&self, tet: usize) -> DMat3 {
        let [a, b, c, d] = self.corners_m(tet);
        DMat3::from_cols(b - a, c - a, d - a)
    }

    /// Signed volume `det(D)/6` (m³).
    pub fn volume_m3(&self, tet: usize) -> f64 {
        self.edge_matrix_m(tet).determinant() / 6.0
    }

    /// Sum of the tets' volumes (m³).
    pub fn total_volume_m3(&self) -> f64 {
        (0..self.tets.len()).map(|tet| self.volume_m3(tet)).sum()
    }

    /// Length (m) of a tet's longest edge.
    pub fn longest_edge_m(&self, tet: usize) -> f64 {
        let corners = self.corners_m(tet);
        EDGES.iter().map(|&[a, b]| corners[a].distance(corners[b])).fold(0.0, f64::max)
    }

    /// Smallest and largest corner (m) of the bounding box.
    pub fn bounds_m(&self) -> (DVec3, DVec3) {
        self.positions_m.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(lo, hi), &p| (lo.min(p), hi.max(p)))
    }
}

/// The six edges of a tet as pairs of corners.
pub const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// The four faces of a positively oriented tet, each seen counter-clockwise from outside; face `i` lies opposite corner `i`.
pub const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

#[cfg(test)]
mod tests {
    use super::*;

    fn unit() -> (Vec<DVec3>, Vec<[u32; 4]>) {
        (vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z], vec![[0, 1, 2, 3]])
    }

    #[test]
    fn unit_tet_has_a_sixth_of_a_cube() {
        let (p, t) = unit();
        let mesh = TetMesh::new(p, t).unwrap();
        assert!((mesh.total_volume_m3() - 1.0 / 6.0).abs() < 1e-15);
    }

    #[test]
    fn faces_point_outwards() {
        let (p, _) = unit();
        let centre = p.iter().sum::<DVec3>() / 4.0;
        for face in FACES {
            let [a, b, c] = face.map(|i| p[i]);
            assert!((b - a).cross(c - a).dot(a - centre) > 0.0, "{face:?}");
        }
    }

    #[test]
    fn each_defect_has_its_own_message() {
        let (p, t) = unit();
        let with = |p: Vec<DVec3>, t: Vec<[u32; 4]>| TetMesh::new(p, t).unwrap_err().to_string();
        assert!(with(p.clone(), vec![]).contains("no tetrahedra"));
        assert!(with(p.clone(), vec![[0, 2, 1, 3]]).contains("inverted"));
        assert!(with(p.clone(), vec![[0, 1, 2, 4]]).contains("only 4 nodes"));
        assert!(with(p.clone(), vec![[0, 1, 2, 2]]).contains("more than once"));
        let mut flat = p.clone();
        flat[3] = DVec3::new(0.3, 0.3, 0.0);
        assert!(with(flat, t.clone()).contains("degenerate"));
        let mut nan = p.clone();
        nan[1].x = f64::NAN;
        assert!(with(nan, t.clone()).contains("not finite"));
        let mut extra = p;
        extra.push(DVec3::ONE);
        assert!(with(extra, t).contains("no tet"));
    }
}
