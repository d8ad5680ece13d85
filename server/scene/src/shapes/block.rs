//! The box: a grid of cells, six tets each.
use super::{BoundaryRegion, Shape, ShapeError, check};
use crate::limits::MOST_TETS;
use glam::DVec3;
use palpate_physics::{MeshError, Surface, TetMesh};

/// Corner offsets of a cell on the six monotone paths from (0,0,0) to (1,1,1): Kuhn's subdivision. Neighbouring cells
/// agree on their common face's diagonal because all cells are translates of one another.
const KUHN_PATHS: [[[u32; 3]; 4]; 6] = [
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 1]],
    [[0, 0, 0], [0, 1, 0], [0, 1, 1], [1, 1, 1]],
    [[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1]],
    [[0, 0, 0], [1, 1, 0], [0, 1, 0], [1, 1, 1]],
    [[0, 0, 0], [0, 1, 1], [0, 0, 1], [1, 1, 1]],
    [[0, 0, 0], [1, 0, 1], [1, 0, 0], [1, 1, 1]],
];

/// A box from the origin to `size_m` (m), of `cells` cells with six tets each (Kuhn's subdivision, dihedral angles
/// 45°, 60° and 90° for cubic cells). Node (i, j, k) has index `i + (nx+1)·(j + (ny+1)·k)`. Regions `x_min` … `z_max`.
///
/// # Errors
/// A size that is not positive and finite, no cells along an axis, or more than 10 million tets.
pub fn box_mesh(size_m: DVec3, cells: [u32; 3]) -> Result<Shape, ShapeError> {
    for (name, value) in ["size_m.x", "size_m.y", "size_m.z"].into_iter().zip(size_m.to_array()) {
        check(name, value, value > 0.0, "must be finite and larger than 0")?;
    }
    for (name, value) in ["cells.x", "cells.y", "cells.z"].into_iter().zip(cells) {
        check(name, f64::from(value), value > 0, "must be at least 1")?;
    }
    let tets = cells.iter().fold(6u64, |product, &n| product.saturating_mul(u64::from(n)));
    check("cells", tets as f64 / 6.0, tets <= MOST_TETS.into(), format!("at most {} cells", MOST_TETS / 6))?;
    let bad_mesh = |source: MeshError| ShapeError::Mesh { shape: "box", source };

    let [nx, ny, nz] = cells;
    let node = |i: u32, j: u32, k: u32| i + (nx + 1) * (j + (ny + 1) * k);
    let mut positions_m = Vec::with_capacity(node(nx, ny, nz) as usize + 1);
    for (k, j, i) in grid(nx + 1, ny + 1, nz + 1) {
        let fraction = DVec3::new(f64::from(i), f64::from(j), f64::from(k)) / DVec3::from(cells.map(f64::from));
        positions_m.push(size_m * fraction);
    }
    let mut tets = Vec::with_capacity(tets as usize);
    for (k, j, i) in grid(nx, ny, nz) {
        tets.extend(KUHN_PATHS.map(|path| path.map(|[di, dj, dk]| node(i + di, j + dj, k + dk))));
    }
    let mesh = TetMesh::new(positions_m, tets).map_err(bad_mesh)?;
    let surface = Surface::of(&mesh).map_err(bad_mesh)?;
    let regions = sides(&mesh, &surface, size_m);
    Ok(Shape { mesh, regions, layers: 0 })
}

fn grid(nx: u32, ny: u32, nz: u32) -> impl Iterator<Item = (u32, u32, u32)> {
    (0..nz).flat_map(move |k| (0..ny).flat_map(move |j| (0..nx).map(move |i| (k, j, i))))
}

fn sides(mesh: &TetMesh, surface: &Surface, size_m: DVec3) -> Vec<BoundaryRegion> {
    const NAMES: [[&str; 2]; 3] = [["x_min", "x_max"], ["y_min", "y_max"], ["z_min", "z_max"]];
    let faces = || (0..surface.triangles.len()).map(|t| surface.triangle_nodes(t));
    let mut regions = Vec::with_capacity(6);
    for axis in 0..3 {
        for (name, plane) in NAMES[axis].into_iter().zip([0.0, size_m[axis]]) {
            // Grid coordinates 0 and size are exact: 0·s = 0 and 1·s = s.
            let on_plane = |face: &[u32; 3]| face.iter().all(|&n| mesh.positions_m()[n as usize][axis] == plane);
            regions.push(BoundaryRegion { name, triangles: faces().filter(on_plane).collect() });
        }
    }
    regions
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_physics::mesh::quality;

    #[test]
    fn box_has_its_volume_its_sides_and_kuhn_angles() {
        let size = DVec3::new(0.08, 0.06, 0.04);
        let shape = box_mesh(size, [4, 3, 2]).unwrap();
        assert_eq!(shape.mesh.tets().len(), 144);
        assert_eq!(shape.mesh.positions_m().len(), 60);
        assert!((shape.mesh.total_volume_m3() - size.element_product()).abs() < 1e-16);
        let measured = quality::measure(&shape.mesh);
        assert!((measured.min_dihedral_deg - 45.0).abs() < 1e-9, "{measured:?}");
        assert!((measured.max_dihedral_deg - 90.0).abs() < 1e-9, "{measured:?}");
        let surface = Surface::of(&shape.mesh).unwrap();
        assert_eq!(shape.regions.iter().map(|r| r.triangles.len()).sum::<usize>(), surface.triangles.len());
        assert_eq!(shape.region("z_max").unwrap().triangles.len(), 24);
        assert_eq!(shape.region("x_min").unwrap().nodes().len(), 12);
    }

    #[test]
    fn bad_boxes_are_refused() {
        let message = |size, cells| box_mesh(size, cells).unwrap_err().to_string();
        assert!(message(DVec3::new(1.0, -1.0, 1.0), [1, 1, 1]).contains("size_m.y = -1"));
        assert!(message(DVec3::new(1.0, 1.0, f64::NAN), [1, 1, 1]).contains("size_m.z"));
        assert!(message(DVec3::ONE, [1, 0, 1]).contains("cells.y"));
        assert!(message(DVec3::ONE, [u32::MAX; 3]).contains("at most"));
    }
}
