//! A rigid sphere without friction on a side of a grid.
//!
//! Every surface point inside the sphere (depth `g = R − |y − c| > 0`) is pushed out with the pressure `κ g` on its rest area,
//! `Φ = ½ Σ κ a g²`. κ is so large that what it lets in is some 1e-4 of the depth: contact is as good as a constraint, and its
//! error is far below that of the grid.
//!
//! Deeper than a radius Newton's iterations would bring the surface around the sphere, whose penalty then pushes it the wrong way.
//! So a shaft of half the sphere's radius goes on from it the way that it came, and what is in both is pressed by the one that it is
//! deeper in. Where the surface does not close over the sphere, the shaft touches nothing and changes nothing; [`Sphere::on_shaft_n`]
//! tells.
use super::{
    grid::{Face, HexGrid},
    solid::{SurfacePoint, surface_points},
};
use glam::{DMat3, DVec3};
use palpate_physics::linalg::tensor::outer;

/// Parts of a face each way on which contact is integrated: the rim of the contact runs through faces.
const PARTS: usize = 3;
/// Radius of the shaft over the sphere's.
const SHAFT: f64 = 0.5;

/// The sphere and the faces it may touch.
#[derive(Debug, Clone)]
pub struct Sphere {
    /// Radius (m).
    pub radius_m: f64,
    /// κ (Pa/m).
    pub penalty_pa_per_m: f64,
    /// Unit vector from its centre back along the way that it came.
    axis: DVec3,
    faces: Vec<(Face, Vec<SurfacePoint>)>,
}

/// One surface point inside the sphere or its shaft.
struct Pressed<'a> {
    face: &'a Face,
    weights: &'a [f64; 9],
    /// `κ a` (N/m).
    stiffness_n_per_m: f64,
    touch: Touch,
}

/// How it is inside.
#[derive(Clone, Copy)]
struct Touch {
    depth_m: f64,
    /// From the centre, or the shaft's axis.
    distance_m: f64,
    /// From there to the point.
    outwards: DVec3,
    by_shaft: bool,
}

impl Sphere {
    /// A sphere that may touch these faces, and came against the unit vector `axis`.
    pub fn new(grid: &HexGrid, faces: Vec<Face>, axis: DVec3, radius_m: f64, penalty_pa_per_m: f64) -> Self {
        let faces = faces.into_iter().map(|face| (face, surface_points(grid, &face, PARTS))).collect();
        Self { radius_m, penalty_pa_per_m, axis, faces }
    }

    /// Size (N) of all that presses on the shaft, which is no part of the problem.
    pub fn on_shaft_n(&self, x: &[DVec3], centre_m: DVec3) -> f64 {
        let mut sum_n = 0.0;
        self.for_pressed(x, centre_m, |_, p| {
            sum_n += if p.touch.by_shaft { p.stiffness_n_per_m * p.touch.depth_m } else { 0.0 }
        });
        sum_n
    }

    /// Nodes of every face, in the order of [`Self::stiffness`].
    pub fn groups(&self) -> impl Iterator<Item = Vec<u32>> {
        self.faces.iter().map(|(face, _)| face.to_vec())
    }

    /// `Φ` (J).
    pub fn energy_j(&self, x: &[DVec3], centre_m: DVec3) -> f64 {
        let mut energy = 0.0;
        self.for_pressed(x, centre_m, |_, p| energy += 0.5 * p.stiffness_n_per_m * p.touch.depth_m * p.touch.depth_m);
        energy
    }

    /// Adds the forces on nodes (N) and returns the force on the sphere (N).
    pub fn add_forces_n(&self, x: &[DVec3], centre_m: DVec3, forces_n: &mut [DVec3]) -> DVec3 {
        let mut on_sphere = DVec3::ZERO;
        self.for_pressed(x, centre_m, |_, p| {
            let force = p.touch.outwards * (p.stiffness_n_per_m * p.touch.depth_m);
            for (&node, weight) in p.face.iter().zip(p.weights) {
                forces_n[node as usize] += force * *weight;
            }
            on_sphere -= force;
        });
        on_sphere
    }

    /// Stiffness (N/m) of every face, row-major 27 × 27: `κ a (n nᵀ − (g/|r|)(I − n nᵀ − a aᵀ))`,
    /// with the axis `a` on the shaft alone.
    pub fn stiffness(&self, x: &[DVec3], centre_m: DVec3) -> Vec<Vec<f64>> {
        let mut blocks = vec![vec![0.0; 27 * 27]; self.faces.len()];
        self.for_pressed(x, centre_m, |face, p| {
            let along = outer(p.touch.outwards, p.touch.outwards);
            let straight = if p.touch.by_shaft { outer(self.axis, self.axis) } else { DMat3::ZERO };
            let across = DMat3::IDENTITY - along - straight;
            let hessian = (along - across * (p.touch.depth_m / p.touch.distance_m)) * p.stiffness_n_per_m;
            for (a, wa) in p.weights.iter().enumerate() {
                for (b, wb) in p.weights.iter().enumerate() {
                    for r in 0..3 {
                        for c in 0..3 {
                            blocks[face][(3 * a + r) * 27 + 3 * b + c] += hessian.col(c)[r] * wa * wb;
                        }
                    }
                }
            }
        });
        blocks
    }

    fn for_pressed(&self, x: &[DVec3], centre_m: DVec3, mut visit: impl FnMut(usize, &Pressed<'_>)) {
        for (index, (face, points)) in self.faces.iter().enumerate() {
            let corners = face.map(|node| x[node as usize]);
            for point in points {
                let y: DVec3 = corners.iter().zip(&point.weights).map(|(x, weight)| *x * *weight).sum();
                if let Some(touch) = self.touch(y - centre_m) {
                    let stiffness_n_per_m = self.penalty_pa_per_m * point.area_m2;
                    visit(index, &Pressed { face, weights: &point.weights, stiffness_n_per_m, touch });
                }
            }
        }
    }

    /// How a point so far (m) from the centre is pressed.
    fn touch(&self, from_centre_m: DVec3) -> Option<Touch> {
        let of = |from_m: DVec3, radius_m: f64, by_shaft: bool| {
            let distance_m = from_m.length();
            Touch { depth_m: radius_m - distance_m, distance_m, outwards: from_m / distance_m, by_shaft }
        };
        let sphere = of(from_centre_m, self.radius_m, false);
        let up_m = from_centre_m.dot(self.axis);
        let shaft = of(from_centre_m - self.axis * up_m, SHAFT * self.radius_m, true);
        let deeper = if up_m > 0.0 && shaft.depth_m > sphere.depth_m { shaft } else { sphere };
        (deeper.depth_m > 0.0).then_some(deeper)
    }
}
