//! Surfaces for tests: ventricles and closed shells in every kind of triangulation, with defects put in.
use super::SurfaceInput;
use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// A surface in millimetres.
#[derive(Debug, Clone, Default)]
pub(crate) struct Sample {
    pub(crate) points: Vec<DVec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
}

/// Semi-axes (mm) of the ventricle's surfaces and the height of its cut.
pub(crate) const INNER_MM: DVec3 = DVec3::new(7.0, 7.0, 17.0);
pub(crate) const OUTER_MM: DVec3 = DVec3::new(10.0, 10.0, 20.0);
pub(crate) const CUT_MM: f64 = 5.0;

/// The bumps of a real-looking heart: a factor on directions.
pub(crate) fn bumpy(direction: DVec3) -> f64 {
    let around = direction.y.atan2(direction.x);
    1.0 + direction.truncate().length()
        * (0.05 * (3.0 * around + 2.0 * direction.z).sin() + 0.03 * (5.0 * around - 4.0 * direction.z).cos())
}

/// A reproducible number in [−1, 1].
pub(crate) struct Noise(u64);

impl Noise {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }

    pub(crate) fn next(&mut self) -> f64 {
        // xorshift64*
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub(crate) fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
}

impl Sample {
    pub(crate) fn input(&self) -> SurfaceInput<'_> {
        SurfaceInput { vertices: &self.points, triangles: &self.triangles, metres_per_unit: 1e-3 }
    }

    /// Latitudes and longitudes; open at `cut_mm` (of the semi-axis) or closed. One pole point each.
    pub(crate) fn lat_long(axes: DVec3, cut: Option<f64>, rings: u32, around: u32) -> Self {
        let top = cut.map_or(FRAC_PI_2, |z| (z / axes.z).asin());
        let latitude = |k: u32| -FRAC_PI_2 + (top + FRAC_PI_2) * f64::from(k) / f64::from(rings);
        let mut sample = Self { points: vec![DVec3::new(0.0, 0.0, -axes.z)], triangles: Vec::new() };
        let last = if cut.is_some() { rings } else { rings - 1 };
        for k in 1..=last {
            for i in 0..around {
                let (sin, cos) = latitude(k).sin_cos();
                let (y, x) = (TAU * f64::from(i) / f64::from(around)).sin_cos();
                sample.points.push(DVec3::new(cos * x, cos * y, sin) * axes);
            }
        }
        let at = |k: u32, i: u32| 1 + (k - 1) * around + i % around;
        for i in 0..around {
            sample.triangles.push([0, at(1, i + 1), at(1, i)]);
            for k in 1..last {
                sample.triangles.push([at(k, i), at(k, i + 1), at(k + 1, i + 1)]);
                sample.triangles.push([at(k, i), at(k + 1, i + 1), at(k + 1, i)]);
            }
        }
        if cut.is_none() {
            let pole = sample.points.len() as u32;
            sample.points.push(DVec3::new(0.0, 0.0, axes.z));
            (0..around).for_each(|i| sample.triangles.push([pole, at(last, i), at(last, i + 1)]));
        }
        sample
    }

    /// A subdivided icosahedron. Open: triangles above the cut are dropped and the rim is drawn towards the plane, all
    /// the way (`planar` = 1) or not at all (0: a jagged rim).
    pub(crate) fn icosphere(axes: DVec3, cut: Option<f64>, levels: u32, planar: f64) -> Self {
        let mut sample = icosahedron();
        (0..levels).for_each(|_| sample.subdivide());
        for p in &mut sample.points {
            // Turned so that nothing is aligned with the axes.
            let d = glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.7, 0.2) * p.normalize();
            *p = d * axes;
        }
        if let Some(z) = cut {
            let centre = |t: &[u32; 3]| t.iter().map(|&v| sample.points[v as usize].z).sum::<f64>() / 3.0;
            let kept: Vec<[u32; 3]> = sample.triangles.iter().filter(|t| centre(t) <= z).copied().collect();
            sample.triangles = kept;
            let rim = sample.open_points();
            let slope = |p: DVec3| (1.0 - (p.z / axes.z).powi(2)).max(0.0).sqrt();
            for v in rim {
                let p = &mut sample.points[v as usize];
                let new_z = p.z + planar * (z - p.z);
                let radius = slope(DVec3::new(0.0, 0.0, new_z)) / slope(*p).max(1e-9);
                *p = DVec3::new(p.x * radius, p.y * radius, new_z);
            }
        }
        sample.used_only()
    }

    /// The faces of voxels whose middles lie inside: what marching through a segmentation gives without smoothing.
    /// Open: without the faces in the plane of the cut.
    pub(crate) fn voxels(axes: DVec3, cut: Option<f64>, size: f64) -> Self {
        let half = (axes / size).ceil().as_ivec3() + glam::IVec3::ONE;
        let top = cut.map_or(i32::MAX, |z| (z / size).round() as i32);
        let inside = |i: i32, j: i32, k: i32| {
            let p = (DVec3::new(f64::from(i), f64::from(j), f64::from(k)) + 0.5) * size;
            k < top && (p / axes).length() < 1.0
        };
        let mut sample = Self::default();
        let mut index: BTreeMap<[i32; 3], u32> = BTreeMap::new();
        for (i, j, k) in (-half.x..half.x)
            .flat_map(|i| (-half.y..half.y).flat_map(move |j| (-half.z..half.z).map(move |k| (i, j, k))))
        {
            if !inside(i, j, k) {
                continue;
            }
            for axis in 0..3 {
                for side in [0, 1] {
                    let mut beyond = [i, j, k];
                    beyond[axis] += 2 * side - 1;
                    let is_cut = axis == 2 && side == 1 && beyond[2] == top;
                    if inside(beyond[0], beyond[1], beyond[2]) || is_cut {
                        continue;
                    }
                    let corner = |u: i32, v: i32| {
                        let mut c = [i, j, k];
                        c[axis] += side;
                        c[(axis + 1) % 3] += u;
                        c[(axis + 2) % 3] += v;
                        c
                    };
                    let quad = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)].map(|c| {
                        *index.entry(c).or_insert_with(|| {
                            sample.points.push(DVec3::from(c.map(f64::from)) * size);
                            sample.points.len() as u32 - 1
                        })
                    });
                    let [a, b, c, d] = if side == 1 { quad } else { [quad[0], quad[3], quad[2], quad[1]] };
                    sample.triangles.extend([[a, b, c], [a, c, d]]);
                }
            }
        }
        sample
    }

    fn subdivide(&mut self) {
        let mut middles: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        let mut triangles = Vec::with_capacity(4 * self.triangles.len());
        for &[a, b, c] in &self.triangles {
            let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[i, j]| {
                *middles.entry([i.min(j), i.max(j)]).or_insert_with(|| {
                    let middle = (self.points[i as usize] + self.points[j as usize]).normalize();
                    self.points.push(middle);
                    self.points.len() as u32 - 1
                })
            });
            triangles.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        self.triangles = triangles;
    }

    fn open_points(&self) -> Vec<u32> {
        let mut sides: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        for &[a, b, c] in &self.triangles {
            for [i, j] in [[a, b], [b, c], [c, a]] {
                *sides.entry([i.min(j), i.max(j)]).or_default() += 1;
            }
        }
        let mut open: Vec<u32> = sides.iter().filter(|(_, n)| **n == 1).flat_map(|(e, _)| *e).collect();
        open.sort_unstable();
        open.dedup();
        open
    }

    fn used_only(self) -> Self {
        let mut new = vec![u32::MAX; self.points.len()];
        let mut sample = Self::default();
        for triangle in &self.triangles {
            sample.triangles.push(triangle.map(|v| {
                if new[v as usize] == u32::MAX {
                    new[v as usize] = sample.points.len() as u32;
                    sample.points.push(self.points[v as usize]);
                }
                new[v as usize]
            }));
        }
        sample
    }

    /// Moves every point by `change(point)`.
    pub(crate) fn moved(mut self, change: impl FnMut(DVec3) -> DVec3) -> Self {
        self.points = self.points.into_iter().map(change).collect();
        self
    }

    /// Scales every point by the bumps in its direction on the ellipsoid with these semi-axes.
    pub(crate) fn with_bumps(self, axes: DVec3) -> Self {
        self.moved(|p| p * DVec3::new(1.0, 1.0, 0.0) * bumpy(p / axes) + DVec3::Z * p.z)
    }

    /// Every triangle with its own three points, as STL has it.
    pub(crate) fn soup(self) -> Self {
        let points: Vec<DVec3> = self.triangles.iter().flatten().map(|&v| self.points[v as usize]).collect();
        let triangles = (0..points.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        Self { points, triangles }
    }

    /// Without the triangles within this distance of the lowest point: a hole at the apex.
    pub(crate) fn with_apex_hole(mut self, radius: f64) -> Self {
        let lowest = self.points.iter().copied().min_by(|a, b| a.z.total_cmp(&b.z)).unwrap_or_default();
        let points = &self.points;
        let near = |t: &[u32; 3]| t.iter().map(|&v| points[v as usize]).sum::<DVec3>() / 3.0;
        self.triangles.retain(|t| near(t).distance(lowest) > radius);
        self.used_only()
    }

    /// Volume (mm³) of an ellipsoid's part below the cut.
    pub(crate) fn exact_volume(axes: DVec3, cut: Option<f64>) -> f64 {
        let z = cut.unwrap_or(axes.z);
        PI * axes.x * axes.y * ((z + axes.z) - (z.powi(3) + axes.z.powi(3)) / (3.0 * axes.z * axes.z))
    }
}

/// A human-sized ventricle, 90 mm from base to apex: bumpy, both surfaces triangulated differently and a little rough,
/// a hole at the inner apex, the inner rim not quite plane.
pub(crate) fn human() -> (Sample, Sample) {
    const SCALE: f64 = 3.6;
    let mut noise = Noise::new(2);
    let inner = Sample::icosphere(INNER_MM, Some(CUT_MM), 4, 0.8).with_bumps(INNER_MM).with_apex_hole(0.9);
    let outer = Sample::lat_long(OUTER_MM, Some(CUT_MM), 36, 60).with_bumps(OUTER_MM);
    let mut rough = |p: DVec3| (p + noise.vector() * 0.03) * SCALE;
    (inner.moved(&mut rough), outer.moved(&mut rough))
}

fn icosahedron() -> Sample {
    let g = 0.5 * (1.0 + 5f64.sqrt());
    let points = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ];
    let triangles = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    Sample { points: points.into_iter().map(|p| DVec3::from(p).normalize()).collect(), triangles }
}
