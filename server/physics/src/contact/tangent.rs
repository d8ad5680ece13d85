//! Stiffness of the present contact, for implicit steps: the positive part of `−∂f/∂y` of every sample in contact.
//!
//! With `w = ζ_i` on a triangle's corners and `H = k n̂n̂ᵀ + friction` per sample (see [`super::friction`]): a sticking
//! spring adds `k_t(I − n̂n̂ᵀ)`, a slipping one, whose force keeps its size and turns with the slip `t̂`,
//! `k_t e/|e|_{trial}` across `t̂`, which is `µ_f f_n/|e|` at most. What pressing makes across the normal,
//! `−k (g/|r|)(I − n̂n̂ᵀ)`, is negative and left out. Samples that are not recorded (those beyond the buffer) are left
//! out, too: they stay explicit.
//!
//! A tool's motion during the step is known. It enters as the change of force it makes where the surface stays, which
//! is not linear: a tool that leaves does not pull.
//!
//! The stiffness follows from the state alone (touched samples, positions), so that a restored run steps with the same
//! bits.
use super::{ContactModel, ContactState, Coupling, ToolState, friction::TANGENTIAL_RATIO, touching::Touch};
use glam::{DMat3, DVec3};

/// Largest number of pressed triangles per tool; others are left explicit.
const MOST: usize = 4096;

/// `Σ_s ζ_i ζ_j H_s` (N/m) of one triangle.
#[derive(Debug, Clone, Copy)]
struct TriangleTangent {
    nodes: [u32; 3],
    /// Change of the forces (N) on the corners by the tool's motion.
    change_n: [DVec3; 3],
    /// Blocks of the corner pairs (0,0), (1,1), (2,2), (0,1), (0,2), (1,2).
    blocks: [DMat3; 6],
}

/// The corners of a block.
const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// Stiffness of all contact; its buffer never grows.
#[derive(Debug, Clone, Default)]
pub(crate) struct ContactTangents {
    triangles: Vec<TriangleTangent>,
    most: usize,
}

impl ContactTangents {
    pub(crate) fn new(model: &ContactModel) -> Self {
        let most = model.tools.len() * model.triangles.len().min(MOST);
        Self { triangles: Vec::with_capacity(most), most }
    }

    /// Adds `factor K_c a` to `out`.
    pub(crate) fn add_products(&self, factor: f64, a: &[DVec3], out: &mut [DVec3]) {
        for triangle in &self.triangles {
            let a = triangle.nodes.map(|n| a[n as usize] * factor);
            for (block, (i, j)) in triangle.blocks.iter().zip(PAIRS) {
                out[triangle.nodes[i] as usize] += *block * a[j];
                if i != j {
                    out[triangle.nodes[j] as usize] += *block * a[i];
                }
            }
        }
    }

    /// Adds `factor` times the change of the forces (N) by the tools' motion.
    pub(crate) fn add_changes(&self, factor: f64, out: &mut [DVec3]) {
        for triangle in &self.triangles {
            for (&node, change_n) in triangle.nodes.iter().zip(triangle.change_n) {
                out[node as usize] += change_n * factor;
            }
        }
    }

    fn push(&mut self, triangle: &TriangleTangent) {
        if self.triangles.len() < self.most {
            self.triangles.push(*triangle);
        }
    }
}

/// The step for which the stiffness is taken.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StepAhead {
    /// Its length (s).
    pub(crate) dt_s: f64,
    /// The tick's length (s).
    pub(crate) tick_period_s: f64,
}

impl ContactModel {
    /// Computes the stiffness of what tools touch, at positions `x` (m). Allocates nothing.
    pub(crate) fn take_tangents(
        &self,
        x: &[DVec3],
        tools: &[ToolState],
        contact: &ContactState,
        step: StepAhead,
        tangents: &mut ContactTangents,
    ) {
        tangents.triangles.clear();
        for (index, tool) in tools.iter().enumerate() {
            let tool_m_per_s = match self.tools[index].spec.coupling {
                Coupling::Rigid if tool.slip_m == DVec3::ZERO => {
                    (tool.target.position_m - tool.previous_target.position_m) / step.tick_period_s
                }
                _ => tool.velocity_m_per_s,
            };
            let next_centre_m = tool.centre_m + tool_m_per_s * step.dt_s;
            let mut records = contact.tools[index].touching.records();
            while let Some(first) = records.first() {
                let (triangle, end) = self.tools[index].foundation.triangle_of(first.sample);
                let (here, rest) = records.split_at(records.partition_point(|touch| touch.sample < end));
                records = rest;
                tangents.push(&self.triangle_tangent(index, triangle, tool.centre_m, next_centre_m, x, here));
            }
        }
    }

    fn triangle_tangent(
        &self,
        tool: usize,
        triangle: usize,
        centre_m: DVec3,
        next_centre_m: DVec3,
        x: &[DVec3],
        touches: &[Touch],
    ) -> TriangleTangent {
        let spec = &self.tools[tool].spec;
        let samples = self.tools[tool].foundation.of(triangle, &self.tables);
        let [a, b, c] = self.triangles.corners(triangle, x);
        let nodes = self.triangles.nodes[triangle];
        let mut sum = TriangleTangent { nodes, change_n: [DVec3::ZERO; 3], blocks: [DMat3::ZERO; 6] };
        for touch in touches.iter().filter(|touch| !touch.from_behind) {
            let [wb, wc] = samples.weights[(touch.sample - samples.first) as usize];
            let y = a + (b - a) * wb + (c - a) * wc;
            let sample = |r: DVec3| Sample {
                k: samples.stiffness_n_per_m,
                friction: spec.friction_coefficient,
                r,
                depth_m: spec.radius_m - r.length() - touch.free_depth_m,
                spring_origin_m: touch.spring_origin_m,
            };
            let (now, next) = (sample(y - centre_m), sample(y - next_centre_m));
            let change_n = next.force_n() - now.force_n();
            let stiffness = next.stiffness();
            let weights = [1.0 - wb - wc, wb, wc];
            for (corner, weight) in sum.change_n.iter_mut().zip(weights) {
                *corner += change_n * weight;
            }
            for (block, (i, j)) in sum.blocks.iter_mut().zip(PAIRS) {
                *block += stiffness * (weights[i] * weights[j]);
            }
        }
        sum
    }
}

/// A sample in contact with a tool; the nearest point of the tool's axis is at `−r` from it.
struct Sample {
    k: f64,
    friction: f64,
    r: DVec3,
    depth_m: f64,
    spring_origin_m: DVec3,
}

impl Sample {
    /// Returns unit normal, friction spring, and the length at which the spring slips; `None` out of contact.
    fn contact(&self) -> Option<(DVec3, DVec3, f64)> {
        let distance_m = self.r.length();
        (self.depth_m > 0.0 && distance_m > 0.0).then(|| {
            let normal = self.r / distance_m;
            let limit_m = self.friction * self.depth_m / TANGENTIAL_RATIO;
            (normal, (self.r - self.spring_origin_m).reject_from_normalized(normal), limit_m)
        })
    }

    /// Returns the force (N) on the surface.
    fn force_n(&self) -> DVec3 {
        self.contact().map_or(DVec3::ZERO, |(normal, spring, limit_m)| {
            (normal * self.depth_m - spring.clamp_length_max(limit_m) * TANGENTIAL_RATIO) * self.k
        })
    }

    /// Returns the positive part `H` (N/m) of `−∂f/∂y`.
    fn stiffness(&self) -> DMat3 {
        let Some((normal, spring, limit_m)) = self.contact() else { return DMat3::ZERO };
        let square = |a: DVec3| DMat3::from_cols(a * a.x, a * a.y, a * a.z);
        let along = square(normal);
        let length_m = spring.length();
        let across = if limit_m <= 0.0 {
            DMat3::ZERO
        } else if length_m >= limit_m * (1.0 - 1e-9) {
            // It slips (after a slip the spring is at the limit, to rounding): µ f_n/|e| across the slip.
            (DMat3::IDENTITY - along - square(spring / length_m)) * (TANGENTIAL_RATIO * limit_m / length_m)
        } else {
            (DMat3::IDENTITY - along) * TANGENTIAL_RATIO
        };
        (along + across) * self.k
    }
}
