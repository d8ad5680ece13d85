//! The skin, the fine surface of a hybrid body: it bounds the body's volume; tools touch it, and viewers see it.
use glam::DVec3;
use std::collections::BTreeMap;
use thiserror::Error;

/// A closed triangulated surface at rest, seen counter-clockwise from outside.
#[derive(Debug, Clone, PartialEq)]
pub struct Skin {
    positions_m: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

/// Why a surface bounds no volume.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SkinError {
    /// It has no triangles.
    #[error("the fine surface has no triangles")]
    Empty,
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} of the fine surface has a coordinate that is not finite: {position}")]
    NonFinite {
        /// Index of the vertex, from 0.
        vertex: usize,
        /// Its position.
        position: DVec3,
    },
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} of the fine surface refers to vertex {vertex}, but there are only {vertices}")]
    OutOfRange {
        /// Index of the triangle, from 0.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// An edge has no partner of the opposite sense.
    #[error(
        "the fine surface is not closed: the edge from vertex {} to vertex {} has {found} \
         neighbours on its other side, not one",
        edge[0], edge[1]
    )]
    Open {
        /// The edge, as its triangle goes round.
        edge: [u32; 2],
        /// How many triangles go the other way.
        found: usize,
    },
    /// It is inside out.
    #[error("the fine surface encloses {volume_m3:e} m³: it is inside out; turn its triangles round")]
    InsideOut {
        /// Signed volume (m³).
        volume_m3: f64,
    },
}

impl Skin {
    /// Checks a surface and makes it a skin.
    ///
    /// # Errors
    /// Returns the first [`SkinError`] found.
    pub fn new(positions_m: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Result<Self, SkinError> {
        if triangles.is_empty() {
            return Err(SkinError::Empty);
        }
        if let Some(vertex) = positions_m.iter().position(|p| !p.is_finite()) {
            return Err(SkinError::NonFinite { vertex, position: positions_m[vertex] });
        }
        let vertices = positions_m.len();
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices) {
                return Err(SkinError::OutOfRange { triangle, vertex, vertices });
            }
        }
        let skin = Self { positions_m, triangles };
        skin.check_closed()?;
        let volume_m3 = skin.volume_m3();
        if volume_m3 > 0.0 { Ok(skin) } else { Err(SkinError::InsideOut { volume_m3 }) }
    }

    /// Returns the positions (m) of its vertices.
    pub fn positions_m(&self) -> &[DVec3] {
        &self.positions_m
    }

    /// Returns the triangles as indices of vertices.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Returns the corners (m) of a triangle.
    pub fn corners_m(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|v| self.positions_m[v as usize])
    }

    /// Returns the enclosed volume (m³), `⅙ Σ a·(b × c)`.
    pub fn volume_m3(&self) -> f64 {
        let sixth = |t| {
            let [a, b, c]: [DVec3; 3] = self.corners_m(t);
            a.dot(b.cross(c)) / 6.0
        };
        (0..self.triangles.len()).map(sixth).sum()
    }

    /// Returns the lower and upper corner (m) of the bounding box.
    pub fn bounds_m(&self) -> (DVec3, DVec3) {
        let used = self.triangles.iter().flatten().map(|&v| self.positions_m[v as usize]);
        used.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
    }

    fn check_closed(&self) -> Result<(), SkinError> {
        let mut count: BTreeMap<[u32; 2], usize> = BTreeMap::new();
        let edges = || self.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        for edge in edges() {
            *count.entry(edge).or_default() += 1;
        }
        for [a, b] in edges() {
            let found = count.get(&[b, a]).copied().unwrap_or(0);
            if found != count[&[a, b]] {
                return Err(SkinError::Open { edge: [a, b], found });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
        (vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z], vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    }

    #[test]
    fn what_bounds_no_volume_is_refused() {
        let (p, t) = tetrahedron();
        assert!((Skin::new(p.clone(), t.clone()).unwrap().volume_m3() - 1.0 / 6.0).abs() < 1e-15);
        assert_eq!(Skin::new(p.clone(), vec![]).unwrap_err(), SkinError::Empty);
        assert!(matches!(Skin::new(p.clone(), t[1..].to_vec()).unwrap_err(), SkinError::Open { found: 0, .. }));
        let turned = t.iter().map(|&[a, b, c]| [a, c, b]).collect();
        assert!(matches!(Skin::new(p.clone(), turned).unwrap_err(), SkinError::InsideOut { .. }));
        let far = vec![[0, 1, 9]];
        assert!(matches!(Skin::new(p.clone(), far).unwrap_err(), SkinError::OutOfRange { vertex: 9, .. }));
        let mut bad = p;
        bad[2].y = f64::NAN;
        assert!(matches!(Skin::new(bad, t).unwrap_err(), SkinError::NonFinite { vertex: 2, .. }));
    }
}
