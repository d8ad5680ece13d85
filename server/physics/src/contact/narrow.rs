//! Narrow phase: pressure and friction of one tool on the samples inside it.
//!
//! A sample enters contact when the tool's surface passes over it from the outside, `n·(c − y) > 0` with the outward
//! normal `n` and the nearest point `c` of the tool's axis; one that the tool reaches from behind (the far wall of a thin shell) is ignored for as long as it stays
//! inside. Once in, a sample is tracked until it leaves, so that neither the normal nor the order of events can make the
//! energy jump. A tool that is *put* into the surface (not moved there) presses nothing at first: its samples carry
//! `k_f a (g − g₀)` from the depth `g₀` at which it was put, or the least depth since.
//!
//! Coulomb friction: every sample in contact has a tangential spring `e` (m) of stiffness `k_t = τ k_f a`, stretched by the
//! sample's motion relative to the tool and cut at the cone:
//! ```text
//! e ← (I − n̂n̂ᵀ)(p − q)        p = y − c₀ from the tool's centre, q where the spring is at rest, n̂ = r/|r|, r = y − c
//! e ← e · min(1, µ_f f_n / (k_t |e|))      slip; its heat k_t|e|·(cut length) ≥ 0
//! f_t = −k_t e,  q ← p − e
//! ```
//! `q` is a point of the tool: where the tool turns (`R`), what is kept is `Rᵀq`, so that the spring is stretched by the motion of sample and tool
//! relative to each other, `v + ω × p`.
use super::{
    axis::Axis,
    broad::{Candidates, Triangles},
    foundation::{Foundation, SampleTables, TriangleSamples},
    local_torque::Levers,
    touching::{Touch, Touching},
};
use glam::{DQuat, DVec3};

/// τ: tangential over normal stiffness of the foundation; Mindlin's ratio 2(1 − ν)/(2 − ν) is 0.71 at ν = 0.45 and 0.82 at 0.3.
/// At most 1, or the bound of the frequency fails.
pub(super) const TANGENTIAL_RATIO: f64 = 0.75;

/// What one tool meets at one instant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Meeting<'a> {
    pub(super) triangles: &'a Triangles,
    pub(super) foundation: &'a Foundation,
    pub(super) tables: &'a SampleTables,
    pub(super) x: &'a [DVec3],
    pub(super) axis: Axis,
    /// Of a tool that turns.
    pub(super) orientation: Option<DQuat>,
    pub(super) radius_m: f64,
    pub(super) friction_coefficient: f64,
    /// The tool was put there, now or before, and has not left yet: what is not known carries nothing as deep as it is, which for
    /// what cannot be recorded is nothing at all.
    pub(super) put_into: bool,
}

/// Sums over the samples in contact.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Pressed {
    /// Force on the tool (N).
    pub(super) force_n: DVec3,
    /// Torque on the tool about its centre (N m); none of a tool that does not turn.
    pub(super) torque_nm: DVec3,
    /// Where on such a tool it is pressed.
    pub(super) levers: Levers,
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
    /// From the nearest point of the tool's axis to the nearest point of the surface (m); infinite when nothing is listed.
    pub(super) to_surface_m: DVec3,
    /// From the tool's centre to that point of its axis (m).
    pub(super) arm_m: DVec3,
    /// The triangle of that point and its weights there; no weight when nothing is listed.
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
    }

    /// Forces and energy times a factor.
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

/// Presses a tool on the listed triangles (ascending): adds the forces on nodes, updates what it touches, returns the sums. A triangle that cannot have
/// come within the radius since it was looked at is looked at only where the nearest one is asked for, and no other is within.
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

/// The nearest point of the triangles looked at; of equally near ones that of the first triangle.
#[derive(Debug, Clone, Copy, Default)]
struct Nearest {
    distance_m: f64,
    arm_m: DVec3,
    to_point_m: DVec3,
    triangle: usize,
    weights: [f64; 3],
}

impl Nearest {
    /// Returns how far (m) the triangle is from the axis.
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
    let (ab, ac, from_centre) = (b - a, c - a, a - meeting.axis.centre_m);
    let outward = ab.cross(ac);
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
        let known = take(before, number);
        let from_behind = known.map_or(outward.dot(r) >= 0.0, |touch| touch.from_behind);
        let distance_m = distance_sq.sqrt();
        let depth_m = meeting.radius_m - distance_m;
        let free_depth_m = if meeting.put_into { depth_m } else { 0.0 };
        if from_behind {
            // It carries nothing anyway, but tells the next tick that the tool was put there.
            next.push(Touch { sample: number, from_behind, free_depth_m, spring_origin_m: meeting.in_tool(p) });
            continue;
        }
        let new = || Touch { sample: number, from_behind, free_depth_m, spring_origin_m: meeting.in_tool(p) };
        let mut touch = known.unwrap_or_else(new);
        touch.free_depth_m = touch.free_depth_m.min(depth_m);
        // A sample exactly on the axis has no direction: it carries nothing for this instant.
        let normal = r / distance_m.max(f64::MIN_POSITIVE);
        let force_n = press_sample(meeting, samples, (p, normal, distance_m), &mut touch, pressed);
        next.push(touch);
        nodal[0] += force_n * (1.0 - wb - wc);
        nodal[1] += force_n * wb;
        nodal[2] += force_n * wc;
        pressed.force_n -= force_n;
        if meeting.orientation.is_some() {
            pressed.torque_nm -= p.cross(force_n);
        }
    }
    nodal
}

impl Meeting<'_> {
    /// From the tool's centre (m): in the world, to the tool's frame where it turns.
    fn in_tool(&self, p: DVec3) -> DVec3 {
        self.orientation.map_or(p, |orientation| orientation.conjugate() * p)
    }

    /// And back.
    fn in_world(&self, p: DVec3) -> DVec3 {
        self.orientation.map_or(p, |orientation| orientation * p)
    }
}

/// Force (N) on one sample at `p` from the tool's centre, in the direction `normal` from the tool's axis and that far from it.
fn press_sample(
    meeting: &Meeting<'_>,
    samples: &TriangleSamples<'_>,
    (p, normal, distance_m): (DVec3, DVec3, f64),
    touch: &mut Touch,
    pressed: &mut Pressed,
) -> DVec3 {
    let depth_m = meeting.radius_m - distance_m - touch.free_depth_m;
    // |f_n| = k_f a (g − g₀), Φ = ½ k_f a (g − g₀)²
    let f_n = samples.stiffness_n_per_m * depth_m;
    pressed.energy_j += 0.5 * f_n * depth_m;
    pressed.pressing_n += f_n;
    pressed.force_times_k_f += f_n * samples.foundation_pa_per_m;
    pressed.force_times_modulus += f_n * samples.indentation_modulus_pa;
    pressed.normal_n -= normal * f_n;
    if meeting.orientation.is_some() {
        pressed.levers.push(p, normal, f_n);
    }
    pressed.contacts += u32::from(depth_m > 0.0);
    pressed.penetration_m = pressed.penetration_m.max(meeting.radius_m - distance_m);

    let k_t = TANGENTIAL_RATIO * samples.stiffness_n_per_m;
    let trial = (p - meeting.in_world(touch.spring_origin_m)).reject_from_normalized(normal);
    let (stretch_m, limit_m) = (trial.length(), meeting.friction_coefficient * f_n / k_t);
    let spring = if stretch_m > limit_m {
        pressed.heat_j += k_t * limit_m * (stretch_m - limit_m);
        trial * (limit_m / stretch_m)
    } else {
        pressed.sticking_n += f_n;
        trial
    };
    touch.spring_origin_m = meeting.in_tool(p - spring);
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

#[cfg(test)]
mod tests {
    use super::super::{ContactModel, SurfaceModuli, ToolShape, ToolSpec};
    use super::*;
    use crate::{
        contact::Coupling,
        mesh::{Surface, TetMesh},
    };
    use proptest::prelude::*;

    /// A tet with one face in the plane z = 0, looking up, and a sphere above its middle.
    struct Bench {
        model: ContactModel,
        x: Vec<DVec3>,
        touching: Touching,
        next: Touching,
        orientation: DQuat,
    }

    const RADIUS_M: f64 = 0.01;

    impl Bench {
        fn new(friction_coefficient: f64) -> Self {
            Self::of(ToolShape::Sphere, friction_coefficient)
        }

        /// Across the face, between the first corner and the others.
        fn of_capsule(half_length_m: f64, friction_coefficient: f64) -> Self {
            let along = DVec3::new(1.0, 1.0, 0.1);
            let shape = ToolShape::capsule(Coupling::Rigid, RADIUS_M, half_length_m, along);
            Self::of(shape, friction_coefficient)
        }

        fn of(shape: ToolShape, friction_coefficient: f64) -> Self {
            let orientation = shape.as_capsule().map_or(DQuat::IDENTITY, |capsule| capsule.start_orientation);
            let x = [(0.0, 0.0, 0.0), (0.03, 0.0, 0.0), (0.0, 0.03, 0.0), (0.0, 0.0, -0.03)];
            let x: Vec<DVec3> = x.into_iter().map(DVec3::from).collect();
            let mesh = TetMesh::new(x.clone(), vec![[0, 2, 1, 3]]).unwrap();
            let surface = Surface::of(&mesh).unwrap();
            let tool = ToolSpec {
                name: "tool".into(),
                shape,
                radius_m: RADIUS_M,
                coupling: Coupling::Rigid,
                friction_coefficient,
                start_position_m: DVec3::Z,
            };
            let moduli = vec![SurfaceModuli { p_wave_pa: 38e3, indentation_pa: 12.5e3 }; 4];
            let model = ContactModel::build(mesh.positions_m(), &surface, &moduli, &[1.0; 4], 1e6, &[tool]);
            let samples = model.tools[0].foundation.samples;
            let buffer = || Touching::with_capacity(samples);
            Self { model, x, touching: buffer(), next: buffer(), orientation }
        }

        fn press(&mut self, centre_m: DVec3) -> (Pressed, Vec<DVec3>) {
            self.meet(centre_m, false)
        }

        fn meet(&mut self, centre_m: DVec3, just_put: bool) -> (Pressed, Vec<DVec3>) {
            let tool = &self.model.tools[0];
            let meeting = Meeting {
                triangles: &self.model.triangles,
                foundation: &tool.foundation,
                tables: &self.model.tables,
                x: &self.x,
                axis: tool.spec.shape.axis(centre_m, self.orientation),
                orientation: tool.spec.shape.as_capsule().map(|_| self.orientation),
                radius_m: RADIUS_M,
                friction_coefficient: tool.spec.friction_coefficient,
                put_into: just_put || self.touching.tells_it_was_put(),
            };
            let mut forces = vec![DVec3::ZERO; 4];
            let mut all = Candidates::with_capacity(4);
            self.model.triangles.list_all(&mut all);
            let pressed = press(&meeting, &mut all, &mut self.touching, &mut self.next, &mut forces);
            (pressed, forces)
        }
    }

    fn above(depth_m: f64) -> DVec3 {
        DVec3::new(0.01, 0.01, RADIUS_M - depth_m)
    }

    proptest! {
        #[test]
        fn forces_balance_and_are_the_gradient_of_the_energy(
            shift in prop::array::uniform3(-0.3..0.3_f64), axis in 0..3_usize, node in 0..3_usize,
        ) {
            // Corners of the upper face, moved; the far one (3) is out of reach.
            let centre = above(0.3 * RADIUS_M) + DVec3::from(shift) * RADIUS_M;
            let mut bench = Bench::new(0.0);
            let (pressed, forces) = bench.press(centre);
            prop_assert!((pressed.force_n + forces.iter().sum::<DVec3>()).length() <= 1e-12 * pressed.pressing_n);
            let step = 1e-7;
            let mut energy = |sign: f64| {
                bench.x[node][axis] += sign * step;
                let energy = bench.press(centre).0.energy_j;
                bench.x[node][axis] -= sign * step;
                energy
            };
            let slope = (energy(1.0) - energy(-1.0)) / (2.0 * step);
            prop_assert!((slope + forces[node][axis]).abs() <= 1e-5 * pressed.pressing_n, "{slope} {}", forces[node]);
        }

        /// In place and in orientation, wherever the axis is; and the forces of tool and surface turn them as much.
        #[test]
        fn a_capsules_wrench_is_the_gradient_of_the_potential(
            shift in prop::array::uniform3(-0.5..0.5_f64), turn in prop::array::uniform3(-1.5..1.5_f64), axis in 0..3_usize,
        ) {
            let centre = above(0.5 * RADIUS_M) + DVec3::from(shift) * RADIUS_M;
            let mut bench = Bench::of_capsule(1.5 * RADIUS_M, 0.0);
            let start = DQuat::from_scaled_axis(turn.into()) * bench.orientation;
            bench.orientation = start;
            let (pressed, forces) = bench.press(centre);
            prop_assume!(pressed.contacts > 0);
            let moments: DVec3 = bench.x.iter().zip(&forces).map(|(x, f)| (*x - centre).cross(*f)).sum();
            prop_assert!((pressed.torque_nm + moments).length() <= 1e-12 * pressed.pressing_n * RADIUS_M);
            let (step, unit) = (1e-7, DVec3::AXES[axis]);
            // What comes in or goes out between is of no depth, unless it is met from behind.
            let mut changes = |by: f64| {
                let shifted = bench.press(centre + unit * (by * step)).0.energy_j;
                bench.orientation = DQuat::from_scaled_axis(unit * (by * step / RADIUS_M)) * start;
                let turned = bench.press(centre).0.energy_j;
                bench.orientation = start;
                DVec3::new(shifted, turned, 0.0)
            };
            let slopes = (changes(1.0) - changes(-1.0)) / (2.0 * step);
            prop_assert!((slopes.x + pressed.force_n[axis]).abs() <= 1e-5 * pressed.pressing_n, "{slopes} {}", pressed.force_n);
            let torque_n = pressed.torque_nm[axis] / RADIUS_M;
            prop_assert!((slopes.y + torque_n).abs() <= 1e-5 * pressed.pressing_n, "{slopes} {torque_n}");
        }

        #[test]
        fn no_sample_leaves_the_friction_cone(steps in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 1..40)) {
            let mu = 0.4;
            let mut bench = Bench::new(mu);
            let mut centre = above(0.1 * RADIUS_M);
            for step in steps {
                centre += DVec3::from(step) * 2e-4;
                let (pressed, forces) = bench.press(centre);
                let friction = pressed.force_n - pressed.normal_n;
                prop_assert!(friction.length() <= mu * pressed.pressing_n * (1.0 + 1e-12));
                prop_assert!(pressed.heat_j >= 0.0);
                prop_assert!((pressed.force_n + forces.iter().sum::<DVec3>()).length() <= 1e-12 * pressed.pressing_n + 1e-18);
                for touch in bench.touching.records() {
                    prop_assert!(touch.spring_origin_m.is_finite());
                }
            }
        }
    }

    #[test]
    fn a_short_capsule_is_a_sphere_and_a_turned_one_rubs() {
        let (mut short, mut sphere) = (Bench::of_capsule(1e-12, 0.4), Bench::new(0.4));
        for step in 0..20 {
            let centre = above(0.2 * RADIUS_M) + DVec3::X * (1e-5 * f64::from(step));
            let ((a, _), (b, _)) = (short.press(centre), sphere.press(centre));
            assert!((a.force_n - b.force_n).length() < 1e-9 * b.pressing_n && a.contacts == b.contacts);
            assert!(
                (a.energy_j - b.energy_j).abs() < 1e-9 * b.energy_j && (a.heat_j - b.heat_j).abs() < 1e-9 * b.energy_j
            );
        }
        // Turned about the vertical, it is held by the friction under it, and no force results.
        let mut bench = Bench::of_capsule(0.3 * RADIUS_M, 0.4);
        bench.press(above(0.2 * RADIUS_M));
        bench.orientation = DQuat::from_rotation_z(1e-4) * bench.orientation;
        let (pressed, _) = bench.press(above(0.2 * RADIUS_M));
        assert!(pressed.torque_nm.z < 0.0 && pressed.heat_j >= 0.0, "{}", pressed.torque_nm);
        // A ball that rolls does not rub: v + ω × p = 0 where it touches.
        let rolled = |spin: f64| {
            let mut bench = Bench::of_capsule(1e-12, 0.4);
            let (start, shift_m) = (bench.orientation, 1e-5);
            let height_m = RADIUS_M - 0.01 * RADIUS_M;
            bench.press(above(0.01 * RADIUS_M));
            bench.orientation = DQuat::from_rotation_y(spin * shift_m / height_m) * start;
            let (pressed, _) = bench.press(above(0.01 * RADIUS_M) + DVec3::X * shift_m);
            (pressed.force_n - pressed.normal_n).length()
        };
        assert!(
            rolled(1.0) < 0.02 * rolled(0.0) && rolled(-1.0) > 1.5 * rolled(0.0),
            "{} {}",
            rolled(1.0),
            rolled(0.0)
        );
    }

    #[test]
    fn it_sticks_below_the_cone_and_slips_at_it() {
        let (mu, depth) = (0.5, 0.1 * RADIUS_M);
        let mut bench = Bench::new(mu);
        bench.press(above(depth));
        let mut friction_at = |shift_m: f64| {
            let (pressed, _) = bench.press(above(depth) + DVec3::X * shift_m);
            (pressed.force_n - pressed.normal_n, pressed)
        };
        // Stuck: the tool is pulled back, the force grows with the way and vanishes with it. (The samples at the very rim,
        // where the pressure is small, slip at once.)
        let (friction, _) = friction_at(1e-6);
        let (twice, pressed) = friction_at(2e-6);
        assert!(friction.x < 0.0 && (twice.x / friction.x - 2.0).abs() < 1e-2, "{friction} {twice}");
        assert!(pressed.sticking_n > 0.99 * pressed.pressing_n);
        assert!(friction_at(0.0).0.length() < 1e-2 * friction.length());
        // Slipping: µ of the pressing force; the normals differ by up to a/R from the plane's.
        let mut pressed = Pressed::default();
        for step in 1..=50 {
            pressed = friction_at(2e-5 * f64::from(step)).1;
        }
        let friction = pressed.force_n - pressed.normal_n;
        assert!((friction.length() / (mu * pressed.pressing_n) - 1.0).abs() < 0.1, "{friction}");
        assert!(friction.x < 0.0 && friction.y.abs() < 0.05 * friction.x.abs());
        assert!(pressed.heat_j > 0.0);
    }

    #[test]
    fn samples_reached_from_behind_carry_nothing_until_they_left() {
        let mut bench = Bench::new(0.0);
        // A centre that starts inside the body and rises: every face is met from behind.
        let mut ignored = 0;
        for step in 0..=20 {
            let centre = DVec3::new(0.004, 0.004, -1.4 * RADIUS_M + 0.06 * RADIUS_M * f64::from(step));
            let (pressed, forces) = bench.press(centre);
            assert_eq!(pressed.contacts, 0, "step {step}");
            assert!(forces.iter().all(|f| *f == DVec3::ZERO));
            ignored = ignored.max(bench.touching.records().len());
        }
        assert!(ignored > 100, "{ignored}");
        bench.press(DVec3::Z);
        assert!(bench.touching.records().is_empty());
        assert!(bench.press(above(0.1 * RADIUS_M)).0.force_n.z > 0.0);
    }

    /// Where all that could be kept was met from behind, nothing told in the next tick that the tool was put there, and what could
    /// not be kept pressed with its full depth.
    #[test]
    fn a_tool_put_into_the_surface_is_known_by_the_samples_it_met_from_behind() {
        let mut bench = Bench::new(0.0);
        let deep = DVec3::new(0.004, 0.004, -0.6 * RADIUS_M);
        bench.meet(deep, true);
        assert!(bench.touching.records().len() > 3, "the ball is in the surface");
        assert!(bench.touching.records().iter().all(|touch| touch.from_behind));
        let kept = bench.touching.records().len() / 2;
        (bench.touching, bench.next) = (Touching::with_capacity(kept), Touching::with_capacity(kept));
        bench.meet(deep, true);
        let mut met_from_the_front = false;
        for step in 0..=20 {
            // Up and out: the upper face is met from the front by those that were not kept.
            let (pressed, _) = bench.meet(deep + DVec3::Z * (0.1 * RADIUS_M * f64::from(step)), false);
            assert_eq!((pressed.contacts, pressed.force_n), (0, DVec3::ZERO), "step {step}");
            met_from_the_front |= pressed.penetration_m > 0.0;
        }
        assert!(met_from_the_front, "those that were not kept are met anew");
    }
}
