//! A rigid sphere without friction as inequality constraints on the samples of the surface.
//!
//! Every sample `y = Σ ζ_i x_i` inside the sphere that the sphere met from outside, to the depth `g = R − |y − c|`, has the
//! potential `k_f a φ(r) E(g)` of the server's foundation. So `C = √(2 φ E) = 0` (which is g where the surface is not
//! stretched and the sample not deep) with the compliance `α = 1/(k_f a)`:
//! ```text
//! ∇_i C = (−φ E' ζ_i n̂ + φ' E ∂r/∂x_i)/C
//! Δλ = C/(Σ w |∇C|² + α/h²)        Δx_i = −w_i ∇_i C Δλ        force on the tool −φ E'/C n̂ Δλ/h²
//! ```
use super::elements::Node;
use glam::DVec3;
use palpate_physics::{
    Model,
    contact::{SamplePotential, closest_weights},
};

/// How far (in R) the surface may come nearer within a tick.
const MARGIN: f64 = 0.25;

/// What a sphere may touch.
pub(super) struct Contact {
    radius_m: f64,
    triangles: Vec<Triangle>,
    /// Those near the sphere in this tick.
    near: Vec<u32>,
}

struct Triangle {
    nodes: [u32; 3],
    /// Weights of all three corners in every sample.
    weights: Vec<[f64; 3]>,
    /// `1/(k_f a h²)` (1/kg).
    compliance: f64,
    /// Area at rest (m²).
    rest_m2: f64,
}

impl Contact {
    /// Of the model's first tool, for substeps `h_s` (s).
    pub(super) fn of(model: &Model, radius_m: f64, h_s: f64) -> Self {
        let triangles = model.contact().foundation(0).map(|t| Triangle {
            nodes: t.nodes,
            weights: t.weights.iter().map(|&[b, c]| [1.0 - b - c, b, c]).collect(),
            compliance: 1.0 / (t.stiffness_n_per_m * h_s * h_s),
            rest_m2: t.rest_m2,
        });
        let triangles: Vec<Triangle> = triangles.collect();
        Self { radius_m, near: Vec::with_capacity(triangles.len()), triangles }
    }

    /// Once a tick: lists what is near.
    pub(super) fn look(&mut self, centre_m: DVec3, nodes: &[Node]) {
        self.near.clear();
        for (index, triangle) in self.triangles.iter().enumerate() {
            let [a, b, c] = triangle.nodes.map(|n| nodes[n as usize].x);
            // No point of a triangle is nearer than its first corner less its longest edge from there.
            if centre_m.distance(a) - a.distance(b).max(a.distance(c)) < (1.0 + MARGIN) * self.radius_m {
                self.near.push(index as u32);
            }
        }
    }

    /// One sweep; returns `Σ n̂ Δλ` (kg m), the impulse on the body times the substep.
    pub(super) fn project(&self, centre_m: DVec3, nodes: &mut [Node]) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for &index in &self.near {
            let triangle = &self.triangles[index as usize];
            let corners = triangle.nodes.map(|n| nodes[n as usize].x);
            let closest = closest_weights(centre_m, corners);
            let nearest_m = corners[0] * closest[0] + corners[1] * closest[1] + corners[2] * closest[2];
            if nearest_m.distance_squared(centre_m) < self.radius_m * self.radius_m {
                sum += self.press(triangle, centre_m, nodes);
            }
        }
        sum
    }

    fn press(&self, triangle: &Triangle, centre_m: DVec3, nodes: &mut [Node]) -> DVec3 {
        let n = triangle.nodes.map(|n| n as usize);
        let [mut a, mut b, mut c] = n.map(|n| nodes[n]);
        let outward = (b.x - a.x).cross(c.x - a.x);
        let mut sum = DVec3::ZERO;
        for &[wa, wb, wc] in &triangle.weights {
            let r = a.x * wa + b.x * wb + c.x * wc - centre_m;
            let distance_sq = r.length_squared();
            if distance_sq >= self.radius_m * self.radius_m || distance_sq == 0.0 || outward.dot(r) >= 0.0 {
                continue;
            }
            let distance_m = distance_sq.sqrt();
            let normal = r / distance_m;
            let depth_m = self.radius_m - distance_m;
            let found = SamplePotential::of([a.x, b.x, c.x], triangle.rest_m2, depth_m, self.radius_m);
            let c_m = (2.0 * found.energy_m2).sqrt();
            let push = normal * (found.force_m / c_m);
            let [ga, gb, gc] = found.area_gradients_m.map(|gradient_m| gradient_m / c_m);
            let along = [push * wa - ga, push * wb - gb, push * wc - gc];
            let w: f64 = [a, b, c].iter().zip(along).map(|(node, along)| (node.w * along).dot(along)).sum();
            let step = c_m / (w + triangle.compliance);
            a.x += a.w * along[0] * step;
            b.x += b.w * along[1] * step;
            c.x += c.w * along[2] * step;
            sum += push * step;
        }
        for (n, node) in n.into_iter().zip([a, b, c]) {
            nodes[n] = node;
        }
        sum
    }
}
