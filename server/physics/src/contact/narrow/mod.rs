//! The narrow phase: pressure and friction of one tool on the samples inside it; friction itself is in [`super::friction`].
//!
//! A sample enters contact when the tool's surface passes over it from the outside, `n·(c − y) > 0` with the outward
//! normal `n` and the nearest point `c` of the tool's axis; one that the tool reaches from behind (the far wall of a
//! thin shell) is ignored for as long as it stays inside. Once in, a sample is tracked until it leaves, so that neither
//! the normal nor the order of events can make the energy jump. A tool that is *put* into the surface (not moved there)
//! presses nothing at first: its samples carry `k_f a (g − g₀)` from the depth `g₀` at which it was put, or the least
//! depth since. A sample that carries nothing and comes behind the tool is ignored, too.
//!
//! Around an edge, the samples of the far side are reached from behind. Where a tool then comes round the edge without
//! leaving them, to their outer side, they are in its way: from there on such a sample carries `k_f a (g − g₀)` with the
//! depth `g₀` at which it came before the tool, or the least since. Otherwise the tool would sink in through them.
//!
//! A closed surface of springs is hollow. Where a tool presses one of its walls and reaches another from behind, the first wall
//! is between the tool and the second and would press it. So the second is in the tool's way, too: it is pushed out, and what was
//! reached before the first was pressed carries nothing up to its depth at that time. Otherwise the first wall would pass through
//! the second, and the tool, once it is beyond, would be caught behind it.
use super::{
    axis::Axis,
    broad::{Candidates, Triangles},
    depth::DepthResponse,
    foundation::{Foundation, SampleTables, TriangleSamples},
    friction::FrictionSpring,
    local_torque::Levers,
    stretched_area::{AreaFactor, area_gradients_m},
    touching::{Touch, Touching},
};
use glam::{DQuat, DVec3};

/// One tool and the surface that it meets at one instant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Meeting<'a> {
    pub(super) triangles: &'a Triangles,
    pub(super) foundation: &'a Foundation,
    pub(super) tables: &'a SampleTables,
    pub(super) x: &'a [DVec3],
    pub(super) axis: Axis,
    /// Orientation of a tool that turns, `None` for another.
    pub(super) orientation: Option<DQuat>,
    pub(super) radius_m: f64,
    pub(super) friction_coefficient: f64,
    /// Whether the tool was put there, now or before, and has not left the surface yet: samples that are not on record
    /// then carry nothing up to their present depth; those that cannot be recorded carry nothing at all.
    pub(super) put_into: bool,
    /// Whether samples that are reached from behind are in the tool's way.
    pub(super) meets_from_behind: bool,
}

/// Sums over the samples in contact.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pressed {
    /// Force on the tool (N).
    pub(super) force_n: DVec3,
    /// Torque on the tool about its centre (N m); zero for a tool that does not turn.
    pub(super) torque_nm: DVec3,
    /// Moments of the samples in contact about the centre of such a tool.
    pub(super) levers: Levers,
    /// The part of the force along the samples' normals (N).
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
    /// Largest factor by which the foundation is stiffer than at rest.
    pub(super) most_stiffened: f64,
    /// Heat of slipping (J) since the last evaluation.
    pub(super) heat_j: f64,
    /// Number of samples that carry force.
    pub(super) contacts: u32,
    /// Depth (m) of the deepest sample, whether it carries all of it or not; what carries nothing since the tool came round
    /// an edge to it is no depth.
    pub(super) penetration_m: f64,
    /// Largest depth (m) that any sample carries.
    pub(super) deepest_m: f64,
    /// Square (m²) of the largest distance between neighbouring samples of a triangle that carries force.
    pub(super) apart_sq_m2: f64,
    /// Vector (m) from the nearest point of the tool's axis to the nearest point of the surface; infinite when no
    /// triangle is listed.
    pub(super) to_surface_m: DVec3,
    /// Vector (m) from the tool's centre to that point of its axis.
    pub(super) arm_m: DVec3,
    /// The triangle of the nearest point and its weights there; the weights are zero when no triangle is listed.
    pub(super) nearest: (usize, [f64; 3]),
}

impl Pressed {
    /// Adds the forces and the energy of another instant.
    pub(super) fn add(&mut self, other: &Self) {
        self.force_n += other.force_n;
        self.torque_nm += other.torque_nm;
        self.levers.add(&other.levers);
        self.normal_n += other.normal_n;
        self.pressing_n += other.pressing_n;
        self.sticking_n += other.sticking_n;
        self.force_times_k_f += other.force_times_k_f;
        self.force_times_modulus += other.force_times_modulus;
        self.energy_j += other.energy_j;
        self.most_stiffened = self.most_stiffened.max(other.most_stiffened);
    }

    /// Returns forces and energy times a factor.
    pub(super) fn scaled(&self, factor: f64) -> Self {
        Self {
            force_n: self.force_n * factor,
            torque_nm: self.torque_nm * factor,
            levers: self.levers.scaled(factor),
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

/// Presses a tool on the listed triangles (ascending): adds the forces on nodes, updates the samples that it touches,
/// and returns the sums. A triangle that cannot have come within the radius since it was looked at last is looked at
/// only if no other one is within it, to find the nearest.
pub(super) fn press(
    meeting: &Meeting<'_>,
    candidates: &mut Candidates,
    touching: &mut Touching,
    next: &mut Touching,
    forces_n: &mut [DVec3],
) -> Pressed {
    let mut pressed = Pressed { to_surface_m: DVec3::INFINITY, ..Pressed::default() };
    let mut nearest = Nearest { distance_m: f64::INFINITY, ..Nearest::default() };
    let mut before = touching.records();
    next.clear();
    for number in 0..candidates.triangles().len() {
        if candidates.least_distance_m(number) >= meeting.radius_m {
            continue;
        }
        let triangle = candidates.triangles()[number] as usize;
        let corners = meeting.triangles.corners(triangle, meeting.x);
        let distance_m = nearest.look_at(&meeting.axis, triangle, corners);
        candidates.set_distance_m(number, distance_m);
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
    if nearest.distance_m >= meeting.radius_m {
        for number in 0..candidates.triangles().len() {
            if candidates.least_distance_m(number) <= nearest.distance_m {
                let triangle = candidates.triangles()[number] as usize;
                let corners = meeting.triangles.corners(triangle, meeting.x);
                candidates.set_distance_m(number, nearest.look_at(&meeting.axis, triangle, corners));
            }
        }
    }
    if nearest.distance_m < f64::INFINITY {
        (pressed.to_surface_m, pressed.nearest) = (nearest.to_point_m, (nearest.triangle, nearest.weights));
        pressed.arm_m = nearest.arm_m;
    }
    pressed
}

/// The nearest point of the triangles that were looked at; of equally near ones that of the first triangle.
#[derive(Debug, Clone, Copy, Default)]
struct Nearest {
    distance_m: f64,
    arm_m: DVec3,
    to_point_m: DVec3,
    triangle: usize,
    weights: [f64; 3],
}

impl Nearest {
    /// Looks at a triangle, and returns how far (m) it is from the axis.
    fn look_at(&mut self, axis: &Axis, triangle: usize, corners: [DVec3; 3]) -> f64 {
        let found = axis.approach(corners);
        let distance_m = found.to_triangle_m.length();
        if distance_m < self.distance_m || (distance_m == self.distance_m && triangle < self.triangle) {
            let (arm_m, to_point_m, weights) = (found.arm_m, found.to_triangle_m, found.weights);
            *self = Self { distance_m, arm_m, to_point_m, triangle, weights };
        }
        distance_m
    }
}

/// Presses the samples of one triangle; returns the forces (N) on its corners.
fn press_triangle(
    meeting: &Meeting<'_>,
    samples: &TriangleSamples<'_>,
    [a, b, c]: [DVec3; 3],
    before: &mut &[Touch],
    next: &mut Touching,
    pressed: &mut Pressed,
) -> [DVec3; 3] {
    let mut nodal = [DVec3::ZERO; 3];
    let (ab, ac, from_centre) = (b - a, c - a, a - meeting.axis.centre_m);
    let outward = ab.cross(ac);
    let doubled_m2 = outward.length();
    let area = AreaFactor::of(0.5 * doubled_m2 / samples.rest_m2);
    let samples = TriangleSamples { area_factor: area.factor, ..*samples };
    let energy_before_j = pressed.energy_j;
    let (radius_sq, is_sphere) = (meeting.radius_m * meeting.radius_m, meeting.axis.is_point());
    for (index, &[wb, wc]) in samples.weights.iter().enumerate() {
        // p = y − c₀, r = y − c
        let p = from_centre + ab * wb + ac * wc;
        let r = if is_sphere { p } else { p - meeting.axis.nearest_m(p) };
        let distance_sq = r.length_squared();
        if distance_sq >= radius_sq {
            continue;
        }
        let number = samples.first + index as u32;
        let is_behind = outward.dot(r) >= 0.0;
        let distance_m = distance_sq.sqrt();
        let depth_m = meeting.radius_m - distance_m;
        let known = take(before, number).map(|touch| {
            if touch.from_behind && !is_behind {
                touch.come_round(depth_m, meeting.in_tool(p))
            } else if touch.from_behind && meeting.meets_from_behind && touch.free_depth_m == 0.0 {
                touch.push_out(depth_m)
            } else {
                touch
            }
        });
        let is_ignored = is_behind && !meeting.meets_from_behind;
        let from_behind = known.map_or(is_ignored, |touch| touch.from_behind);
        let free_depth_m = if meeting.put_into { depth_m } else { 0.0 };
        // One that carries nothing and passes the axis is behind from then on: on its way back to the outside the tool would
        // be held by it.
        let carries_nothing = |touch: &Touch| depth_m <= touch.free_depth_m && !touch.pushed_out;
        let from_behind = from_behind || known.as_ref().is_some_and(carries_nothing) && is_behind;
        let new = || Touch {
            sample: number,
            from_behind,
            came_round: false,
            pushed_out: is_behind && !from_behind,
            free_depth_m,
            spring_origin_m: meeting.in_tool(p),
        };
        if from_behind {
            // The sample carries nothing, but its depth tells the next tick that the tool was put there.
            next.push(new());
            continue;
        }
        let mut touch = known.unwrap_or_else(new);
        touch.free_depth_m = touch.free_depth_m.min(depth_m);
        // A sample exactly on the axis has no direction: it carries nothing for this instant.
        let normal = r / distance_m.max(f64::MIN_POSITIVE);
        let force_n = press_sample(meeting, &samples, p, normal, distance_m, &mut touch, pressed);
        next.push(touch);
        nodal[0] += force_n * (1.0 - wb - wc);
        nodal[1] += force_n * wb;
        nodal[2] += force_n * wc;
        pressed.force_n -= force_n;
        if meeting.orientation.is_some() {
            pressed.torque_nm -= p.cross(force_n);
        }
    }
    if pressed.energy_j > energy_before_j {
        // n² samples in the triangle's area: 2A/n²
        pressed.apart_sq_m2 = pressed.apart_sq_m2.max(doubled_m2 / samples.weights.len() as f64);
    }
    if area.slope > 0.0 && pressed.energy_j > energy_before_j {
        // f_i = −φ' W/A₀ ∂A/∂x_i
        let energy_j = (pressed.energy_j - energy_before_j) / area.factor;
        let tension_n_per_m = area.slope * energy_j / samples.rest_m2;
        let gradients_m = area_gradients_m([a, b, c], outward / doubled_m2);
        for (force_n, gradient_m) in nodal.iter_mut().zip(gradients_m) {
            *force_n -= gradient_m * tension_n_per_m;
        }
    }
    nodal
}

impl Meeting<'_> {
    /// Transforms a vector (m) from the tool's centre from the world to the tool's frame, where the tool turns.
    fn in_tool(&self, p: DVec3) -> DVec3 {
        self.orientation.map_or(p, |orientation| orientation.conjugate() * p)
    }

    /// Transforms a vector back to the world.
    fn in_world(&self, p: DVec3) -> DVec3 {
        self.orientation.map_or(p, |orientation| orientation * p)
    }
}

/// Presses one sample at `p` from the tool's centre, which is `distance_m` from the tool's axis in the direction
/// `normal`; returns the force (N) on it.
fn press_sample(
    meeting: &Meeting<'_>,
    samples: &TriangleSamples<'_>,
    p: DVec3,
    normal: DVec3,
    distance_m: f64,
    touch: &mut Touch,
    pressed: &mut Pressed,
) -> DVec3 {
    let depth_m = meeting.radius_m - distance_m - touch.free_depth_m;
    let response = DepthResponse::of(depth_m, meeting.radius_m);
    // |f_n| = φ k_f a F(g − g₀), Φ = φ k_f a E(g − g₀)
    let stiffness_n_per_m = samples.area_factor * samples.stiffness_n_per_m;
    let f_n = stiffness_n_per_m * response.force_m;
    pressed.energy_j += stiffness_n_per_m * response.energy_m2;
    pressed.most_stiffened = pressed.most_stiffened.max(samples.area_factor * response.stiffness);
    pressed.pressing_n += f_n;
    pressed.force_times_k_f += f_n * samples.foundation_pa_per_m;
    pressed.force_times_modulus += f_n * samples.indentation_modulus_pa;
    pressed.normal_n -= normal * f_n;
    if meeting.orientation.is_some() {
        pressed.levers.push(p, normal, f_n);
    }
    pressed.contacts += u32::from(depth_m > 0.0);
    pressed.deepest_m = pressed.deepest_m.max(depth_m);
    let seen_m = if touch.came_round { depth_m } else { meeting.radius_m - distance_m };
    pressed.penetration_m = pressed.penetration_m.max(seen_m);

    let trial_m = (p - meeting.in_world(touch.spring_origin_m)).reject_from_normalized(normal);
    let spring = FrictionSpring::stretched(trial_m, samples.stiffness_n_per_m, f_n, meeting.friction_coefficient);
    match spring.heat_j {
        Some(heat_j) => pressed.heat_j += heat_j,
        None => pressed.sticking_n += f_n,
    }
    touch.spring_origin_m = meeting.in_tool(p - spring.stretch_m);
    normal * f_n - spring.stretch_m * spring.stiffness_n_per_m
}

/// Returns the record of a sample, if it was inside before; skips those of samples that left.
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

#[cfg(test)]
mod tests;
