//! From a file's volume to the mesh of a body.
use super::error::{FileError, Place, Problem};
use super::{Group, VolumeFile};
use crate::wording::left_out;
use palpate_physics::{MeshError, TetMesh};

/// What to do with nodes that belong to no tet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UnusedNodes {
    /// Leave them out, and say how many.
    Drop,
    /// Refuse the mesh.
    Refuse,
}

/// A checked mesh in metres with the groups of its file. All indices are those of the mesh, not of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct GroupedMesh {
    /// The mesh (m).
    pub mesh: TetMesh,
    /// For every tet, its (first) group as an index into `groups`.
    pub tet_group: Vec<u32>,
    /// Tets of a further group; empty unless groups overlap.
    pub more_tet_groups: Vec<(usize, Vec<u32>)>,
    /// Groups in order of appearance.
    pub groups: Vec<Group>,
    /// Triangles by group: index into `groups`, node indices. Triangles with a dropped node are left out.
    pub surface_groups: Vec<(usize, Vec<[u32; 3]>)>,
    /// Nodes by group: index into `groups`, node indices. Dropped nodes are left out.
    pub node_groups: Vec<(usize, Vec<u32>)>,
    /// For every node, its index among the file's nodes.
    pub file_node: Vec<u32>,
    /// What was skipped or changed, for the user to read.
    pub warnings: Vec<String>,
    /// What was skipped without a loss, for the user to read.
    pub notes: Vec<String>,
}

/// What belongs to a group.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Members {
    /// Tets, ascending.
    pub tets: Vec<u32>,
    /// Triangles of the file, as nodes.
    pub triangles: Vec<[u32; 3]>,
    /// Its nodes and those of its tets and triangles, ascending.
    pub nodes: Vec<u32>,
}

impl GroupedMesh {
    /// What belongs to each of the groups.
    pub fn members(&self) -> Vec<Members> {
        let mut all = vec![Members::default(); self.groups.len()];
        for (tet, &group) in self.tet_group.iter().enumerate() {
            all[group as usize].tets.push(tet as u32);
        }
        for (group, tets) in &self.more_tet_groups {
            all[*group].tets.extend(tets);
        }
        for (group, triangles) in &self.surface_groups {
            all[*group].triangles.extend(triangles);
        }
        for (group, nodes) in &self.node_groups {
            all[*group].nodes.extend(nodes);
        }
        for members in &mut all {
            let Members { tets, triangles, nodes } = members;
            sort(tets);
            nodes.extend(tets.iter().flat_map(|&tet| self.mesh.tets()[tet as usize]));
            nodes.extend(triangles.iter().flatten());
            sort(nodes);
        }
        all
    }
}

fn sort(indices: &mut Vec<u32>) {
    indices.sort_unstable();
    indices.dedup();
}

impl VolumeFile {
    /// The mesh in metres, one file unit being `scale_to_m` metres.
    ///
    /// Where *all* tets are inverted the file counts their nodes the other way round: they are turned, with a warning.
    ///
    /// # Errors
    /// A scale that is no length; unused nodes when refused; inverted or degenerate tets and whatever else
    /// [`TetMesh::new`] refuses.
    pub fn into_tet_mesh(mut self, scale_to_m: f64, unused: UnusedNodes) -> Result<GroupedMesh, FileError> {
        if !(scale_to_m > 0.0 && scale_to_m.is_finite()) {
            return Err(self.fail(Problem::Scale { scale: scale_to_m }));
        }
        self.check_indices()?;
        self.orient()?;
        let file_node = self.used_nodes(unused)?;
        let mut node_of = vec![None; self.mesh_nodes.len()];
        for (node, &from) in file_node.iter().enumerate() {
            node_of[from as usize] = Some(node as u32);
        }
        let positions_m = file_node.iter().map(|&from| self.mesh_nodes[from as usize] * scale_to_m).collect();
        for node in self.tets.iter_mut().flatten() {
            *node = node_of[*node as usize].unwrap_or(u32::MAX);
        }
        let tets = std::mem::take(&mut self.tets);
        let mesh = TetMesh::new(positions_m, tets).map_err(|error| self.fail(Problem::Mesh(error)))?;
        let renumber = |node: u32| node_of.get(node as usize).copied().flatten();
        let corners = |t: &[u32; 3]| Some([renumber(t[0])?, renumber(t[1])?, renumber(t[2])?]);
        let triangles = |of: Vec<[u32; 3]>| of.iter().filter_map(corners).collect();
        let points = |of: Vec<u32>| of.into_iter().filter_map(renumber).collect();
        Ok(GroupedMesh {
            mesh,
            tet_group: self.tet_group,
            more_tet_groups: self.more_tet_groups,
            groups: self.groups,
            surface_groups: self.surface_groups.into_iter().map(|(group, of)| (group, triangles(of))).collect(),
            node_groups: self.node_groups.into_iter().map(|(group, of)| (group, points(of))).collect(),
            file_node,
            warnings: self.warnings,
            notes: self.notes,
        })
    }

    fn fail(&self, problem: Problem) -> FileError {
        FileError::new(&self.path, Place::File, problem)
    }

    fn check_indices(&self) -> Result<(), FileError> {
        let nodes = self.mesh_nodes.len();
        for (tet, corners) in self.tets.iter().enumerate() {
            if let Some(&node) = corners.iter().find(|&&node| node as usize >= nodes) {
                return Err(self.fail(Problem::Mesh(MeshError::NodeOutOfRange { tet, node, nodes })));
            }
        }
        Ok(())
    }

    /// Turns every tet of the file's own when all of them are inverted; refuses a mixture.
    fn orient(&mut self) -> Result<(), FileError> {
        const NAMED: usize = 5;
        let own = self.own_tets.min(self.tets.len());
        let inverted: Vec<usize> = (0..own).filter(|&tet| self.is_inverted(tet)).collect();
        if inverted.is_empty() {
            return Ok(());
        }
        if inverted.len() < own {
            let first = inverted.iter().copied().take(NAMED).collect();
            return Err(self.fail(Problem::Inverted { count: inverted.len(), total: own, first }));
        }
        for tet in &mut self.tets[..own] {
            tet.swap(2, 3);
        }
        self.warnings.push("all tetrahedra are inverted: their nodes are taken in the other order".to_string());
        Ok(())
    }

    fn is_inverted(&self, tet: usize) -> bool {
        let [a, b, c, d] = self.tets[tet].map(|node| self.mesh_nodes[node as usize]);
        (b - a).cross(c - a).dot(d - a) < 0.0
    }

    /// The nodes that tets use, ascending.
    fn used_nodes(&mut self, policy: UnusedNodes) -> Result<Vec<u32>, FileError> {
        let mut used = vec![false; self.mesh_nodes.len()];
        for &node in self.tets.iter().flatten() {
            used[node as usize] = true;
        }
        let count = used.iter().filter(|&&u| !u).count();
        if let Some(node) = used.iter().position(|u| !u) {
            if policy == UnusedNodes::Refuse {
                return Err(self.fail(Problem::Mesh(MeshError::UnusedNode { node, count })));
            }
            let is_unused = |&&node: &&u32| used.get(node as usize) == Some(&false);
            let of_geometry = self.of_geometry.iter().filter(is_unused).count();
            if of_geometry > 0 {
                self.notes.push(left_out(of_geometry, "node of the geometry", "belong to no tetrahedron"));
            }
            if count > of_geometry {
                self.warnings.push(left_out(count - of_geometry, "node", "belong to no tetrahedron"));
            }
        }
        Ok((0..used.len() as u32).filter(|&node| used[node as usize]).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use std::path::PathBuf;

    /// Two tets on one face, node 4 unused.
    fn volume() -> VolumeFile {
        let group = |name: &str, dimension, tag| Group { name: name.to_string(), dimension, tag };
        VolumeFile {
            path: PathBuf::from("two.msh"),
            mesh_nodes: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_ONE, DVec3::ONE],
            tets: vec![[0, 1, 2, 3], [1, 2, 3, 5]],
            own_tets: 2,
            tet_group: vec![0, 1],
            more_tet_groups: vec![(3, vec![0])],
            groups: vec![group("wall", 3, 7), group("8", 3, 8), group("inside", 2, 7), group("both", 3, 9)],
            surface_groups: vec![(2, vec![[1, 2, 3], [0, 1, 4]])],
            node_groups: vec![],
            of_geometry: vec![],
            warnings: vec![],
            notes: vec![],
        }
    }

    #[test]
    fn scales_renumbers_and_keeps_groups() {
        let mesh = volume().into_tet_mesh(1e-3, UnusedNodes::Drop).unwrap();
        assert_eq!(mesh.file_node, [0, 1, 2, 3, 5]);
        assert_eq!(mesh.mesh.tets(), [[0, 1, 2, 3], [1, 2, 3, 4]]);
        // A sixth of a cube and a third of it, in mm³.
        assert!((mesh.mesh.total_volume_m3() - 0.5e-9).abs() < 1e-22);
        assert_eq!(mesh.surface_groups, [(2, vec![[1, 2, 3]])]);
        let members = mesh.members();
        assert_eq!([0, 1, 2, 3].map(|group| members[group].tets.as_slice()), [&[0][..], &[1], &[], &[0]]);
        assert_eq!((&members[2].triangles, &members[2].nodes), (&vec![[1, 2, 3]], &vec![1, 2, 3]));
        assert!(mesh.warnings[0].starts_with("1 node that belongs to no tet"));
    }

    #[test]
    fn unused_nodes_are_refused_when_asked() {
        let error = volume().into_tet_mesh(1.0, UnusedNodes::Refuse).unwrap_err();
        assert!(error.to_string().starts_with("two.msh: node 4 belongs to no tet"), "{error}");
    }

    #[test]
    fn turned_only_when_all_are_inverted() {
        let mut all = volume();
        all.tets.iter_mut().for_each(|tet| tet.swap(0, 1));
        let mesh = all.into_tet_mesh(1.0, UnusedNodes::Drop).unwrap();
        assert!((mesh.mesh.total_volume_m3() - 0.5).abs() < 1e-15);
        assert!(mesh.warnings.iter().any(|w| w.contains("other order")), "{:?}", mesh.warnings);

        let mut one = volume();
        one.tets[1].swap(0, 1);
        let error = one.into_tet_mesh(1.0, UnusedNodes::Drop).unwrap_err();
        assert!(error.to_string().contains("1 of 2 tetrahedra are inverted (numbers 1,"), "{error}");
    }

    #[test]
    fn bad_scales_and_indices_are_named() {
        for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(
                *volume().into_tet_mesh(scale, UnusedNodes::Drop).unwrap_err().problem,
                Problem::Scale { .. }
            ));
        }
        let mut wild = volume();
        wild.tets[0][2] = 77;
        let error = wild.into_tet_mesh(1.0, UnusedNodes::Drop).unwrap_err().to_string();
        assert!(error.contains("tet 0 refers to node 77"), "{error}");
    }
}
