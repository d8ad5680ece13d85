//! Collects what the readers of the single formats find, and makes a volume or a surface of it.
use super::cursor::shown;
use super::error::{FileError, Place, Problem};
use super::solids::Solids;
use super::split::{Face, Solid};
use super::{Group, SurfaceFile, VolumeFile};
use crate::wording::{counted_as, joined, left_out};
use glam::DVec3;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

/// What becomes of an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shape {
    Point,
    Triangle,
    Polygon,
    Tet,
    /// Split into tetrahedra.
    Solid(Solid),
    /// A line of the geometry that was meshed: read past, and no loss to volumes and surfaces.
    Curve,
    /// Read past, and counted.
    Other,
}

/// An element type of a format.
#[derive(Debug, Clone, Copy)]
pub(super) struct Kind {
    pub(super) shape: Shape,
    /// Name in messages, plural.
    pub(super) name: &'static str,
    /// Nodes at the corners; they come first.
    pub(super) corners: usize,
}

impl Kind {
    pub(super) fn solid(solid: Solid) -> Self {
        Self { shape: Shape::Solid(solid), name: solid.name(), corners: solid.corners() }
    }
}

/// A mesh in the making. Node indices are checked by the readers, who know the place of an error.
#[derive(Debug, Default)]
pub(super) struct Builder {
    pub(super) nodes: Vec<DVec3>,
    pub(super) warnings: Vec<String>,
    notes: Vec<String>,
    /// Names of physical groups by dimension and tag; may come before or after the elements.
    pub(super) names: HashMap<(u8, i64), String>,
    groups: Vec<(u8, Option<i64>)>,
    group_of: HashMap<(u8, Option<i64>), u32>,
    tets: Vec<[u32; 4]>,
    tet_group: Vec<u32>,
    tet_of: HashMap<[u32; 4], u32>,
    more_tet_groups: BTreeMap<usize, Vec<u32>>,
    repeated_tets: usize,
    solids: Solids,
    triangles: Vec<[u32; 3]>,
    surface_groups: BTreeMap<usize, Vec<[u32; 3]>>,
    node_groups: BTreeMap<usize, Vec<u32>>,
    skipped: BTreeMap<&'static str, usize>,
    higher_order: BTreeMap<&'static str, usize>,
    /// Arrays that nothing uses and that could not be read, and why.
    left_out: BTreeMap<String, String>,
    curves: usize,
    /// Points without a group.
    points: usize,
    /// Nodes of curves, and of points without a group.
    of_geometry: Vec<u32>,
}

impl Builder {
    /// Adds an element over `nodes` that belongs to the groups `tags` of its dimension.
    pub(super) fn element(&mut self, kind: Kind, nodes: &[u32], tags: &[i64]) {
        let corners = &nodes[..kind.corners.min(nodes.len())];
        match (kind.shape, corners) {
            (Shape::Tet, &[a, b, c, d]) => self.tet([a, b, c, d], tags),
            (Shape::Solid(solid), _) if corners.len() == kind.corners => self.solids.add(solid, corners, tags),
            (Shape::Triangle, &[a, b, c]) => self.triangle([a, b, c], tags),
            // Cut as the faces of solids are, on one of which it may lie.
            (Shape::Polygon, &[_, _, _, _]) => match Face::of(corners) {
                Some(face) => face.triangles().for_each(|triangle| self.triangle(triangle, tags)),
                None => return *self.skipped.entry("faces of fewer than three corners").or_default() += 1,
            },
            (Shape::Polygon, &[first, _, _, ..]) => {
                for pair in corners[1..].windows(2) {
                    self.triangle([first, pair[0], pair[1]], tags);
                }
            }
            (Shape::Polygon, _) => {
                return *self.skipped.entry("faces of fewer than three corners").or_default() += 1;
            }
            (Shape::Curve, _) => {
                self.of_geometry.extend(nodes);
                return self.curves += 1;
            }
            (Shape::Point, &[node]) if tags.is_empty() => {
                self.of_geometry.push(node);
                self.points += 1;
            }
            (Shape::Point, &[node]) => {
                for &tag in tags {
                    let group = self.group(0, Some(tag)) as usize;
                    self.node_groups.entry(group).or_default().push(node);
                }
            }
            _ => return *self.skipped.entry(kind.name).or_default() += 1,
        }
        if nodes.len() > corners.len() {
            *self.higher_order.entry(kind.name).or_default() += 1;
        }
    }

    fn tet(&mut self, nodes: [u32; 4], tags: &[i64]) {
        let mut key = nodes;
        key.sort_unstable();
        let new = self.tets.len() as u32;
        let tet = *self.tet_of.entry(key).or_insert(new);
        let mut tags = tags.iter();
        if tet == new {
            let group = self.group(3, tags.next().copied());
            self.tets.push(nodes);
            self.tet_group.push(group);
        } else if tags.len() == 0 {
            self.repeated_tets += 1;
        }
        for &tag in tags {
            let group = self.group(3, Some(tag));
            let first = &mut self.tet_group[tet as usize];
            if self.groups[*first as usize] == (3, None) {
                // Listed before without a group.
                *first = group;
            } else if *first == group {
                self.repeated_tets += 1;
            } else {
                self.more_tet_groups.entry(group as usize).or_default().push(tet);
            }
        }
    }

    fn triangle(&mut self, nodes: [u32; 3], tags: &[i64]) {
        self.triangles.push(nodes);
        for &tag in tags {
            let group = self.group(2, Some(tag)) as usize;
            self.surface_groups.entry(group).or_default().push(nodes);
        }
    }

    /// Puts a node into a group of points.
    pub(super) fn node_in_group(&mut self, node: u32, tag: i64) {
        let group = self.group(0, Some(tag)) as usize;
        self.node_groups.entry(group).or_default().push(node);
    }

    /// A node that no element has: of the geometry, such as the centre of an arc.
    pub(super) fn lone_node(&mut self, node: u32) {
        self.of_geometry.push(node);
    }

    /// Tells of something that the body loses nothing by.
    pub(super) fn note(&mut self, text: String) {
        self.notes.push(text);
    }

    /// Tells of an array that nothing uses why it is left out.
    pub(super) fn leave_out(&mut self, array: &str, why: impl FnOnce() -> String) {
        // VTK writes blanks in names so.
        let name = shown(array.replace("%20", " ").as_bytes());
        self.left_out.entry(name).or_insert_with(why);
    }

    fn group(&mut self, dimension: u8, tag: Option<i64>) -> u32 {
        let groups = &mut self.groups;
        *self.group_of.entry((dimension, tag)).or_insert_with(|| {
            groups.push((dimension, tag));
            groups.len() as u32 - 1
        })
    }

    fn named_groups(&self) -> Vec<Group> {
        let named = |&(dimension, tag): &(u8, Option<i64>)| {
            let name = match tag {
                None => String::new(),
                Some(tag) => self.names.get(&(dimension, tag)).cloned().unwrap_or_else(|| tag.to_string()),
            };
            Group { name, dimension, tag: tag.unwrap_or(0) }
        };
        self.groups.iter().map(named).collect()
    }

    /// What the file holds, for the message that it is not what was wanted.
    fn inventory(&self) -> String {
        let mut parts = vec![counted_as(self.nodes.len(), "nodes")];
        if !self.triangles.is_empty() {
            parts.push(counted_as(self.triangles.len(), "triangles"));
        }
        if !self.tets.is_empty() {
            parts.push(counted_as(self.tets.len(), "tetrahedra"));
        }
        parts.extend(self.solids.counted());
        if self.curves > 0 {
            parts.push(counted_as(self.curves, "lines"));
        }
        parts.extend(counted(&self.skipped));
        parts.join(", ")
    }

    /// Tells what was skipped or changed; `split` says what was split.
    fn tell(&mut self, split: Option<String>) {
        const NAMED: usize = 5;
        let geometry: Vec<String> = [(self.curves, "lines"), (self.points, "points")]
            .into_iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, what)| counted_as(count, what))
            .collect();
        let verb = if self.curves + self.points == 1 { "was" } else { "were" };
        let left = (!geometry.is_empty()).then(|| format!("{} of the geometry {verb} left out", joined(&geometry)));
        let told: Vec<String> = split.into_iter().chain(left).collect();
        if !told.is_empty() {
            self.notes.push(told.join("; "));
        }
        if !self.left_out.is_empty() {
            let mut named: Vec<_> =
                self.left_out.iter().take(NAMED).map(|(name, why)| format!("`{name}` ({why})")).collect();
            if self.left_out.len() > NAMED {
                named.push(format!("… ({} in all)", self.left_out.len()));
            }
            self.warnings.push(format!("arrays that nothing uses are left out: {}", named.join(", ")));
        }
        self.of_geometry.sort_unstable();
        self.of_geometry.dedup();
        if !self.skipped.is_empty() {
            let skipped = counted(&self.skipped).join(", ");
            self.warnings.push(format!("not used: {skipped}"));
        }
        if !self.higher_order.is_empty() {
            let curved = counted(&self.higher_order).join(", ");
            self.warnings.push(format!("of {curved} the corner nodes are used, the nodes between them are not"));
        }
        let mut repeated = self.solids.repeated.clone();
        if self.repeated_tets > 0 {
            repeated.insert("tetrahedra", self.repeated_tets);
        }
        if !repeated.is_empty() {
            let repeated: Vec<String> = repeated.iter().map(|(what, &count)| counted_as(count, what)).collect();
            self.warnings.push(format!("repeated elements are used once: {}", joined(&repeated)));
        }
    }

    /// The volume, if there are tets.
    pub(super) fn into_volume(mut self, path: &Path) -> Result<VolumeFile, FileError> {
        if self.tets.is_empty() && self.solids.is_empty() {
            return Err(FileError::new(path, Place::File, Problem::NoTets { found: self.inventory() }));
        }
        let own_tets = self.tets.len();
        let told = self.split_solids().map_err(|problem| FileError::new(path, Place::File, problem))?;
        self.tell(told);
        Ok(VolumeFile {
            path: path.to_path_buf(),
            own_tets,
            groups: self.named_groups(),
            mesh_nodes: self.nodes,
            tets: self.tets,
            tet_group: self.tet_group,
            more_tet_groups: self.more_tet_groups.into_iter().collect(),
            surface_groups: self.surface_groups.into_iter().collect(),
            node_groups: self.node_groups.into_iter().collect(),
            of_geometry: self.of_geometry,
            warnings: self.warnings,
            notes: self.notes,
        })
    }

    /// Puts the tetrahedra of solids behind the file's own; what to say of it.
    fn split_solids(&mut self) -> Result<Option<String>, Problem> {
        let mut split = self.solids.split(&mut self.nodes)?;
        split.check_fit(&self.tets, self.nodes.len());
        for (tet, solid) in split.tets {
            self.tet(tet, &split.tags[solid as usize]);
        }
        self.warnings.append(&mut split.warnings);
        self.notes.append(&mut split.notes);
        Ok(split.told)
    }

    /// The surface, if there are triangles: every triangle of the file and the vertices they use.
    pub(super) fn into_surface(mut self, path: &Path) -> Result<SurfaceFile, FileError> {
        let all = self.triangles.len();
        self.triangles.retain(|&[a, b, c]| a != b && b != c && c != a);
        if self.triangles.is_empty() {
            return Err(FileError::new(path, Place::File, Problem::NoTriangles { found: self.inventory() }));
        }
        self.tell(None);
        let collapsed = all - self.triangles.len();
        if collapsed > 0 {
            self.warnings.push(left_out(collapsed, "triangle", "use a vertex twice"));
        }
        let mut index_of = vec![u32::MAX; self.nodes.len()];
        let mut vertices = Vec::new();
        for node in self.triangles.iter().flatten() {
            if index_of[*node as usize] == u32::MAX {
                index_of[*node as usize] = 0;
            }
        }
        for (node, index) in index_of.iter_mut().enumerate().filter(|(_, index)| **index == 0) {
            *index = vertices.len() as u32;
            vertices.push(self.nodes[node]);
        }
        let unused_by_geometry = |&node: &&u32| index_of[*node as usize] == u32::MAX;
        let of_geometry = self.of_geometry.iter().filter(unused_by_geometry).count();
        if of_geometry > 0 {
            self.notes.push(left_out(of_geometry, "point of the geometry", "belong to no triangle"));
        }
        let unused = self.nodes.len() - vertices.len() - of_geometry;
        if unused > 0 {
            self.warnings.push(left_out(unused, "point", "belong to no triangle"));
        }
        let triangles = self.triangles.iter().map(|t| t.map(|node| index_of[node as usize])).collect();
        Ok(SurfaceFile { vertices, triangles, warnings: self.warnings, notes: self.notes })
    }
}

fn counted(counts: &BTreeMap<&'static str, usize>) -> Vec<String> {
    counts.iter().map(|(name, count)| counted_as(*count, name)).collect()
}
