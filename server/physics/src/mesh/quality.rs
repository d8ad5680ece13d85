//! Measures of how well-shaped tetrahedra are.
use super::tet::{EDGES, TetMesh};
use glam::DVec3;

/// Summary of a mesh's shape.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Smallest dihedral angle (degrees) over all tets; the regular tet has 70.53.
    pub min_dihedral_deg: f64,
    /// Largest dihedral angle (degrees).
    pub max_dihedral_deg: f64,
    /// Smallest of `6√2·V / l_rms³` (1 for the regular tet, 0 for a flat one).
    pub min_volume_length: f64,
    /// Mean of the same.
    pub mean_volume_length: f64,
    /// Shortest and longest edge (m).
    pub edge_range_m: (f64, f64),
}

/// Measures a mesh.
pub fn measure(mesh: &TetMesh) -> Quality {
    let mut quality = Quality {
        min_dihedral_deg: f64::INFINITY,
        max_dihedral_deg: 0.0,
        min_volume_length: f64::INFINITY,
        mean_volume_length: 0.0,
        edge_range_m: (f64::INFINITY, 0.0),
    };
    for tet in 0..mesh.tets().len() {
        let corners = mesh.corners_m(tet);
        for angle in dihedral_angles_deg(corners) {
            quality.min_dihedral_deg = quality.min_dihedral_deg.min(angle);
            quality.max_dihedral_deg = quality.max_dihedral_deg.max(angle);
        }
        for [a, b] in EDGES {
            let length = corners[a].distance(corners[b]);
            quality.edge_range_m = (quality.edge_range_m.0.min(length), quality.edge_range_m.1.max(length));
        }
        let ratio = volume_length_ratio(corners);
        quality.min_volume_length = quality.min_volume_length.min(ratio);
        quality.mean_volume_length += ratio / mesh.tets().len() as f64;
    }
    quality
}

/// The six dihedral angles (degrees), in the order of [`EDGES`].
pub fn dihedral_angles_deg(corners: [DVec3; 4]) -> [f64; 6] {
    EDGES.map(|[a, b]| {
        let [c, d] = opposite_edge(a, b);
        let axis = (corners[b] - corners[a]).normalize();
        // Angle between the two faces that meet in the edge: project the opposite corners on the plane across it.
        let u = (corners[c] - corners[a]).reject_from_normalized(axis);
        let w = (corners[d] - corners[a]).reject_from_normalized(axis);
        u.angle_between(w).to_degrees()
    })
}

/// `6√2·V / l_rms³`: 1 for the regular tet, 0 for a flat one, negative for an inverted one.
pub fn volume_length_ratio(corners: [DVec3; 4]) -> f64 {
    let [a, b, c, d] = corners;
    let volume = (b - a).cross(c - a).dot(d - a) / 6.0;
    let mean_square = EDGES.iter().map(|&[i, j]| corners[i].distance_squared(corners[j])).sum::<f64>() / 6.0;
    6.0 * std::f64::consts::SQRT_2 * volume / mean_square.powf(1.5)
}

fn opposite_edge(a: usize, b: usize) -> [usize; 2] {
    let mut rest = (0..4).filter(|&i| i != a && i != b);
    [rest.next().unwrap_or(0), rest.next().unwrap_or(0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regular_tet_is_perfect() {
        let p = [
            DVec3::new(1.0, 1.0, 1.0),
            DVec3::new(-1.0, 1.0, -1.0),
            DVec3::new(1.0, -1.0, -1.0),
            DVec3::new(-1.0, -1.0, 1.0),
        ];
        assert!((volume_length_ratio(p) - 1.0).abs() < 1e-14);
        for angle in dihedral_angles_deg(p) {
            assert!((angle - 70.528_779_365_509_31).abs() < 1e-9, "{angle}");
        }
    }
}
