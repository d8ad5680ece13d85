//! Named parts of a body: sides of a shape, or the physical groups of a mesh file.
use crate::{
    files::{Group, GroupedMesh, Members},
    shapes::BoundaryRegion,
    skin::FineSurface,
};
use palpate_physics::{Surface, TetMesh, mesh::tet::FACES};
use std::collections::{BTreeSet, HashMap};

/// Regions of every body.
pub(crate) const WHOLE: &str = "whole";
pub(crate) const SURFACE: &str = "surface";

/// A named part of a body.
#[derive(Debug, Clone)]
pub(crate) struct Part {
    /// Name, unique.
    pub(crate) name: String,
    /// The physical group it is, if it is one.
    pub(crate) group: Option<Group>,
    pub(crate) nodes: Vec<u32>,
    /// Vertices of the skin; none of a body of tets.
    pub(crate) vertices: Vec<u32>,
    /// Triangles of the surface: of the skin, where there is one.
    pub(crate) triangles: Vec<u32>,
    pub(crate) tets: Vec<u32>,
}

impl Part {
    /// Goes over to a skin: of its triangles, those that came from what is wanted.
    pub(crate) fn go_over_to(&mut self, skin: &FineSurface, wanted: impl Fn(u32) -> bool) {
        self.triangles = skin.triangles_from(wanted);
        let corners = self.triangles.iter().flat_map(|&triangle| skin.triangles[triangle as usize]);
        self.vertices = corners.collect::<BTreeSet<u32>>().into_iter().collect();
    }
}

/// Surface triangles by their nodes.
struct Boundary {
    triangle_of: HashMap<[u32; 3], u32>,
}

impl Boundary {
    fn of(surface: &Surface) -> Self {
        let faces = (0..surface.triangles.len()).map(|triangle| sorted(surface.triangle_nodes(triangle)));
        Self { triangle_of: faces.zip(0..).collect() }
    }

    /// Surface triangles among node triples.
    fn among<'a>(&'a self, faces: impl Iterator<Item = [u32; 3]> + 'a) -> impl Iterator<Item = u32> + 'a {
        faces.filter_map(|face| self.triangle_of.get(&sorted(face)).copied())
    }
}

fn sorted(mut face: [u32; 3]) -> [u32; 3] {
    face.sort_unstable();
    face
}

/// Parts of a shape's boundary.
pub(crate) fn of_boundary(regions: &[BoundaryRegion], surface: &Surface) -> Vec<Part> {
    let boundary = Boundary::of(surface);
    let part = |region: &BoundaryRegion| Part {
        name: region.name.to_owned(),
        group: None,
        nodes: region.nodes(),
        vertices: Vec::new(),
        triangles: boundary.among(region.triangles.iter().copied()).collect(),
        tets: Vec::new(),
    };
    regions.iter().map(part).collect()
}

/// A part for every physical group. A surface triangle belongs to a group of tets when the tet behind it does, to a
/// group of triangles when it is one of them.
pub(crate) fn of_groups(grouped: &GroupedMesh, surface: &Surface) -> Vec<Part> {
    let boundary = Boundary::of(surface);
    let part = |((group, name), members): ((&Group, String), Members)| {
        let behind = members.tets.iter().flat_map(|&tet| faces_of(&grouped.mesh, tet));
        let triangles: BTreeSet<u32> = boundary.among(behind.chain(members.triangles.iter().copied())).collect();
        Part {
            name,
            group: Some(group.clone()),
            nodes: members.nodes,
            vertices: Vec::new(),
            triangles: triangles.into_iter().collect(),
            tets: members.tets,
        }
    };
    // Tets that belong to no group have a group without a name.
    let named = grouped.groups.iter().zip(names(&grouped.groups)).zip(grouped.members());
    named.filter(|((group, _), _)| !group.name.is_empty()).map(part).collect()
}

fn faces_of(mesh: &TetMesh, tet: u32) -> [[u32; 3]; 4] {
    FACES.map(|face| face.map(|corner| mesh.tets()[tet as usize][corner]))
}

/// For every group the shortest text that means no other and no region of every body.
fn names(groups: &[Group]) -> Vec<String> {
    let spellings = |group: &Group| {
        let (kind, name, tag) = (group.kind(), group.name.clone(), group.tag);
        [name.clone(), format!("{kind} {name}"), format!("{kind} {tag}"), tag.to_string()]
    };
    let mut meant: HashMap<String, usize> = HashMap::from([(WHOLE.into(), 1), (SURFACE.into(), 1)]);
    for group in groups {
        for spelling in BTreeSet::from(spellings(group)) {
            *meant.entry(spelling).or_default() += 1;
        }
    }
    let name = |group: &Group| {
        let [name, qualified, numbered, _] = spellings(group);
        [name, qualified].into_iter().find(|spelling| meant[spelling] == 1).unwrap_or(numbered)
    };
    groups.iter().map(name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_are_called_by_name_unless_that_means_another() {
        let group = |dimension, tag: i64, name: &str| Group { name: name.to_owned(), dimension, tag };
        let groups = [
            group(3, 1, "1"),
            group(2, 1, "1"),
            group(3, 5, "wall"),
            group(2, 6, "wall"),
            group(2, 7, "surface"),
            group(0, 8, "apex"),
            group(2, 9, "seam"),
            group(2, 10, "seam"),
        ];
        let wanted = [
            "volume 1",
            "surface 1",
            "volume wall",
            "surface wall",
            "surface surface",
            "apex",
            "surface 9",
            "surface 10",
        ];
        assert_eq!(names(&groups), wanted);
        for (group, name) in groups.iter().zip(&wanted) {
            assert!(
                group.is_called(name) && groups.iter().filter(|other| other.is_called(name)).count() == 1,
                "{name}"
            );
        }
    }
}
