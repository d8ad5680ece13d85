//! Triangulations of a sphere or a cap of it by rings of nearly equal spacing on the ellipsoid they are mapped to.
//!
//! Latitude-longitude grids crowd the poles; here a ring carries as many vertices as its circumference needs, the pole
//! has five or six neighbours, and Delaunay flips with smoothing even out the rest.
use crate::fill::trimesh::TriMesh;
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, TAU};

/// Samples of the arc-length tables.
const SAMPLES: usize = 4096;
/// Rounds of smoothing and flipping.
const SMOOTHING_ROUNDS: usize = 12;
/// Fewest vertices of a ring.
const FEWEST_ON_RING: u32 = 5;

/// Part of the ellipsoid with these semi-axes (m): from the pole at −z up to a latitude, π/2 for the whole.
pub(super) struct Cap {
    pub axes_m: DVec3,
    pub top_latitude: f64,
}

/// Vertices on the unit sphere and triangles, counter-clockwise seen from outside.
pub(super) struct SphereMesh {
    pub directions: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl Cap {
    fn closed(&self) -> bool {
        self.top_latitude >= FRAC_PI_2
    }

    /// Table of arc length (m) over the parameter t in [0, 1], from the derivative's length.
    fn table(speed: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut lengths = vec![0.0];
        let mut total = 0.0;
        for i in 0..SAMPLES {
            total += speed((i as f64 + 0.5) / SAMPLES as f64) / SAMPLES as f64;
            lengths.push(total);
        }
        lengths
    }

    /// Parameter t at a fraction of the whole length.
    fn invert(table: &[f64], fraction: f64) -> f64 {
        let target = fraction * table[table.len() - 1];
        let upper = table.partition_point(|&length| length < target).clamp(1, table.len() - 1);
        let (a, b) = (table[upper - 1], table[upper]);
        (upper as f64 - 1.0 + (target - a) / (b - a)) / (table.len() - 1) as f64
    }

    fn meridian(&self) -> Vec<f64> {
        let radius = 0.5 * (self.axes_m.x + self.axes_m.y);
        let span = self.top_latitude + FRAC_PI_2;
        // d(r cosθ, c sinθ)/dt = span · (−r sinθ, c cosθ)
        Self::table(|t| {
            let (sin, cos) = (t * span - FRAC_PI_2).sin_cos();
            span * (radius * sin).hypot(self.axes_m.z * cos)
        })
    }

    fn equator(&self) -> Vec<f64> {
        Self::table(|t| {
            let (sin, cos) = (TAU * t).sin_cos();
            TAU * (self.axes_m.x * sin).hypot(self.axes_m.y * cos)
        })
    }

    fn latitude(&self, meridian: &[f64], fraction: f64) -> f64 {
        Self::invert(meridian, fraction) * (self.top_latitude + FRAC_PI_2) - FRAC_PI_2
    }

    /// Area (m²), with the mean of the equatorial axes as radius.
    pub(super) fn area_m2(&self) -> f64 {
        let radius = 0.5 * (self.axes_m.x + self.axes_m.y);
        let span = self.top_latitude + FRAC_PI_2;
        (0..SAMPLES)
            .map(|i| {
                let (sin, cos) = ((i as f64 + 0.5) / SAMPLES as f64 * span - FRAC_PI_2).sin_cos();
                TAU * radius * cos * (radius * sin).hypot(self.axes_m.z * cos) * span / SAMPLES as f64
            })
            .sum()
    }

    /// Vertices of every ring for edges of this length (m): the pole first, and the other pole last when closed.
    fn ring_sizes(&self, edge_m: f64, meridian: &[f64], equator_m: f64) -> Vec<u32> {
        let height = edge_m * 3f64.sqrt() / 2.0;
        let steps = (meridian[SAMPLES] / height).round().max(2.0) as u32;
        let mut sizes = vec![1];
        for k in 1..=steps {
            let cos = self.latitude(meridian, f64::from(k) / f64::from(steps)).cos();
            sizes.push(((equator_m * cos / edge_m).round() as u32).max(FEWEST_ON_RING));
        }
        if self.closed() {
            sizes[steps as usize] = 1;
        }
        sizes
    }

    /// Ring sizes for edges of about this length (m).
    pub(super) fn rings_of(&self, edge_m: f64) -> Vec<u32> {
        self.ring_sizes(edge_m, &self.meridian(), self.equator()[SAMPLES])
    }

    /// Ring sizes whose triangulation has as nearly as possible the wanted number of triangles.
    pub(super) fn rings(&self, wanted_triangles: f64) -> Vec<u32> {
        let meridian = self.meridian();
        let equator_m = self.equator()[SAMPLES];
        let guess = (self.area_m2() / wanted_triangles / (3f64.sqrt() / 4.0)).sqrt();
        let candidates = (0..600).map(|i| {
            // Edges from the guess outwards to ±45 %, so that ties go to the most regular spacing.
            let step = (i + 1) / 2;
            let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
            self.ring_sizes(guess * (1.0 + sign * f64::from(step) * 0.0015), &meridian, equator_m)
        });
        let miss = |sizes: &Vec<u32>| (f64::from(triangles_between(sizes)) - wanted_triangles).abs();
        candidates.min_by(|a, b| miss(a).total_cmp(&miss(b))).unwrap_or_default()
    }

    /// Places the rings, joins them, smooths.
    pub(super) fn triangulate(&self, sizes: &[u32]) -> SphereMesh {
        let meridian = self.meridian();
        let equator = self.equator();
        let steps = sizes.len() - 1;
        let mut directions = Vec::new();
        let mut starts = Vec::new();
        let mut fractions: Vec<Vec<f64>> = Vec::new();
        for (k, &size) in sizes.iter().enumerate() {
            starts.push(directions.len() as u32);
            let (sin, cos) = self.latitude(&meridian, k as f64 / steps as f64).sin_cos();
            let cos = if size == 1 { 0.0 } else { cos };
            // Every second ring starts half a step later.
            let shift = 0.5 * (k % 2) as f64;
            let around: Vec<f64> = (0..size).map(|i| (f64::from(i) + shift) / f64::from(size)).collect();
            for &u in &around {
                let (y, x) = (TAU * Self::invert(&equator, u)).sin_cos();
                directions.push(DVec3::new(cos * x, cos * y, sin));
            }
            fractions.push(around);
        }
        let mut triangles = Vec::new();
        for k in 0..steps {
            join(&fractions[k], starts[k], &fractions[k + 1], starts[k + 1], &mut triangles);
        }
        let fixed_from = if self.closed() { u32::MAX } else { starts[steps] };
        let mut mesh = SphereMesh { directions, triangles };
        mesh.smooth(self.axes_m, fixed_from);
        mesh
    }
}

/// Triangles of the triangulation with these rings.
pub(super) fn triangles_between(sizes: &[u32]) -> u32 {
    sizes.windows(2).map(|pair| [pair[0], pair[1]].iter().filter(|&&n| n > 1).sum::<u32>()).sum()
}

/// Joins two rings (positions as fractions of the turn, ascending): always the side whose next vertex comes first.
fn join(low: &[f64], low_start: u32, high: &[f64], high_start: u32, triangles: &mut Vec<[u32; 3]>) {
    let at = |ring: &[f64], i: usize| ring[i % ring.len()] + (i / ring.len()) as f64;
    let node = |ring: &[f64], start: u32, i: usize| start + (i % ring.len()) as u32;
    let (mut i, mut j) = (0, 0);
    let steps = |ring: &[f64]| if ring.len() == 1 { 0 } else { ring.len() };
    while i < steps(low) || j < steps(high) {
        let low_next = if i < steps(low) { 0.5 * (at(low, i) + at(low, i + 1)) } else { f64::INFINITY };
        let high_next = if j < steps(high) { 0.5 * (at(high, j) + at(high, j + 1)) } else { f64::INFINITY };
        let (a, b) = (node(low, low_start, i), node(high, high_start, j));
        if low_next < high_next {
            triangles.push([a, node(low, low_start, i + 1), b]);
            i += 1;
        } else {
            triangles.push([a, node(high, high_start, j + 1), b]);
            j += 1;
        }
    }
}

impl SphereMesh {
    /// Centroidal smoothing and Delaunay flips, both measured on the ellipsoid with these semi-axes; vertices from
    /// `fixed_from` on stay.
    fn smooth(&mut self, axes_m: DVec3, fixed_from: u32) {
        let on_ellipsoid = |directions: &[DVec3]| directions.iter().map(|&d| d * axes_m).collect();
        let mut mesh = TriMesh::new(on_ellipsoid(&self.directions), std::mem::take(&mut self.triangles));
        for _ in 0..SMOOTHING_ROUNDS {
            mesh.delaunay(4);
            let centroids = mesh.centroids();
            for v in 0..centroids.len().min(fixed_from as usize) {
                mesh.positions[v] = axes_m * (centroids[v] / axes_m).normalize_or(self.directions[v]);
            }
        }
        mesh.delaunay(4);
        for v in 0..self.directions.len().min(fixed_from as usize) {
            self.directions[v] = (mesh.positions[v] / axes_m).normalize_or(self.directions[v]);
        }
        self.triangles = mesh.triangles;
    }
}
