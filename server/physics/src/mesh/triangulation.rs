//! The topology of a triangle surface: edges, neighbours and boundaries.
pub use super::triangulation_error::TriangulationError;
use glam::DVec3;
use std::collections::BTreeMap;

/// Stands for no triangle, or no vertex.
pub const NONE: u32 = u32::MAX;

/// A triangle surface, open or closed, on which every edge has one or two triangles, and the triangles around a vertex
/// are one fan.
#[derive(Debug, Clone, PartialEq)]
pub struct Triangulation {
    positions_m: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    edges: Vec<Edge>,
    /// Edges of each triangle, the first from its first to its second corner, and so on.
    triangle_edges: Vec<[u32; 3]>,
    /// Edges at each vertex, ascending.
    edges_at: Vec<u32>,
    /// First entry of each vertex in `edges_at`, then the end of the last one's.
    first_edge_at: Vec<u32>,
    triangles_at: Vec<u32>,
    first_triangle_at: Vec<u32>,
}

/// An edge with the triangles on its sides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Edge {
    /// Ends, ascending.
    pub nodes: [u32; 2],
    /// Triangles on either side; on a boundary the second one is [`NONE`].
    pub triangles: [u32; 2],
    /// The corner of each of these triangles that is not on the edge; on a boundary the second one is [`NONE`].
    pub opposite: [u32; 2],
}

impl Edge {
    /// Returns whether the edge lies on a boundary: it has a triangle on one side only.
    pub fn is_boundary(&self) -> bool {
        self.triangles[1] == NONE
    }
}

/// A triangle whose doubled area is less than this times the square of its longest edge counts as having no area.
const NO_AREA: f64 = 1e-12;
/// Largest number of triangles or vertices: refinement makes up to four times as many triangles, whose corners are
/// numbered in 32 bits.
const MOST: usize = (u32::MAX / 8) as usize;

impl Triangulation {
    /// Checks a surface and finds its edges.
    ///
    /// # Errors
    /// The first [`TriangulationError`] found.
    pub fn new(positions_m: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Result<Self, TriangulationError> {
        use TriangulationError as Error;
        if triangles.is_empty() {
            return Err(Error::Empty);
        }
        for (what, count) in [("triangles", triangles.len()), ("vertices", positions_m.len())] {
            if count > MOST {
                return Err(Error::TooMany { what, count, most: MOST });
            }
        }
        if let Some(vertex) = positions_m.iter().position(|p| !p.is_finite()) {
            return Err(Error::NonFinite { vertex, position: positions_m[vertex] });
        }
        let vertices = positions_m.len();
        for (triangle, &corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices) {
                return Err(Error::OutOfRange { triangle, vertex, vertices });
            }
            if !has_area(corners.map(|v| positions_m[v as usize])) {
                return Err(Error::NoArea { triangle, corners });
            }
        }
        let (edges, triangle_edges) = find_edges(&triangles)?;
        let (first_edge_at, edges_at) = at_vertices(vertices, edges.iter().map(|edge| edge.nodes));
        let (first_triangle_at, triangles_at) = at_vertices(vertices, triangles.iter().copied());
        let own = Self {
            positions_m,
            triangles,
            edges,
            triangle_edges,
            edges_at,
            first_edge_at,
            triangles_at,
            first_triangle_at,
        };
        own.check_vertices()?;
        Ok(own)
    }

    /// Returns the positions (m) of the vertices.
    pub fn positions_m(&self) -> &[DVec3] {
        &self.positions_m
    }

    /// Returns the corners of the triangles, counter-clockwise seen from outside.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Returns the edges, ascending by their ends.
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// Returns the edges of a triangle, the first from its first to its second corner, and so on.
    pub fn edges_of(&self, triangle: u32) -> [u32; 3] {
        self.triangle_edges[triangle as usize]
    }

    /// Returns the edges at a vertex, ascending.
    pub fn edges_at(&self, vertex: u32) -> &[u32] {
        let first = &self.first_edge_at;
        &self.edges_at[first[vertex as usize] as usize..first[vertex as usize + 1] as usize]
    }

    /// Returns the triangles at a vertex, ascending.
    pub fn triangles_at(&self, vertex: u32) -> &[u32] {
        let first = &self.first_triangle_at;
        &self.triangles_at[first[vertex as usize] as usize..first[vertex as usize + 1] as usize]
    }

    /// Returns the other ends of the edges at a vertex.
    pub fn neighbours(&self, vertex: u32) -> impl Iterator<Item = u32> + '_ {
        self.edges_at(vertex).iter().map(move |&edge| self.other_end(edge, vertex))
    }

    /// Returns the other end of an edge.
    pub fn other_end(&self, edge: u32, vertex: u32) -> u32 {
        let [a, b] = self.edges[edge as usize].nodes;
        if a == vertex { b } else { a }
    }

    /// Returns the edge between two vertices, if there is one.
    pub fn edge_between(&self, a: u32, b: u32) -> Option<u32> {
        self.edges_at(a).iter().copied().find(|&edge| self.other_end(edge, a) == b)
    }

    /// Returns whether a vertex lies on a boundary.
    pub fn is_boundary(&self, vertex: u32) -> bool {
        self.edges_at(vertex).iter().any(|&edge| self.edges[edge as usize].is_boundary())
    }

    /// Returns whether no edge lies on a boundary.
    pub fn is_closed(&self) -> bool {
        !self.edges.iter().any(Edge::is_boundary)
    }

    /// Returns the length (m) of an edge.
    pub fn length_m(&self, edge: u32) -> f64 {
        let [a, b] = self.edges[edge as usize].nodes;
        self.positions_m[a as usize].distance(self.positions_m[b as usize])
    }

    /// Returns the area (m²) of a triangle.
    pub fn area_m2(&self, triangle: u32) -> f64 {
        let [a, b, c] = self.triangles[triangle as usize].map(|v| self.positions_m[v as usize]);
        0.5 * (b - a).cross(c - a).length()
    }

    /// Returns the tributary area (m²) of each vertex, a third of that of its triangles.
    pub fn vertex_areas_m2(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.positions_m.len()];
        for triangle in 0..self.triangles.len() as u32 {
            let third = self.area_m2(triangle) / 3.0;
            self.triangles[triangle as usize].iter().for_each(|&vertex| areas[vertex as usize] += third);
        }
        areas
    }

    /// Returns the same surface with its vertices at other positions (m).
    ///
    /// # Errors
    /// A position is not finite, or a triangle has no area there.
    pub fn moved(&self, positions_m: Vec<DVec3>) -> Result<Self, TriangulationError> {
        Self::new(positions_m, self.triangles.clone())
    }

    fn check_vertices(&self) -> Result<(), TriangulationError> {
        for vertex in 0..self.positions_m.len() as u32 {
            if self.triangles_at(vertex).is_empty() {
                return Err(TriangulationError::Isolated { vertex: vertex as usize });
            }
            let mut left = self.triangles_at(vertex).to_vec();
            let mut fans = 0;
            while let Some(&first) = left.first() {
                let fan = self.fan(vertex, first);
                left.retain(|triangle| !fan.contains(triangle));
                fans += 1;
            }
            if fans > 1 {
                return Err(TriangulationError::SeveralFans { vertex: vertex as usize, fans });
            }
        }
        Ok(())
    }

    /// Returns the triangles at a vertex that are connected with one of them through edges at the vertex.
    fn fan(&self, vertex: u32, first: u32) -> Vec<u32> {
        let (mut fan, mut next) = (vec![first], 0);
        while next < fan.len() {
            for edge in self.edges_of(fan[next]).map(|edge| self.edges[edge as usize]) {
                let across = edge.triangles.into_iter().filter(|t| *t != NONE && edge.nodes.contains(&vertex));
                for triangle in across {
                    if !fan.contains(&triangle) {
                        fan.push(triangle);
                    }
                }
            }
            next += 1;
        }
        fan
    }
}

fn has_area([a, b, c]: [DVec3; 3]) -> bool {
    let longest_sq = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
    (b - a).cross(c - a).length() > NO_AREA * longest_sq
}

type Found = (Vec<Edge>, Vec<[u32; 3]>);

fn find_edges(triangles: &[[u32; 3]]) -> Result<Found, TriangulationError> {
    // Triangles at each edge, with the corner across and the sense in which they go along it.
    let mut sides: BTreeMap<[u32; 2], Vec<(u32, u32, bool)>> = BTreeMap::new();
    for (number, &[a, b, c]) in (0..).zip(triangles) {
        for (from, to, across) in [(a, b, c), (b, c, a), (c, a, b)] {
            sides.entry([from.min(to), from.max(to)]).or_default().push((number, across, from < to));
        }
    }
    let mut edges = Vec::with_capacity(sides.len());
    let mut triangle_edges = vec![[NONE; 3]; triangles.len()];
    for (number, (nodes, at)) in (0..).zip(sides) {
        if at.len() > 2 {
            return Err(TriangulationError::CrowdedEdge { edge: nodes, count: at.len() });
        }
        if let [first, second] = at[..]
            && first.2 == second.2
        {
            return Err(TriangulationError::Turned { triangles: [first.0, second.0], edge: nodes });
        }
        let side = |n: usize| at.get(n).map_or((NONE, NONE), |side| (side.0, side.1));
        let (one, other) = (side(0), side(1));
        edges.push(Edge { nodes, triangles: [one.0, other.0], opposite: [one.1, other.1] });
        for (triangle, _, _) in at {
            let corners = triangles[triangle as usize];
            let place = (0..3).find(|&k| !nodes.contains(&corners[(k + 2) % 3])).unwrap_or_default();
            triangle_edges[triangle as usize][place] = number;
        }
    }
    Ok((edges, triangle_edges))
}

/// Returns the elements that have each vertex among their corners, ascending: the first entry of each vertex, then all
/// entries.
fn at_vertices<const N: usize>(vertices: usize, of: impl Iterator<Item = [u32; N]> + Clone) -> (Vec<u32>, Vec<u32>) {
    let mut first = vec![0_u32; vertices + 1];
    for corners in of.clone() {
        for v in corners {
            first[v as usize + 1] += 1;
        }
    }
    for v in 0..vertices {
        first[v + 1] += first[v];
    }
    let mut at = vec![0; first[vertices] as usize];
    let mut next = first.clone();
    for (number, corners) in (0..).zip(of) {
        for v in corners {
            at[next[v as usize] as usize] = number;
            next[v as usize] += 1;
        }
    }
    (first, at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::mass_spring::testing::hexagon;

    fn square() -> (Vec<DVec3>, Vec<[u32; 3]>) {
        (vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y], vec![[0, 1, 2], [0, 2, 3]])
    }

    #[test]
    fn edges_and_triangles_know_each_other() {
        let patch = hexagon(3, 0.03);
        assert_eq!(patch.positions_m().len(), 37);
        assert_eq!(patch.triangles().len(), 54);
        // Euler: V − E + F = 1 of a disk.
        assert_eq!(37 + 54, patch.edges().len() + 1);
        for (triangle, corners) in (0..).zip(patch.triangles()) {
            for (place, edge) in patch.edges_of(triangle).into_iter().enumerate() {
                let edge = patch.edges()[edge as usize];
                let ends = [corners[place], corners[(place + 1) % 3]];
                assert_eq!(edge.nodes, [ends[0].min(ends[1]), ends[0].max(ends[1])]);
                let side = edge.triangles.iter().position(|&t| t == triangle).unwrap();
                assert_eq!(edge.opposite[side], corners[(place + 2) % 3]);
            }
        }
        for vertex in 0..37 {
            let inside = !patch.is_boundary(vertex);
            assert_eq!(patch.neighbours(vertex).count() == 6, inside);
            assert!(patch.neighbours(vertex).all(|other| patch.edge_between(vertex, other).is_some()));
        }
        let areas: f64 = patch.vertex_areas_m2().iter().sum();
        assert!((areas / (54.0 * 0.03_f64.powi(2) * 3.0_f64.sqrt() / 4.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_surface_is_refused_with_its_place() {
        let (p, t) = square();
        let new = |p: &[DVec3], t: &[[u32; 3]]| Triangulation::new(p.to_vec(), t.to_vec()).unwrap_err();
        assert!(Triangulation::new(p.clone(), t.clone()).is_ok());
        assert_eq!(new(&p, &[]), TriangulationError::Empty);
        assert_eq!(new(&p, &[[0, 1, 7]]), TriangulationError::OutOfRange { triangle: 0, vertex: 7, vertices: 4 });
        assert_eq!(new(&p, &[t[0], [0, 2, 2]]), TriangulationError::NoArea { triangle: 1, corners: [0, 2, 2] });
        let mut line = p.clone();
        line[2] = DVec3::X * 0.5;
        assert!(matches!(new(&line, &t), TriangulationError::NoArea { triangle: 0, .. }));
        assert_eq!(new(&p, &[t[0], [0, 3, 2]]), TriangulationError::Turned { triangles: [0, 1], edge: [0, 2] });
        assert_eq!(new(&p, &t[..1]), TriangulationError::Isolated { vertex: 3 });
        let mut wing = p.clone();
        wing.push(DVec3::Z);
        let crowded = [t[0], t[1], [0, 2, 4]];
        assert_eq!(new(&wing, &crowded), TriangulationError::CrowdedEdge { edge: [0, 2], count: 3 });
        wing[4] = DVec3::NAN;
        assert!(matches!(new(&wing, &t), TriangulationError::NonFinite { vertex: 4, .. }));
        // Two triangles that touch in vertex 0 only.
        let bow = [p[0], p[1], p[2], -p[1], -p[2]];
        assert_eq!(new(&bow, &[[0, 1, 2], [0, 3, 4]]), TriangulationError::SeveralFans { vertex: 0, fans: 2 });
    }
}
