//! The boundary of a tetrahedral mesh: what tools touch and viewers see.
use super::tet::{FACES, MeshError, TetMesh};
use glam::DVec3;
use std::collections::BTreeMap;

/// Boundary triangles over *surface vertices*, which are numbered from 0 in ascending order of their nodes.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    /// Node of each surface vertex, ascending.
    pub nodes: Vec<u32>,
    /// Triangles as surface-vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Surface vertex of each node, or `u32::MAX` for interior nodes.
    pub vertex_of_node: Vec<u32>,
}

impl Surface {
    /// Extracts the faces that belong to exactly one tet, in order of tet and face.
    ///
    /// # Errors
    /// [`MeshError::NonManifoldFace`] when a face belongs to more than two tets, [`MeshError::Overlapping`] when two lie on the same side
    /// of one.
    pub fn of(mesh: &TetMesh) -> Result<Self, MeshError> {
        // Of each face: the first tet that has it, its sense there, and how many have it.
        let mut owners: BTreeMap<[u32; 3], (usize, bool, u32)> = BTreeMap::new();
        let faces = || mesh.tets().iter().flat_map(|tet| FACES.map(|face| face.map(|corner| tet[corner])));
        for (index, face) in faces().enumerate() {
            let (tet, sense) = (index / FACES.len(), is_ascending_cycle(face));
            let owner = owners.entry(sorted(face)).or_insert((tet, sense, 0));
            owner.2 += 1;
            if owner.2 > 2 {
                return Err(MeshError::NonManifoldFace { face: sorted(face) });
            }
            // Seen from outside, two neighbours go round their face in opposite senses.
            if owner.1 == sense && owner.2 == 2 {
                return Err(MeshError::Overlapping { tets: [owner.0, tet], face: sorted(face) });
            }
        }
        let boundary: Vec<[u32; 3]> = faces().filter(|&face| owners[&sorted(face)].2 == 1).collect();
        Ok(Self::of_triangles(mesh.positions_m().len(), &boundary))
    }

    /// A surface by itself: every vertex is its own node.
    pub fn alone(vertices: usize, triangles: Vec<[u32; 3]>) -> Self {
        let nodes: Vec<u32> = (0..vertices as u32).collect();
        Self { vertex_of_node: nodes.clone(), nodes, triangles }
    }

    /// The surface of triangles that are given by their nodes, among so many.
    pub(crate) fn of_triangles(nodes: usize, triangles: &[[u32; 3]]) -> Self {
        let mut vertex_of_node = vec![u32::MAX; nodes];
        triangles.iter().flatten().for_each(|&node| vertex_of_node[node as usize] = 0);
        let used: Vec<u32> = (0..nodes as u32).filter(|&node| vertex_of_node[node as usize] == 0).collect();
        for (vertex, &node) in (0..).zip(&used) {
            vertex_of_node[node as usize] = vertex;
        }
        let triangles = triangles.iter().map(|corners| corners.map(|node| vertex_of_node[node as usize])).collect();
        Self { nodes: used, triangles, vertex_of_node }
    }

    /// Nodes of a triangle.
    pub fn triangle_nodes(&self, triangle: usize) -> [u32; 3] {
        self.triangles[triangle].map(|vertex| self.nodes[vertex as usize])
    }

    /// The longest edge (m) of a triangle, its nodes at these positions (m).
    pub fn longest_edge_m(&self, triangle: usize, positions_m: &[DVec3]) -> f64 {
        let [a, b, c] = self.triangle_nodes(triangle).map(|node| positions_m[node as usize]);
        a.distance(b).max(b.distance(c)).max(c.distance(a))
    }
}

/// Whether the corners follow each other, round and round, in ascending order.
fn is_ascending_cycle([a, b, c]: [u32; 3]) -> bool {
    !((a < b) ^ (b < c) ^ (c < a))
}

fn sorted(mut face: [u32; 3]) -> [u32; 3] {
    face.sort_unstable();
    face
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn tets_on_the_same_side_of_a_face_are_refused() {
        let p = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.3, 0.3, 0.7)];
        for twin in [[0, 1, 2, 3], [1, 2, 0, 3], [0, 1, 2, 4]] {
            let mesh = TetMesh::new(p.clone(), vec![[0, 1, 2, 3], twin, [1, 2, 3, 4]]).unwrap();
            let error = Surface::of(&mesh).unwrap_err();
            assert!(matches!(error, MeshError::Overlapping { .. }), "{error}");
        }
    }

    #[test]
    fn two_tets_share_one_face_and_show_six() {
        let p = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE];
        let mesh = TetMesh::new(p, vec![[0, 1, 2, 3], [1, 2, 3, 4]]).unwrap();
        let surface = Surface::of(&mesh).unwrap();
        assert_eq!(surface.triangles.len(), 6);
        assert_eq!(surface.nodes, vec![0, 1, 2, 3, 4]);
        // Closed and outward: the enclosed volume (divergence theorem) is the tets' volume.
        let volume: f64 = (0..6)
            .map(|t| {
                let [a, b, c] = surface.triangle_nodes(t).map(|n| mesh.positions_m()[n as usize]);
                a.dot(b.cross(c)) / 6.0
            })
            .sum();
        assert!((volume - mesh.total_volume_m3()).abs() < 1e-15);
    }
}
