//! Contact at rest: the foundation's potential, force and stiffness for spheres held in place, without friction or history.
//!
//! `Φ = ½ Σ_s k_f a_s g_s²`, `g = R − |r|`, `r = y − c` (see [`super::foundation`]). With `n̂ = r/|r|`:
//! `−∂Φ/∂y = k g n̂`, `∂²Φ/∂y² = k n̂n̂ᵀ − k (g/|r|)(I − n̂n̂ᵀ)`; nodes get both through the weights ζ.
//!
//! Which samples a tool may press is settled once, where it arrives: those whose outward side it is on, and those it pressed
//! before it moved. So the potential is one smooth function while equilibrium is sought.
use super::ContactModel;
use glam::{DMat3, DVec3};

/// Spheres at rest against the surface.
#[derive(Debug, Clone)]
pub(crate) struct RestingContact {
    centres_m: Vec<DVec3>,
    /// Per tool and sample: may be pressed.
    front: Vec<Vec<bool>>,
}

/// A sample inside a sphere.
struct PressedSample {
    tool: usize,
    triangle: usize,
    weights: [f64; 3],
    /// `k_f a` (N/m).
    stiffness_n_per_m: f64,
    /// `R − |r|` (m).
    depth_m: f64,
    distance_m: f64,
    normal: DVec3,
}

impl RestingContact {
    /// Tools arriving at `centres_m` while the body is at `x`.
    pub(crate) fn arrive(model: &ContactModel, centres_m: Vec<DVec3>, x: &[DVec3], before: Option<&Self>) -> Self {
        let front = |tool: usize| {
            let mut allowed = vec![false; model.tools[tool].foundation.samples];
            for triangle in 0..model.triangles.len() {
                let [a, b, c] = model.triangles.corners(triangle, x);
                let outward = (b - a).cross(c - a);
                let samples = model.tools[tool].foundation.of(triangle, &model.tables);
                for (index, &[wb, wc]) in samples.weights.iter().enumerate() {
                    let sample = samples.first as usize + index;
                    let y = a + (b - a) * wb + (c - a) * wc;
                    allowed[sample] = outward.dot(y - centres_m[tool]) < 0.0
                        || before.is_some_and(|before| {
                            let inside = y.distance(before.centres_m[tool]) < model.tools[tool].spec.radius_m;
                            inside && before.front[tool][sample]
                        });
                }
            }
            allowed
        };
        Self { front: (0..model.tools.len()).map(front).collect(), centres_m }
    }

    /// `Φ` (J) of all tools.
    pub(crate) fn potential_j(&self, model: &ContactModel, x: &[DVec3]) -> f64 {
        let mut sum = 0.0;
        self.for_each(model, x, |s| sum += 0.5 * s.stiffness_n_per_m * s.depth_m * s.depth_m);
        sum
    }

    /// Adds the forces (N) on nodes, and returns that on every tool.
    pub(crate) fn add_forces_n(&self, model: &ContactModel, x: &[DVec3], forces_n: &mut [DVec3]) -> Vec<DVec3> {
        let mut on_tools = vec![DVec3::ZERO; self.centres_m.len()];
        self.for_each(model, x, |s| {
            let force = s.normal * (s.stiffness_n_per_m * s.depth_m);
            for (&node, weight) in model.triangles.nodes[s.triangle].iter().zip(s.weights) {
                forces_n[node as usize] += force * weight;
            }
            on_tools[s.tool] -= force;
        });
        on_tools
    }

    /// Calls `add(node_i, node_j, block)` with `∂²Φ/∂x_i∂x_j` (N/m), once per pair `i ≤ j` of a triangle's corners.
    /// `definite` leaves out the part that pressing makes across the normal, which is negative.
    pub(crate) fn for_each_block(
        &self,
        model: &ContactModel,
        x: &[DVec3],
        definite: bool,
        mut add: impl FnMut(u32, u32, &DMat3),
    ) {
        self.for_each(model, x, |s| {
            let along = DMat3::from_cols(s.normal * s.normal.x, s.normal * s.normal.y, s.normal * s.normal.z);
            let across = if definite { 0.0 } else { s.depth_m / s.distance_m };
            let hessian = (along - (DMat3::IDENTITY - along) * across) * s.stiffness_n_per_m;
            let nodes = model.triangles.nodes[s.triangle];
            for i in 0..3 {
                for j in i..3 {
                    add(nodes[i], nodes[j], &(hessian * (s.weights[i] * s.weights[j])));
                }
            }
        });
    }

    fn for_each(&self, model: &ContactModel, x: &[DVec3], mut visit: impl FnMut(&PressedSample)) {
        for (tool, &centre) in self.centres_m.iter().enumerate() {
            let radius_m = model.tools[tool].spec.radius_m;
            for triangle in 0..model.triangles.len() {
                let corners = model.triangles.corners(triangle, x);
                let [a, b, c] = corners;
                // No point of a triangle is nearer than its first corner less its longest edge from there.
                if centre.distance(a) - a.distance(b).max(a.distance(c)) >= radius_m {
                    continue;
                }
                let samples = model.tools[tool].foundation.of(triangle, &model.tables);
                for (index, &[wb, wc]) in samples.weights.iter().enumerate() {
                    let r = a - centre + (b - a) * wb + (c - a) * wc;
                    let distance_m = r.length();
                    if distance_m < radius_m && distance_m > 0.0 && self.front[tool][samples.first as usize + index] {
                        visit(&PressedSample {
                            tool,
                            triangle,
                            weights: [1.0 - wb - wc, wb, wc],
                            stiffness_n_per_m: samples.stiffness_n_per_m,
                            depth_m: radius_m - distance_m,
                            distance_m,
                            normal: r / distance_m,
                        });
                    }
                }
            }
        }
    }
}
