//! Moves the boundary so that the mesh has the surfaces' volume, not that of a polyhedron inscribed in them.
//!
//! Nodes on a curved surface leave its triangles inside it: a coarse wall loses mass and stiffness. Here every boundary
//! node moves along its normal until the signed distance to the surface vanishes in the mean over the triangles around
//! it, and a last uniform offset makes the enclosed volume exact to first order.
use super::relation::enclosed_volume;
use super::remesh::Target;
use super::repair::CleanSurface;
use super::trimesh::TriMesh;
use glam::DVec3;

/// Passes of local offsets; each leaves a small part of the distance.
const PASSES: usize = 3;
/// Uniform offsets for the volume: Newton steps.
const VOLUME_STEPS: usize = 2;
/// Barycentric sample points of a triangle, of equal weight: its middle, near its corners, near its edges' middles.
const SAMPLES: [[f64; 3]; 7] = [
    [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0],
    [2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0],
    [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0],
    [1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0],
    [1.0 / 12.0, 11.0 / 24.0, 11.0 / 24.0],
    [11.0 / 24.0, 1.0 / 12.0, 11.0 / 24.0],
    [11.0 / 24.0, 11.0 / 24.0, 1.0 / 12.0],
];

/// New positions for the vertices of `mesh`, a triangulation of the surface `clean`. `base_normals` holds, for vertices
/// on the rim, the normal of the base there: they move within the base.
pub(crate) fn settled(
    mesh: &TriMesh,
    clean: &CleanSurface,
    target: &Target,
    base_normals: &[Option<DVec3>],
) -> Vec<DVec3> {
    let mut moving = mesh.clone();
    let rim = rim_loop(mesh);
    for _ in 0..PASSES {
        let offsets = local_offsets(&moving, target);
        shift(&mut moving, base_normals, |v| offsets[v]);
    }
    let middle = |surface: &TriMesh, rim: &[u32]| {
        rim.iter().map(|&v| surface.positions[v as usize]).sum::<DVec3>() / rim.len().max(1) as f64
    };
    let apex = middle(&clean.mesh, &clean.rim);
    let wanted = enclosed_volume(&clean.mesh, &clean.rim, apex);
    for _ in 0..VOLUME_STEPS {
        let missing = wanted - enclosed_volume(&moving, &rim, apex);
        let offset = missing / moving.area().max(f64::MIN_POSITIVE);
        shift(&mut moving, base_normals, |_| offset);
    }
    moving.positions
}

/// The rim in the direction of the surface's edges.
fn rim_loop(mesh: &TriMesh) -> Vec<u32> {
    let sides = mesh.rim_neighbours();
    let Some((&start, _)) = sides.first_key_value() else { return Vec::new() };
    let mut rim = vec![start];
    while let Some(&[_, next]) = rim.last().and_then(|v| sides.get(v))
        && next != start
        && rim.len() < sides.len()
    {
        rim.push(next);
    }
    rim
}

/// Mean signed distance to the surface, along the triangles' normals, over the triangles around every vertex.
fn local_offsets(mesh: &TriMesh, target: &Target) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); mesh.positions.len()];
    for &triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| mesh.positions[v as usize]);
        let normal = mesh.area_vector(triangle);
        let area = normal.length();
        let unit = normal.normalize_or_zero();
        let distance = |[u, v, w]: [f64; 3]| {
            let p = a * u + b * v + c * w;
            (target.surface.nearest(p).point - p).dot(unit)
        };
        let mean = SAMPLES.into_iter().map(distance).sum::<f64>() / SAMPLES.len() as f64;
        for v in triangle {
            sums[v as usize].0 += area * mean;
            sums[v as usize].1 += area;
        }
    }
    sums.into_iter().map(|(sum, area)| sum / area.max(f64::MIN_POSITIVE)).collect()
}

fn shift(mesh: &mut TriMesh, base_normals: &[Option<DVec3>], offset: impl Fn(usize) -> f64) {
    let normals = mesh.vertex_normals();
    for (v, normal) in normals.into_iter().enumerate() {
        let direction = match base_normals[v] {
            Some(base) => normal.reject_from_normalized(base).normalize_or_zero(),
            None => normal,
        };
        mesh.positions[v] += direction * offset(v);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fill::repair::clean;
    use crate::fill::samples::{OUTER_MM, Sample};

    #[test]
    fn a_coarse_sphere_gets_the_volume_of_the_fine_one() {
        let of = |levels| Sample::icosphere(OUTER_MM, None, levels, 1.0);
        let (fine, coarse) = (of(4), of(1));
        let fine = clean("outer", &fine.points, &fine.triangles).unwrap();
        let coarse = TriMesh::new(coarse.points.clone(), coarse.triangles.clone());
        let target = Target::of(&fine);
        let wanted = enclosed_volume(&fine.mesh, &[], DVec3::ZERO);
        assert!(enclosed_volume(&coarse, &[], DVec3::ZERO) < 0.9 * wanted);
        let positions = settled(&coarse, &fine, &target, &vec![None; coarse.positions.len()]);
        let settled = TriMesh::new(positions, coarse.triangles.clone());
        assert!((enclosed_volume(&settled, &[], DVec3::ZERO) / wanted - 1.0).abs() < 1e-3);
        // The deviation is shared by both sides: its largest value falls.
        let farthest = |mesh: &TriMesh| {
            let middle = |t: &[u32; 3]| t.iter().map(|&v| mesh.positions[v as usize]).sum::<DVec3>() / 3.0;
            let points = mesh.triangles.iter().map(middle).chain(mesh.positions.iter().copied());
            points.map(|p| target.surface.nearest(p).distance_squared.sqrt()).fold(0.0, f64::max)
        };
        assert!(farthest(&settled) < farthest(&coarse), "{} {}", farthest(&settled), farthest(&coarse));
    }
}
