//! Narrow phase: pressure and friction of one tool on the samples inside it.
//!
//! A sample enters contact when the sphere's surface passes over it from the outside, `n·(c − y) > 0` with the outward
//! normal `n`; one that the sphere reaches from behind (the far wall of a thin shell) is ignored for as long as it stays
//! inside. Once in, a sample is tracked until it leaves, so that neither the normal nor the order of events can make the
//! energy jump.
//!
//! Coulomb friction: every sample in contact has a tangential spring `e` (m) of stiffness `k_t = τ k_f a`, stretched by the
//! sample's motion relative to the tool and cut at the cone:
//! ```text
//! e ← (I − n̂n̂ᵀ)(r − q)        r = y − c, q where the spring is at rest, n̂ = r/|r|
//! e ← e · min(1, µ_f f_n / (k_t |e|))      slip; its heat k_t|e|·(cut length) ≥ 0
//! f_t = −k_t e,  q ← r − e
//! ```
use super::{
    broad::Triangles,
    foundation::{Foundation, SampleTables, TriangleSamples},
    touching::{Touch, Touching},
    triangle::closest_point,
};
use glam::DVec3;

/// τ: tangential over normal stiffness of the foundation; Mindlin's ratio 2(1 − ν)/(2 − ν) is 0.71 at ν = 0.45 and 0.82 at 0.3.
/// At most 1, or the bound of the frequency fails.
const TANGENTIAL_RATIO: f64 = 0.75;

/// What one tool meets at one instant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Meeting<'a> {
    pub(super) triangles: &'a Triangles,
    pub(super) foundation: &'a Foundation,
    pub(super) tables: &'a SampleTables,
    pub(super) x: &'a [DVec3],
    pub(super) centre_m: DVec3,
    pub(super) radius_m: f64,
    pub(super) friction_coefficient: f64,
}

/// Sums over the samples in contact.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pressed {
    /// Force on the tool (N).
    pub(super) force_n: DVec3,
    /// Its part along the samples' normals (N).
    pub(super) normal_n: DVec3,
    /// `Σ |f_n|` (N).
    pub(super) pressing_n: f64,
    /// `Σ |f_n|` of samples that stick (N).
    pub(super) sticking_n: f64,
    /// `Σ |f_n| k_f` (N Pa/m).
    pub(super) force_times_k_f: f64,
    /// `Σ |f_n| E/(1 − ν²)` (N Pa).
    pub(super) force_times_modulus: f64,
    /// `Φ` (J).
    pub(super) energy_j: f64,
    /// Heat of slipping (J) since the last evaluation.
    pub(super) heat_j: f64,
    /// Samples that carry force.
    pub(super) contacts: u32,
    /// Deepest sample (m).
    pub(super) penetration_m: f64,
    /// Distance (m) of the surface from the tool's centre, infinite when nothing is listed.
    pub(super) distance_m: f64,
}

impl Pressed {
    /// Adds the forces and the energy of another instant.
    pub(super) fn add(&mut self, other: &Self) {
        self.force_n += other.force_n;
        self.normal_n += other.normal_n;
        self.pressing_n += other.pressing_n;
        self.sticking_n += other.sticking_n;
        self.force_times_k_f += other.force_times_k_f;
        self.force_times_modulus += other.force_times_modulus;
        self.energy_j += other.energy_j;
    }

    /// Forces and energy times a factor.
    pub(super) fn scaled(&self, factor: f64) -> Self {
        Self {
            force_n: self.force_n * factor,
            normal_n: self.normal_n * factor,
            pressing_n: self.pressing_n * factor,
            sticking_n: self.sticking_n * factor,
            force_times_k_f: self.force_times_k_f * factor,
            force_times_modulus: self.force_times_modulus * factor,
            energy_j: self.energy_j * factor,
            ..*self
        }
    }
}

/// Presses a tool on the listed triangles (ascending): adds the forces on nodes, updates what it touches, returns the sums.
pub(super) fn press(
    meeting: &Meeting<'_>,
    candidates: &[u32],
    touching: &mut Touching,
    next: &mut Touching,
    forces_n: &mut [DVec3],
) -> Pressed {
    let mut pressed = Pressed { distance_m: f64::INFINITY, ..Pressed::default() };
    let mut before = touching.records();
    next.clear();
    for &triangle in candidates {
        let triangle = triangle as usize;
        let corners = meeting.triangles.corners(triangle, meeting.x);
        let distance_m = meeting.centre_m.distance(closest_point(meeting.centre_m, corners));
        pressed.distance_m = pressed.distance_m.min(distance_m);
        if distance_m >= meeting.radius_m {
            continue;
        }
        let samples = meeting.foundation.of(triangle, meeting.tables);
        while before.first().is_some_and(|touch| touch.sample < samples.first) {
            before = &before[1..];
        }
        let nodal = press_triangle(meeting, &samples, corners, &mut before, next, &mut pressed);
        for (node, force_n) in meeting.triangles.nodes[triangle].into_iter().zip(nodal) {
            forces_n[node as usize] += force_n;
        }
    }
    std::mem::swap(touching, next);
    pressed
}

/// Forces (N) on the corners of one triangle.
fn press_triangle(
    meeting: &Meeting<'_>,
    samples: &TriangleSamples<'_>,
    [a, b, c]: [DVec3; 3],
    before: &mut &[Touch],
    next: &mut Touching,
    pressed: &mut Pressed,
) -> [DVec3; 3] {
    let mut nodal = [DVec3::ZERO; 3];
    let (ab, ac, from_centre) = (b - a, c - a, a - meeting.centre_m);
    let outward = ab.cross(ac);
    let radius_sq = meeting.radius_m * meeting.radius_m;
    for (index, &[wb, wc]) in samples.weights.iter().enumerate() {
        // r = y − c
        let r = from_centre + ab * wb + ac * wc;
        let distance_sq = r.length_squared();
        if distance_sq >= radius_sq {
            continue;
        }
        let number = samples.first + index as u32;
        let known = take(before, number);
        let from_behind = known.map_or(outward.dot(r) >= 0.0, |touch| touch.from_behind);
        if from_behind {
            next.push(Touch { sample: number, from_behind, spring_origin_m: r });
            continue;
        }
        let origin = known.map_or(r, |touch| touch.spring_origin_m);
        let force_n = press_sample(meeting, samples, r, distance_sq.sqrt(), origin, (number, next), pressed);
        nodal[0] += force_n * (1.0 - wb - wc);
        nodal[1] += force_n * wb;
        nodal[2] += force_n * wc;
        pressed.force_n -= force_n;
    }
    nodal
}

/// Force (N) on one sample.
fn press_sample(
    meeting: &Meeting<'_>,
    samples: &TriangleSamples<'_>,
    r: DVec3,
    distance_m: f64,
    spring_origin_m: DVec3,
    (number, next): (u32, &mut Touching),
    pressed: &mut Pressed,
) -> DVec3 {
    // A sample exactly at the centre has no direction: it carries nothing for this instant.
    let normal = r / distance_m.max(f64::MIN_POSITIVE);
    let depth_m = meeting.radius_m - distance_m;
    // |f_n| = k_f a g, Φ = ½ k_f a g²
    let f_n = samples.stiffness_n_per_m * depth_m;
    pressed.energy_j += 0.5 * f_n * depth_m;
    pressed.pressing_n += f_n;
    pressed.force_times_k_f += f_n * samples.foundation_pa_per_m;
    pressed.force_times_modulus += f_n * samples.indentation_modulus_pa;
    pressed.normal_n -= normal * f_n;
    pressed.contacts += 1;
    pressed.penetration_m = pressed.penetration_m.max(depth_m);

    let k_t = TANGENTIAL_RATIO * samples.stiffness_n_per_m;
    let trial = (r - spring_origin_m).reject_from_normalized(normal);
    let (stretch_m, limit_m) = (trial.length(), meeting.friction_coefficient * f_n / k_t);
    let spring = if stretch_m > limit_m {
        pressed.heat_j += k_t * limit_m * (stretch_m - limit_m);
        trial * (limit_m / stretch_m)
    } else {
        pressed.sticking_n += f_n;
        trial
    };
    next.push(Touch { sample: number, from_behind: false, spring_origin_m: r - spring });
    normal * f_n - spring * k_t
}

/// The record of a sample, if it was inside before; skips those of samples that left.
fn take(before: &mut &[Touch], sample: u32) -> Option<Touch> {
    while let Some((first, rest)) = before.split_first() {
        if first.sample > sample {
            return None;
        }
        *before = rest;
        if first.sample == sample {
            return Some(*first);
        }
    }
    None
}
