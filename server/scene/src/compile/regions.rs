//! Regions: which nodes, surface triangles and tets a selector chooses.
use super::{
    body::Body,
    located::Located,
    parts::{Part, SURFACE, WHOLE},
    unique_names,
};
use crate::document::{
    region::{NearestSelector, PlaneTable, RegionTable, Selector},
    source::{Fault, Where},
    words::did_you_mean,
};
use glam::DVec3;

/// Chosen nodes, vertices of the skin, surface triangles and tets.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Selection {
    nodes: Vec<bool>,
    /// None of a body of tets, whose surface has nodes.
    vertices: Vec<bool>,
    triangles: Vec<bool>,
    tets: Vec<bool>,
}

impl Selection {
    fn all(body: &Body, value: bool) -> Self {
        Self {
            nodes: vec![value; body.mesh.positions_m().len()],
            vertices: vec![value; body.skin.as_ref().map_or(0, |skin| skin.positions_m.len())],
            triangles: vec![value; body.triangle_count()],
            tets: vec![value; body.mesh.tet_count()],
        }
    }

    fn combine(mut self, other: &Self, rule: impl Fn(bool, bool) -> bool) -> Self {
        for (mine, theirs) in [
            (&mut self.nodes, &other.nodes),
            (&mut self.vertices, &other.vertices),
            (&mut self.triangles, &other.triangles),
            (&mut self.tets, &other.tets),
        ] {
            mine.iter_mut().zip(theirs).for_each(|(a, b)| *a = rule(*a, *b));
        }
        self
    }

    fn counts(&self) -> [usize; 3] {
        [&self.nodes, &self.triangles, &self.tets].map(|flags| flags.iter().filter(|&&flag| flag).count())
    }

    fn is_empty(&self) -> bool {
        self.counts() == [0; 3] && !self.vertices.contains(&true)
    }
}

fn chosen(flags: &[bool]) -> Vec<u32> {
    flags.iter().enumerate().filter(|(_, flag)| **flag).map(|(index, _)| index as u32).collect()
}

/// All named regions of a scene: the body's parts, and those selected.
pub(crate) struct Regions<'b> {
    body: &'b Body,
    selected: Vec<(String, Selection)>,
}

impl<'b> Regions<'b> {
    /// The predefined regions, then the scene's in order; a region may refer to those before it.
    pub(crate) fn define(tables: &[RegionTable], body: &'b Body) -> Result<Self, Fault> {
        unique_names("region", tables.iter().map(|table| table.name.as_str()))?;
        let mut regions = Self { body, selected: vec![(WHOLE.into(), Selection::all(body, true))] };
        regions.selected.push((SURFACE.into(), regions.surface()));
        for (index, table) in tables.iter().enumerate() {
            let at = Where::root("region").index(index);
            if [WHOLE, SURFACE].contains(&table.name.as_str()) || body.parts.iter().any(|part| part.name == table.name)
            {
                let message = format!("the region \"{}\" exists already: it is a part of the body", table.name);
                return Err(Fault::value(at.key("name"), message).help("give your region another name"));
            }
            let selection = regions.select(&table.select, &at.key("select"))?;
            if selection.is_empty() {
                let message =
                    format!("the region \"{}\" selects nothing: no node, surface triangle or tet", table.name);
                return Err(Fault::value(at.key("select"), message).help(body.extent()));
            }
            regions.selected.push((table.name.clone(), selection));
        }
        Ok(regions)
    }

    /// Counts of every region: nodes, surface triangles, tets.
    pub(crate) fn summaries(&self) -> impl Iterator<Item = (String, [usize; 3])> + '_ {
        let counts = |part: &Part| [part.nodes.len(), part.triangles.len(), part.tets.len()];
        let parts = self.body.parts.iter().map(move |part| (part.name.clone(), counts(part)));
        let mut counted = self.selected.iter().map(|(name, selection)| (name.clone(), selection.counts()));
        let always: Vec<_> = counted.by_ref().take(2).collect();
        always.into_iter().chain(parts).chain(counted)
    }

    /// Nodes of a region; none is an error.
    pub(crate) fn nodes(&self, name: &str, at: &Where) -> Result<Vec<u32>, Fault> {
        let selection = self.named(name, at)?;
        self.some(name, at, "nodes", &selection.nodes, &selection)
    }

    /// What forces on a region's nodes act at: vertices of the skin, where there is one; none is an error.
    pub(crate) fn loaded(&self, name: &str, at: &Where) -> Result<Vec<u32>, Fault> {
        if self.body.skin.is_none() {
            return self.nodes(name, at);
        }
        let selection = self.named(name, at)?;
        let vertices = self.some(name, at, "vertices of the skin", &selection.vertices, &selection)?;
        let first = self.body.first_vertex.unwrap_or_default();
        Ok(vertices.into_iter().map(|vertex| vertex + first).collect())
    }

    /// Surface triangles of a region; none is an error.
    pub(crate) fn triangles(&self, name: &str, at: &Where) -> Result<Vec<u32>, Fault> {
        let selection = self.named(name, at)?;
        self.some(name, at, "surface triangles", &selection.triangles, &selection)
    }

    /// Tets of a region; none is an error.
    pub(crate) fn tets(&self, name: &str, at: &Where) -> Result<Vec<u32>, Fault> {
        let selection = self.named(name, at)?;
        self.some(name, at, "tets", &selection.tets, &selection)
    }

    fn some(&self, name: &str, at: &Where, what: &str, flags: &[bool], of: &Selection) -> Result<Vec<u32>, Fault> {
        let found = chosen(flags);
        if !found.is_empty() {
            return Ok(found);
        }
        let [nodes, triangles, tets] = of.counts();
        let message = format!(
            "the region \"{name}\" selects no {what} (it has {nodes} nodes, {triangles} surface triangles and {tets} tets)"
        );
        Err(Fault::value(at.clone(), message).help(self.body.extent()))
    }

    fn named(&self, name: &str, at: &Where) -> Result<Selection, Fault> {
        if let Some((_, selection)) = self.selected.iter().find(|(known, _)| known == name) {
            return Ok(selection.clone());
        }
        if let Some(part) = self.body.parts.iter().find(|part| part.name == name) {
            return Ok(self.part(part));
        }
        let groups = self.groups_called(name);
        if groups.len() > 1 {
            return Err(ambiguous(name, &groups, at));
        }
        let parts = self.body.parts.iter().map(|part| part.name.as_str());
        let known: Vec<&str> = parts.chain(self.selected.iter().map(|(known, _)| known.as_str())).collect();
        Err(Fault::value(at.clone(), format!("there is no region \"{name}\"")).help(did_you_mean(name, &known)))
    }

    fn select(&self, selector: &Selector, at: &Where) -> Result<Selection, Fault> {
        let mut parts = Vec::new();
        if let Some(name) = &selector.region {
            parts.push(self.named(name, &at.key("region"))?);
        }
        if let Some(group) = &selector.physical_group {
            parts.push(self.physical_group(group, &at.key("physical_group"))?);
        }
        if let Some(plane) = &selector.plane {
            parts.push(self.near_plane(plane, &at.key("plane"))?);
        }
        if let Some(plane) = &selector.half_space {
            let (side, tolerance) = self.side(plane, &at.key("half_space"))?;
            parts.push(self.where_point(|p| side(p) >= -tolerance));
        }
        if let Some(block) = &selector.block {
            let (low, high) = (DVec3::from(block.min_m), DVec3::from(block.max_m));
            if !low.cmple(high).all() {
                return Err(Fault::value(at.key("box").key("min_m"), "min_m is not below max_m on every axis"));
            }
            parts.push(self.where_point(|p| p.cmpge(low).all() && p.cmple(high).all()));
        }
        if let Some(sphere) = &selector.sphere {
            let (centre, radius) = (DVec3::from(sphere.centre_m), sphere.radius_m);
            super::check(&at.key("sphere").key("radius_m"), radius, radius > 0.0, "must be larger than 0")?;
            parts.push(self.where_point(|p| p.distance(centre) <= radius));
        }
        if let Some(nearest) = &selector.nearest {
            super::check(&at.key("nearest").key("count"), nearest.count, nearest.count > 0, "must be 1 or larger")?;
            parts.push(self.nearest(nearest));
        }
        self.nested(selector, at, &mut parts)?;
        parts.into_iter().reduce(|all, one| all.combine(&one, |a, b| a && b)).ok_or_else(|| {
            Fault::value(at.clone(), "the selector is empty").help("to select everything write `region = \"whole\"`")
        })
    }

    fn nested(&self, selector: &Selector, at: &Where, parts: &mut Vec<Selection>) -> Result<(), Fault> {
        let fold = |key: &str, selectors: &[Selector], start: bool, rule: fn(bool, bool) -> bool| {
            if selectors.is_empty() {
                return Err(Fault::value(at.key(key), format!("`{key}` is empty")));
            }
            let mut selectors = selectors.iter().enumerate();
            selectors.try_fold(Selection::all(self.body, start), |folded, (index, selector)| {
                Ok(folded.combine(&self.select(selector, &at.key(key).index(index))?, rule))
            })
        };
        if let Some(selectors) = &selector.all_of {
            parts.push(fold("all_of", selectors, true, |a, b| a && b)?);
        }
        if let Some(selectors) = &selector.any_of {
            parts.push(fold("any_of", selectors, false, |a, b| a || b)?);
        }
        if let Some(selector) = &selector.not {
            let inside = self.select(selector, &at.key("not"))?;
            parts.push(Selection::all(self.body, true).combine(&inside, |_, inside| !inside));
        }
        Ok(())
    }

    /// The boundary: nodes, vertices and triangles, no tets.
    fn surface(&self) -> Selection {
        let mut selection = Selection::all(self.body, false);
        selection.vertices.fill(true);
        selection.triangles.fill(true);
        for &node in &self.body.surface.nodes {
            selection.nodes[node as usize] = true;
        }
        selection
    }

    fn part(&self, part: &Part) -> Selection {
        let mut selection = Selection::all(self.body, false);
        for (flags, chosen) in [
            (&mut selection.nodes, &part.nodes),
            (&mut selection.vertices, &part.vertices),
            (&mut selection.triangles, &part.triangles),
            (&mut selection.tets, &part.tets),
        ] {
            for &index in chosen {
                flags[index as usize] = true;
            }
        }
        selection
    }

    /// The physical groups that a name or number means.
    fn groups_called(&self, text: &str) -> Vec<&Part> {
        let called = |part: &&Part| part.group.as_ref().is_some_and(|group| group.is_called(text));
        self.body.parts.iter().filter(called).collect()
    }

    fn physical_group(&self, text: &str, at: &Where) -> Result<Selection, Fault> {
        match self.groups_called(text).as_slice() {
            [part] => Ok(self.part(part)),
            [] => {
                let groups = self.body.parts.iter().filter(|part| part.group.is_some());
                let known: Vec<&str> = groups.map(|part| part.name.as_str()).collect();
                let none = known.is_empty();
                let help = if none { "the mesh has no physical groups".into() } else { did_you_mean(text, &known) };
                Err(Fault::value(at.clone(), format!("there is no physical group \"{text}\"")).help(help))
            }
            several => Err(ambiguous(text, several, at)),
        }
    }

    /// Nodes and vertices by position, surface triangles and tets by their centroid: every one of them is either in a set of points
    /// or in its complement, and in the union of sets that together cover it.
    fn where_point(&self, inside: impl Fn(DVec3) -> bool) -> Selection {
        let positions = self.body.mesh.positions_m();
        let nodes = positions.iter().map(|&p| inside(p)).collect();
        let skin = self.body.skin.as_ref().map_or(&[][..], |skin| &skin.positions_m);
        let vertices = skin.iter().map(|&p| inside(p)).collect();
        let corners_m = self.body.surface_positions_m();
        let middle = |corners: [u32; 3]| corners.iter().map(|&corner| corners_m[corner as usize]).sum::<DVec3>() / 3.0;
        let triangles = self.body.triangles().map(|corners| inside(middle(corners))).collect();
        let tets = self.body.mesh.tet_middles_m().map(inside).collect();
        Selection { nodes, vertices, triangles, tets }
    }

    /// Signed distance (m) from a plane, and its tolerance (m).
    fn side(&self, plane: &PlaneTable, at: &Where) -> Result<(impl Fn(DVec3) -> f64 + use<>, f64), Fault> {
        const DEFAULT_TOLERANCE: f64 = 1e-6;
        let tolerance = plane.tolerance_m.unwrap_or(DEFAULT_TOLERANCE * self.body.diagonal_m());
        super::check(&at.key("tolerance_m"), tolerance, tolerance >= 0.0, "must not be negative")?;
        let normal = DVec3::from(plane.normal).try_normalize();
        let normal = normal.ok_or_else(|| Fault::value(at.key("normal"), "the normal has no length"))?;
        let point = DVec3::from(plane.point_m);
        Ok((move |p: DVec3| (p - point).dot(normal), tolerance))
    }

    fn near_plane(&self, plane: &PlaneTable, at: &Where) -> Result<Selection, Fault> {
        let (side, tolerance) = self.side(plane, at)?;
        let mut selection = self.where_point(|p| side(p).abs() <= tolerance);
        // A triangle lies in a plane with all its corners: one that crosses it may have its centroid there.
        let Selection { nodes, vertices, triangles, .. } = &mut selection;
        let corners_chosen = if self.body.skin.is_some() { vertices } else { nodes };
        for (chosen, corners) in triangles.iter_mut().zip(self.body.triangles()) {
            *chosen = corners.iter().all(|&corner| corners_chosen[corner as usize]);
        }
        Ok(selection)
    }

    fn nearest(&self, nearest: &NearestSelector) -> Selection {
        let mesh = &self.body.mesh;
        let point = DVec3::from(nearest.point_m);
        let mut selection = Selection::all(self.body, false);
        let distance = |node: &u32| mesh.positions_m()[*node as usize].distance(point);
        let all: Vec<u32> = (0..mesh.positions_m().len() as u32).collect();
        let nodes = if nearest.on_surface { &self.body.surface.nodes } else { &all };
        mark(&mut selection.nodes, nodes, nearest.count, distance);
        if let Some(skin) = &self.body.skin {
            let vertices: Vec<u32> = (0..skin.positions_m.len() as u32).collect();
            mark(&mut selection.vertices, &vertices, nearest.count, |&vertex| {
                skin.positions_m[vertex as usize].distance(point)
            });
        }
        let faces: Vec<[u32; 3]> = self.body.triangles().collect();
        let triangles: Vec<u32> = (0..faces.len() as u32).collect();
        mark(&mut selection.triangles, &triangles, nearest.count, |&triangle| {
            Located::on_triangle(self.body.surface_positions_m(), faces[triangle as usize], point).distance_m
        });
        let middles_m: Vec<DVec3> = mesh.tet_middles_m().collect();
        let tets: Vec<u32> = (0..middles_m.len() as u32).collect();
        mark(&mut selection.tets, &tets, nearest.count, |&tet| middles_m[tet as usize].distance(point));
        selection
    }
}

fn ambiguous(text: &str, groups: &[&Part], at: &Where) -> Fault {
    let names: Vec<String> = groups.iter().map(|part| format!("\"{}\"", part.name)).collect();
    Fault::value(at.clone(), format!("\"{text}\" means {} physical groups of the mesh", groups.len()))
        .help(format!("write one of {}", names.join(", ")))
}

/// Marks the `count` candidates with the smallest distance; of equals the first.
fn mark(flags: &mut [bool], candidates: &[u32], count: u32, distance: impl Fn(&u32) -> f64) {
    let mut ordered: Vec<(f64, u32)> = candidates.iter().map(|candidate| (distance(candidate), *candidate)).collect();
    ordered.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    for (_, index) in ordered.into_iter().take(count as usize) {
        flags[index as usize] = true;
    }
}
