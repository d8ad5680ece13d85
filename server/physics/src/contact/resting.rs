//! Contact at rest: the foundation's potential, force and stiffness, without friction or history.
//!
//! With `W = Σ_s k_f a_s E(g_s)` of a triangle, `g = R − |r|`, `r = y − c` (see [`super::foundation`]), `F = E'`
//! (see [`super::depth`]), and `n̂ = r/|r|`: `−∂W/∂y = k F n̂ = ∂W/∂c`, `∂²W/∂r² = H = k F' n̂n̂ᵀ − k (F/|r|)(I − n̂n̂ᵀ)`; nodes get both through the weights ζ, so
//! that with `w = (ζ, −1)` on (nodes, tool) the gradient is `w ⊗ ∂W/∂r` and the stiffness `w wᵀ ⊗ H`. The potential
//! counts the area of a stretched triangle (see [`super::stretched_area`]), with `r = A/A₀`:
//! ```text
//! Φ = φ(r) W        ∂Φ = φ ∂W + φ' W ∂r        ∂²Φ = φ ∂²W + φ' (∂r ∂Wᵀ + ∂W ∂rᵀ) + W (φ'' ∂r ∂rᵀ + φ' ∂²r)
//! ```
//!
//! A *configuration* holds the positions of all nodes, then the centres of all tools.
//!
//! Which samples a tool may press is settled where it arrives: those whose outward side it is on, and of those inside
//! it before, the ones it pressed then. So the potential is one smooth function while equilibrium is sought.
use super::{
    ContactModel,
    depth::DepthResponse,
    stretched_area::{AreaFactor, TriangleArea},
};
use crate::linalg::tensor::outer;
use glam::{DMat3, DVec3};

/// Contact at rest: which samples each tool may press.
#[derive(Debug, Clone)]
pub(crate) struct RestingContact {
    /// Whether a tool may press a sample, by tool and sample.
    front: Vec<Vec<bool>>,
}

/// How a tool presses the surface.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Pressing {
    /// Force of the body on the tool (N).
    pub(crate) force_n: DVec3,
    /// Number of samples that carry force.
    pub(crate) contacts: u32,
    /// Depth (m) of the deepest sample.
    pub(crate) penetration_m: f64,
    /// `Φ` (J).
    pub(crate) energy_j: f64,
}

/// A sample inside a sphere.
struct PressedSample {
    weights: [f64; 3],
    /// `k_f a` (N/m).
    stiffness_n_per_m: f64,
    /// `R − |r|` (m).
    depth_m: f64,
    /// How the foundation answers to it.
    response: DepthResponse,
    distance_m: f64,
    normal: DVec3,
}

/// A triangle with samples inside a sphere.
struct PressedTriangle<'a> {
    tool: usize,
    nodes: [u32; 3],
    /// How its area counts.
    area: TriangleArea,
    samples: &'a [PressedSample],
}

impl PressedTriangle<'_> {
    /// Returns `W` (J).
    fn energy_at_rest_j(&self) -> f64 {
        self.samples.iter().map(|s| s.stiffness_n_per_m * s.response.energy_m2).sum()
    }

    /// Returns `−∂W` (N) of the corners and of the tool.
    fn forces_at_rest_n(&self) -> [DVec3; 4] {
        let mut forces_n = [DVec3::ZERO; 4];
        for s in self.samples {
            let force_n = s.normal * (s.stiffness_n_per_m * s.response.force_m);
            for (sum, weight) in forces_n.iter_mut().zip(s.ends()) {
                *sum += force_n * weight;
            }
        }
        forces_n
    }
}

impl PressedSample {
    /// Returns `w`: the weights of the corners, and −1 of the tool.
    fn ends(&self) -> [f64; 4] {
        let [wa, wb, wc] = self.weights;
        [wa, wb, wc, -1.0]
    }
}

/// A sample, wherever it is.
struct Sample {
    number: usize,
    /// `r = y − c` (m).
    from_centre_m: DVec3,
    /// Outward normal of the triangle, of twice its area (m²).
    outward: DVec3,
}

impl RestingContact {
    /// Returns the contact of tools that appear where they are.
    pub(crate) fn appear(model: &ContactModel, configuration: &[DVec3]) -> Self {
        let nothing = Self { front: model.tools.iter().map(|tool| vec![false; tool.foundation.samples]).collect() };
        nothing.settled(model, configuration, |_, sample| sample.outward.dot(sample.from_centre_m) < 0.0)
    }

    /// Returns the contact of tools that moved from the configuration `before`, where they had this contact, to
    /// another.
    pub(crate) fn arrive(&self, model: &ContactModel, before: &[DVec3], now: &[DVec3]) -> Self {
        let was_inside = inside(model, before);
        self.settled(model, now, |tool, sample| {
            if was_inside[tool][sample.number] {
                self.front[tool][sample.number]
            } else {
                sample.outward.dot(sample.from_centre_m) < 0.0
            }
        })
    }

    /// Returns the contact with those samples added that tools met from the outside between two configurations and
    /// could not press; `None` if there are none.
    pub(crate) fn widened(&self, model: &ContactModel, before: &[DVec3], now: &[DVec3]) -> Option<Self> {
        let (was_inside, is_inside) = (inside(model, before), inside(model, now));
        let mut widened = false;
        let wider = self.settled(model, now, |tool, sample| {
            let met = is_inside[tool][sample.number] && !was_inside[tool][sample.number];
            let added = met && !self.front[tool][sample.number] && sample.outward.dot(sample.from_centre_m) < 0.0;
            widened |= added;
            added || self.front[tool][sample.number]
        });
        widened.then_some(wider)
    }

    fn settled(
        &self,
        model: &ContactModel,
        configuration: &[DVec3],
        mut may_press: impl FnMut(usize, &Sample) -> bool,
    ) -> Self {
        let mut settled = self.clone();
        for_every_sample(model, configuration, |tool, sample| {
            settled.front[tool][sample.number] = may_press(tool, sample);
        });
        settled
    }

    /// Returns `Φ` (J) of all tools.
    pub(crate) fn potential_j(&self, model: &ContactModel, configuration: &[DVec3]) -> f64 {
        let mut sum = 0.0;
        self.for_each(model, configuration, |pressed| {
            sum += pressed.area.factor.factor * pressed.energy_at_rest_j();
        });
        sum
    }

    /// Adds the forces (N) on nodes and tools, and returns how every tool presses.
    pub(crate) fn add_forces_n(
        &self,
        model: &ContactModel,
        configuration: &[DVec3],
        forces_n: &mut [DVec3],
    ) -> Vec<Pressing> {
        let mut tools = vec![Pressing::default(); model.tools.len()];
        self.for_each(model, configuration, |pressed| {
            let AreaFactor { factor, slope, .. } = pressed.area.factor;
            let [on_corners_n @ .., on_tool_n] = pressed.forces_at_rest_n();
            let energy_j = pressed.energy_at_rest_j();
            for ((&node, force_n), gradient) in pressed.nodes.iter().zip(on_corners_n).zip(pressed.area.gradients_per_m)
            {
                forces_n[node as usize] += force_n * factor - gradient * (slope * energy_j);
            }
            let tool = &mut tools[pressed.tool];
            tool.force_n += on_tool_n * factor;
            tool.contacts += pressed.samples.len() as u32;
            tool.penetration_m = pressed.samples.iter().map(|s| s.depth_m).fold(tool.penetration_m, f64::max);
            tool.energy_j += factor * energy_j;
        });
        let nodes = configuration.len() - tools.len();
        for (force, tool) in forces_n[nodes..].iter_mut().zip(&tools) {
            *force += tool.force_n;
        }
        tools
    }

    /// Calls `add(i, j, block)` with `∂²Φ/∂q_i∂q_j` (N/m), once per pair of a triangle's corners and the tool (numbered
    /// as in the configuration). `definite` leaves out what may be negative: the part that pressing makes across the
    /// normal, and what depends on how area and depth change together.
    pub(crate) fn for_each_block(
        &self,
        model: &ContactModel,
        configuration: &[DVec3],
        definite: bool,
        mut add: impl FnMut(u32, u32, &DMat3),
    ) {
        let nodes = configuration.len() - model.tools.len();
        self.for_each(model, configuration, |pressed| {
            let area = &pressed.area;
            let AreaFactor { factor, slope, curvature } = area.factor;
            let [a, b, c] = pressed.nodes;
            let ends = [a, b, c, (nodes + pressed.tool) as u32];
            let mut blocks = [[DMat3::ZERO; 4]; 4];
            for s in pressed.samples {
                let along = outer(s.normal, s.normal);
                let across = if definite { 0.0 } else { s.response.force_m / s.distance_m };
                let hessian = (along * s.response.stiffness - (DMat3::IDENTITY - along) * across)
                    * (factor * s.stiffness_n_per_m);
                let weights = s.ends();
                for i in 0..4 {
                    for j in i..4 {
                        blocks[i][j] += hessian * (weights[i] * weights[j]);
                    }
                }
            }
            if slope > 0.0 {
                let (energy_j, forces_n) = (pressed.energy_at_rest_j(), pressed.forces_at_rest_n());
                let [ra, rb, rc] = area.gradients_per_m;
                let ratio = [ra, rb, rc, DVec3::ZERO];
                for i in 0..4 {
                    for j in i..4 {
                        blocks[i][j] += outer(ratio[i], ratio[j]) * (curvature * energy_j);
                        if !definite {
                            let together = outer(ratio[i], forces_n[j]) + outer(forces_n[i], ratio[j]);
                            blocks[i][j] -= together * slope;
                        }
                        if j < 3 {
                            blocks[i][j] += area.hessian_per_m2(i, j, definite) * (slope * energy_j);
                        }
                    }
                }
            }
            for i in 0..4 {
                for j in i..4 {
                    add(ends[i], ends[j], &blocks[i][j]);
                }
            }
        });
    }

    /// Calls `visit` for every triangle with samples that a tool presses.
    fn for_each(&self, model: &ContactModel, configuration: &[DVec3], mut visit: impl FnMut(&PressedTriangle<'_>)) {
        let mut pressed = Vec::new();
        for_near_triangles(model, configuration, |tool, triangle, centre, corners| {
            let radius_m = model.tools[tool].spec.radius_m;
            let samples = model.tools[tool].foundation.of(triangle, &model.tables);
            let [a, b, c] = corners;
            pressed.clear();
            for (index, &[wb, wc]) in samples.weights.iter().enumerate() {
                let r = a - centre + (b - a) * wb + (c - a) * wc;
                let distance_m = r.length();
                if distance_m < radius_m && distance_m > 0.0 && self.front[tool][samples.first as usize + index] {
                    pressed.push(PressedSample {
                        weights: [1.0 - wb - wc, wb, wc],
                        stiffness_n_per_m: samples.stiffness_n_per_m,
                        depth_m: radius_m - distance_m,
                        response: DepthResponse::of(radius_m - distance_m, radius_m),
                        distance_m,
                        normal: r / distance_m,
                    });
                }
            }
            if !pressed.is_empty() {
                let (nodes, area) = (model.triangles.nodes[triangle], TriangleArea::of(corners, samples.rest_m2));
                visit(&PressedTriangle { tool, nodes, area, samples: &pressed });
            }
        });
    }
}

/// Returns which samples are inside each tool.
fn inside(model: &ContactModel, configuration: &[DVec3]) -> Vec<Vec<bool>> {
    let mut inside: Vec<Vec<bool>> = model.tools.iter().map(|tool| vec![false; tool.foundation.samples]).collect();
    for_near_triangles(model, configuration, |tool, triangle, centre, corners| {
        for_samples(model, tool, triangle, centre, corners, |sample| {
            inside[tool][sample.number] = sample.from_centre_m.length() < model.tools[tool].spec.radius_m;
        });
    });
    inside
}

fn for_every_sample(model: &ContactModel, configuration: &[DVec3], mut visit: impl FnMut(usize, &Sample)) {
    for (tool, &centre) in configuration[configuration.len() - model.tools.len()..].iter().enumerate() {
        for triangle in 0..model.triangles.len() {
            let corners = model.triangles.corners(triangle, configuration);
            for_samples(model, tool, triangle, centre, corners, |sample| visit(tool, sample));
        }
    }
}

/// Calls `visit(tool, triangle, centre, corners)` for triangles that may reach into a tool.
fn for_near_triangles(
    model: &ContactModel,
    configuration: &[DVec3],
    mut visit: impl FnMut(usize, usize, DVec3, [DVec3; 3]),
) {
    for (tool, &centre) in configuration[configuration.len() - model.tools.len()..].iter().enumerate() {
        for triangle in 0..model.triangles.len() {
            let corners = model.triangles.corners(triangle, configuration);
            let [a, b, c] = corners;
            // No point of a triangle is nearer than its first corner less its longest edge from there.
            if centre.distance(a) - a.distance(b).max(a.distance(c)) < model.tools[tool].spec.radius_m {
                visit(tool, triangle, centre, corners);
            }
        }
    }
}

fn for_samples(
    model: &ContactModel,
    tool: usize,
    triangle: usize,
    centre: DVec3,
    [a, b, c]: [DVec3; 3],
    mut visit: impl FnMut(&Sample),
) {
    let samples = model.tools[tool].foundation.of(triangle, &model.tables);
    let outward = (b - a).cross(c - a);
    for (index, &[wb, wc]) in samples.weights.iter().enumerate() {
        let from_centre_m = a - centre + (b - a) * wb + (c - a) * wc;
        visit(&Sample { number: samples.first as usize + index, from_centre_m, outward });
    }
}
