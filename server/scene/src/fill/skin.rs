//! The two surfaces as one closed surface around the wall: the inner one turned round, the outer one, and between open rims a strip.
use super::{CleanSurface, FillError, SurfaceInput, cleaned};
use crate::skin::{FineSurface, refine};
use glam::DVec3;

/// Origins of triangles, as the regions of a fill are numbered.
const INNER: u32 = 0;
const OUTER: u32 = 1;
const BASE: u32 = 2;

/// The surface around the wall, its edges no longer than `longest_m`. The surfaces are those that [`super::fill`] has filled.
///
/// # Errors
/// As there.
pub(crate) fn around(
    inner: SurfaceInput<'_>,
    outer: SurfaceInput<'_>,
    longest_m: f64,
) -> Result<FineSurface, FillError> {
    let surface = joined(&cleaned("inner", inner)?, &cleaned("outer", outer)?);
    Ok(refine(surface, longest_m, &|_, middle| middle))
}

fn joined(inner: &CleanSurface, outer: &CleanSurface) -> FineSurface {
    let positions_m = [&inner.mesh.positions[..], &outer.mesh.positions].concat();
    let first = inner.mesh.positions.len() as u32;
    let of_outer = |vertex: &u32| vertex + first;
    let mut triangles: Vec<[u32; 3]> = inner.mesh.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    let mut origins = vec![INNER; triangles.len()];
    triangles.extend(outer.mesh.triangles.iter().map(|corners| corners.map(|vertex| of_outer(&vertex))));
    origins.resize(triangles.len(), OUTER);
    strip(&positions_m, &inner.rim, &outer.rim.iter().map(of_outer).collect::<Vec<_>>(), &mut triangles);
    origins.resize(triangles.len(), BASE);
    FineSurface { positions_m, triangles, origins }
}

/// Triangles between two rims that go round in the same sense: always the one with the shorter edge across.
fn strip(positions_m: &[DVec3], inner: &[u32], outer: &[u32], triangles: &mut Vec<[u32; 3]>) {
    let Some(&start) = inner.first() else { return };
    let distance = |i: u32, o: u32| positions_m[i as usize].distance(positions_m[o as usize]);
    let nearest = (0..outer.len()).min_by(|&a, &b| distance(start, outer[a]).total_cmp(&distance(start, outer[b])));
    let first = nearest.unwrap_or_default();
    let of_inner = |step: usize| inner[step % inner.len()];
    let of_outer = |step: usize| outer[(first + step) % outer.len()];
    let (mut i, mut o) = (0, 0);
    while i < inner.len() || o < outer.len() {
        let [here, across] = [of_inner(i), of_outer(o)];
        let (next, next_across) = (of_inner(i + 1), of_outer(o + 1));
        if o == outer.len() || (i < inner.len() && distance(next, across) < distance(here, next_across)) {
            triangles.push([here, next, across]);
            i += 1;
        } else {
            triangles.push([next_across, across, here]);
            o += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_physics::bodies::hybrid::Skin;
    use std::f64::consts::{PI, TAU};

    /// A cup: half an ellipsoid of revolution below z = 0, `around` vertices on every ring.
    fn cup(radius: f64, depth: f64, around: u32, rings: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mut points = vec![DVec3::Z * -depth];
        for ring in 1..=rings {
            let (sin, cos) = (0.5 * PI * f64::from(ring) / f64::from(rings)).sin_cos();
            for at in 0..around {
                let (y, x) = (TAU * f64::from(at) / f64::from(around)).sin_cos();
                points.push(DVec3::new(radius * sin * x, radius * sin * y, -depth * cos));
            }
        }
        let vertex = |ring: u32, at: u32| 1 + (ring - 1) * around + at % around;
        let mut triangles: Vec<[u32; 3]> = (0..around).map(|at| [0, vertex(1, at + 1), vertex(1, at)]).collect();
        for ring in 1..rings {
            for at in 0..around {
                let [a, b] = [vertex(ring, at), vertex(ring, at + 1)];
                let [c, d] = [vertex(ring + 1, at), vertex(ring + 1, at + 1)];
                triangles.extend([[a, b, c], [b, d, c]]);
            }
        }
        (points, triangles)
    }

    #[test]
    fn two_cups_with_different_rims_enclose_their_wall() {
        let (inner, outer) = (cup(20.0, 40.0, 37, 20), cup(30.0, 50.0, 64, 30));
        let surface = around(
            SurfaceInput { vertices: &inner.0, triangles: &inner.1, metres_per_unit: 1e-3 },
            SurfaceInput { vertices: &outer.0, triangles: &outer.1, metres_per_unit: 1e-3 },
            3e-3,
        )
        .unwrap();
        let edges = surface.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let lengths = edges.map(|[a, b]| surface.positions_m[a as usize].distance(surface.positions_m[b as usize]));
        assert!(lengths.fold(0.0, f64::max) < 3e-3 * 1.000_001);
        for triangle in surface.triangles_from(|origin| origin == BASE) {
            assert!(
                surface.triangles[triangle as usize].iter().all(|&v| surface.positions_m[v as usize].z.abs() < 1e-12)
            );
        }
        let half = |radius: f64, depth: f64| 2.0 / 3.0 * PI * radius * radius * depth * 1e-9;
        let skin = Skin::new(surface.positions_m, surface.triangles).unwrap();
        let error = skin.volume_m3() / (half(30.0, 50.0) - half(20.0, 40.0)) - 1.0;
        assert!(error.abs() < 1e-2, "{error}");
    }
}
