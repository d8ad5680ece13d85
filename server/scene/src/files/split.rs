//! The rule by which hexahedra, prisms and pyramids become tetrahedra that fit those of their neighbours.
//!
//! A face of four corners is cut along the diagonal through its node of least number. The two solids beside it cut it
//! alike then, for the rule knows the face alone; so does a quadrangle of the surface that lies on it. (Dompierre,
//! Labbé, Vallet and Camarero 1999, "How to Subdivide Pyramids, Prisms and Hexahedra into Tetrahedra".)
//!
//! The solid's own node of least number is on the diagonal of every face that has it. The triangles of all other faces,
//! joined to that node, fill a convex solid: a pyramid by 2 tetrahedra, a prism by 3, a hexahedron by 5 or 6.

/// A solid that is cut into tetrahedra. Its corners are numbered as Gmsh, VTK, MEDIT and XDMF do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) enum Solid {
    /// A quadrangle, and the one above it.
    Hexahedron,
    /// A triangle, and the one above it.
    Prism,
    /// A quadrangle, and the apex.
    Pyramid,
}

/// The most corners of a solid.
pub(super) const MOST_CORNERS: usize = 8;

impl Solid {
    /// How many corners it has.
    pub(super) fn corners(self) -> usize {
        match self {
            Self::Hexahedron => 8,
            Self::Prism => 6,
            Self::Pyramid => 5,
        }
    }

    /// Its name in messages, plural.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Hexahedron => "hexahedra",
            Self::Prism => "prisms",
            Self::Pyramid => "pyramids",
        }
    }

    /// Corners of its faces, counter-clockwise seen from outside.
    fn faces(self) -> &'static [&'static [usize]] {
        match self {
            Self::Hexahedron => {
                &[&[0, 3, 2, 1], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]]
            }
            Self::Prism => &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]],
            Self::Pyramid => &[&[0, 3, 2, 1], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]],
        }
    }

    /// Its faces over the nodes of its corners, without those that corners which fall together leave of no area.
    pub(super) fn faces_over(self, nodes: &[u32; MOST_CORNERS]) -> impl Iterator<Item = Face> {
        self.faces().iter().filter_map(|face| match **face {
            [a, b, c] => Face::of(&[a, b, c].map(|corner| nodes[corner])),
            [a, b, c, d] => Face::of(&[a, b, c, d].map(|corner| nodes[corner])),
            _ => None,
        })
    }

    /// The tetrahedra that fill it, none of which uses a node twice. Corners may fall together: a hexahedron some of
    /// whose corners are one node, as ANSYS writes prisms, pyramids and tetrahedra, gives those of what is left of it.
    pub(super) fn tets(self, nodes: &[u32; MOST_CORNERS]) -> Vec<[u32; 4]> {
        let least = nodes[..self.corners()].iter().copied().min().unwrap_or(0);
        let far = self.faces_over(nodes).flat_map(Face::triangles).filter(|triangle| !triangle.contains(&least));
        let mut tets: Vec<[u32; 4]> = far.map(|[a, b, c]| [least, a, b, c]).collect();
        if self == Self::Hexahedron && tets.len() == 6 {
            cut_off_corner(nodes, least, &mut tets);
        }
        tets
    }

    /// The tetrahedra between `middle`, a node within, and every triangle of its faces.
    pub(super) fn tets_around(self, nodes: &[u32; MOST_CORNERS], middle: u32) -> Vec<[u32; 4]> {
        self.faces_over(nodes).flat_map(Face::triangles).map(|[a, b, c]| [middle, a, b, c]).collect()
    }
}

/// Where no diagonal ends in the corner opposite to the node of least number, the three tetrahedra around the edge
/// between both are two: the corner that its three neighbours cut off, and what is behind it.
fn cut_off_corner(nodes: &[u32; MOST_CORNERS], least: u32, tets: &mut Vec<[u32; 4]>) {
    const OPPOSITE: [usize; MOST_CORNERS] = [6, 7, 4, 5, 2, 3, 0, 1];
    let Some(place) = nodes.iter().position(|&node| node == least) else { return };
    let corner = nodes[OPPOSITE[place]];
    // Edges of the far triangles at the corner, in the order in which they go around it.
    let edges: Vec<[u32; 2]> = tets.iter().filter_map(|&[_, a, b, c]| opposite_edge([a, b, c], corner)).collect();
    let &[[a, b], other, another] = edges.as_slice() else { return };
    let c = if other[0] == b { other[1] } else { another[1] };
    tets.retain(|tet| !tet.contains(&corner));
    tets.push([least, a, b, c]);
    tets.push([corner, a, c, b]);
}

/// The edge of a triangle that does not have `corner`, in the triangle's order.
fn opposite_edge([a, b, c]: [u32; 3], corner: u32) -> Option<[u32; 2]> {
    match corner {
        _ if corner == a => Some([b, c]),
        _ if corner == b => Some([c, a]),
        _ if corner == c => Some([a, b]),
        _ => None,
    }
}

/// A face of three or four different nodes, begun with that of least number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Face {
    Triangle([u32; 3]),
    Quadrangle([u32; 4]),
}

impl Face {
    /// The face of three or four corners, of which neighbours may be one node; none, if no area is left between them.
    pub(super) fn of(corners: &[u32]) -> Option<Self> {
        let mut different = [0; 4];
        let mut count = 0;
        for (place, &node) in corners.iter().enumerate().take(4) {
            if node != corners[(place + corners.len() - 1) % corners.len()] {
                different[count] = node;
                count += 1;
            }
        }
        if count < 3 {
            return None;
        }
        let least = (0..count).min_by_key(|&place| different[place]).unwrap_or(0);
        different[..count].rotate_left(least);
        match different {
            [a, b, c, _] if count == 3 => Some(Self::Triangle([a, b, c])),
            // Folded onto itself.
            [a, b, c, d] if a == c || b == d => None,
            corners => Some(Self::Quadrangle(corners)),
        }
    }

    /// The same for every face of the same corners.
    pub(super) fn key(self) -> [u32; 4] {
        let mut key = match self {
            Self::Triangle([a, b, c]) => [a, b, c, u32::MAX],
            Self::Quadrangle(corners) => corners,
        };
        key.sort_unstable();
        key
    }

    /// Whether the node behind that of least number has a greater one than the node before: seen from the other side it
    /// is the other way.
    pub(super) fn is_descending(self) -> bool {
        match self {
            Self::Triangle([_, after, before]) | Self::Quadrangle([_, after, _, before]) => after > before,
        }
    }

    /// Its triangles, seen from the same side as it.
    pub(super) fn triangles(self) -> impl Iterator<Item = [u32; 3]> {
        let [one, two] = match self {
            Self::Triangle(corners) => [Some(corners), None],
            Self::Quadrangle([a, b, c, d]) => [Some([a, b, c]), Some([a, c, d])],
        };
        one.into_iter().chain(two)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    const HEXAHEDRON: [[f64; 3]; 8] = [
        [0., 0., 0.],
        [1., 0., 0.],
        [1., 1., 0.],
        [0., 1., 0.],
        [0., 0., 1.],
        [1., 0., 1.],
        [1., 1., 1.],
        [0., 1., 1.],
    ];
    const PRISM: [[f64; 3]; 6] = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [1., 0., 1.], [0., 1., 1.]];
    const PYRAMID: [[f64; 3]; 5] = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.], [0.3, 0.4, 1.]];

    fn padded(nodes: &[u32]) -> [u32; MOST_CORNERS] {
        let mut all = [0; MOST_CORNERS];
        all[..nodes.len()].copy_from_slice(nodes);
        all
    }

    /// Least and total volume of the tets, `place` being the position of every node.
    fn volumes(tets: &[[u32; 4]], place: impl Fn(u32) -> DVec3) -> (f64, f64) {
        let volume = |tet: &[u32; 4]| {
            let [a, b, c, d] = tet.map(&place);
            (b - a).cross(c - a).dot(d - a) / 6.0
        };
        let all: Vec<f64> = tets.iter().map(volume).collect();
        (all.iter().copied().fold(f64::INFINITY, f64::min), all.iter().sum())
    }

    /// Every order in which so many nodes can be numbered.
    fn orders(count: u32) -> Vec<Vec<u32>> {
        if count == 0 {
            return vec![vec![]];
        }
        let insert = |order: &Vec<u32>, at: usize| [&order[..at], &[count - 1], &order[at..]].concat();
        orders(count - 1).iter().flat_map(|order| (0..=order.len()).map(move |at| insert(order, at))).collect()
    }

    /// Whatever the numbers of the corners: upright tets that fill the solid, whose faces on it are those of its faces.
    fn filled_in_every_order(solid: Solid, corners: &[[f64; 3]], volume: f64, counts: &[usize]) {
        let mut seen = std::collections::BTreeSet::new();
        for order in orders(corners.len() as u32) {
            let nodes = padded(&order);
            let tets = solid.tets(&nodes);
            let position = |node: u32| DVec3::from(corners[order.iter().position(|&n| n == node).unwrap()]);
            let (least, total) = volumes(&tets, position);
            assert!(least > 0.01 && (total - volume).abs() < 1e-14, "{solid:?} {order:?}: {least}, {total}");
            // Faces that no two tets share are those that the rule gives of the solid's.
            let mut open = std::collections::BTreeSet::new();
            for [a, b, c, d] in tets.iter().copied() {
                for mut face in [[b, c, d], [a, d, c], [a, b, d], [a, c, b]] {
                    face.sort_unstable();
                    if !open.remove(&face) {
                        open.insert(face);
                    }
                }
            }
            let sorted = |mut t: [u32; 3]| {
                t.sort_unstable();
                t
            };
            let wanted = solid.faces_over(&nodes).flat_map(Face::triangles).map(sorted).collect();
            assert_eq!(open, wanted, "{solid:?} {order:?}");
            seen.insert(tets.len());
        }
        assert_eq!(seen.into_iter().collect::<Vec<_>>(), counts);
    }

    #[test]
    fn every_numbering_of_every_solid_is_filled() {
        filled_in_every_order(Solid::Pyramid, &PYRAMID, 1.0 / 3.0, &[2]);
        filled_in_every_order(Solid::Prism, &PRISM, 0.5, &[3]);
        filled_in_every_order(Solid::Hexahedron, &HEXAHEDRON, 1.0, &[5, 6]);
    }

    /// With a node in the middle: a tet for every triangle of the faces.
    #[test]
    fn around_a_middle() {
        let nodes = [3, 1, 4, 0, 5, 7, 2, 6];
        let tets = Solid::Hexahedron.tets_around(&nodes, 8);
        let position = |node: u32| match nodes.iter().position(|&n| n == node) {
            Some(corner) => DVec3::from(HEXAHEDRON[corner]),
            None => DVec3::splat(0.5),
        };
        let (least, total) = volumes(&tets, position);
        assert!(tets.len() == 12 && (least - 1.0 / 12.0).abs() < 1e-15 && (total - 1.0).abs() < 1e-14);
    }

    /// Hexahedra whose corners fall together, as ANSYS writes other solids.
    #[test]
    fn corners_that_fall_together() {
        let at = |node: u32| DVec3::from(HEXAHEDRON[node as usize]);
        let prism = Solid::Hexahedron.tets(&[0, 1, 2, 2, 4, 5, 6, 6]);
        assert_eq!((prism.len(), volumes(&prism, at)), (3, (1.0 / 6.0, 0.5)));
        let pyramid = Solid::Hexahedron.tets(&[0, 1, 2, 3, 4, 4, 4, 4]);
        assert_eq!((pyramid.len(), volumes(&pyramid, at)), (2, (1.0 / 6.0, 2.0 / 6.0)));
        assert_eq!(Solid::Hexahedron.tets(&[0, 1, 2, 2, 4, 4, 4, 4]), [[0, 1, 2, 4]]);
        assert_eq!(Solid::Hexahedron.tets(&[0, 1, 2, 3, 0, 1, 2, 3]), Vec::<[u32; 4]>::new());
        // One corner alone: the faces on it are two triangles and a quadrangle that is not plane.
        let one = Solid::Hexahedron.tets(&[0, 1, 2, 3, 4, 5, 6, 6]);
        assert!((volumes(&one, at).1 - 4.0 / 6.0).abs() < 1e-15 && volumes(&one, at).0 > 0.1, "{one:?}");
    }

    #[test]
    fn faces_without_area_are_none() {
        assert_eq!(Face::of(&[1, 2, 3, 3]), Some(Face::Triangle([1, 2, 3])));
        assert_eq!(Face::of(&[3, 1, 2, 3]), Some(Face::Triangle([1, 2, 3])));
        assert!(!Face::Triangle([1, 2, 3]).is_descending() && Face::Triangle([1, 3, 2]).is_descending());
        assert_eq!(Face::of(&[4, 1, 2, 3]), Some(Face::Quadrangle([1, 2, 3, 4])));
        for corners in [&[1, 1, 2, 2][..], &[1, 2, 1, 3], &[1, 2, 3, 2], &[1, 2, 1], &[1, 1, 1]] {
            assert_eq!(Face::of(corners), None, "{corners:?}");
        }
    }
}
