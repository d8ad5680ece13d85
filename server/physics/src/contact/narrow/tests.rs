use super::*;
use crate::contact::{ContactModel, MostCarriers, SkinAtRest, SkinFollows, SurfaceModuli, ToolShape, ToolSpec};
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
    meets_from_behind: bool,
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
        let skin = SkinAtRest {
            positions_m: mesh.positions_m(),
            surface: &surface,
            moduli: &moduli,
            mass_kg: &[1.0; 4],
            bearing_kg: &[1.0; 4],
            max_natural_frequency_rad_per_s: 1e6,
            follows: SkinFollows::StiffElements,
            carriers: MostCarriers::default(),
        };
        let model = ContactModel::build(&skin, &[tool]);
        let samples = model.tools[0].foundation.samples;
        let buffer = || Touching::with_capacity(samples);
        Self { model, x, touching: buffer(), next: buffer(), orientation, meets_from_behind: false }
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
            meets_from_behind: self.meets_from_behind,
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

/// The face's longest edge is 42.4 mm, which 13 parts of R/3 cover: 169 samples, of which each has an area of A/169.
#[test]
fn samples_are_as_far_apart_as_their_triangle_is_stretched() {
    for stretch in [1.0, 3.0, 9.0] {
        let mut bench = Bench::new(0.0);
        for x in &mut bench.x[..3] {
            *x *= stretch;
        }
        assert_eq!(bench.press(above(-0.1 * RADIUS_M)).0.apart_sq_m2, 0.0, "nothing is pressed");
        let apart_m = bench.press(above(0.3 * RADIUS_M)).0.apart_sq_m2.sqrt();
        assert!((apart_m - stretch * 0.03 / 13.0).abs() < 1e-12, "{stretch}: {apart_m}");
    }
}

proptest! {
    #[test]
    fn forces_balance_and_are_the_gradient_of_the_energy(
        shift in prop::array::uniform3(-0.3..0.3_f64), axis in 0..3_usize, node in 0..3_usize,
        stretch in prop::array::uniform2(0.8..1.6_f64),
    ) {
        // Corners of the upper face, moved; the far one (3) is out of reach.
        let centre = above(0.3 * RADIUS_M) + DVec3::from(shift) * RADIUS_M;
        let mut bench = Bench::new(0.0);
        for x in &mut bench.x[..3] {
            *x *= DVec3::new(stretch[0], stretch[1], 1.0);
        }
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
        let apart_n = (slopes.x + pressed.force_n[axis]).abs();
        prop_assert!(apart_n <= 1e-5 * pressed.pressing_n, "{slopes} {}", pressed.force_n);
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
            let sum_n = pressed.force_n + forces.iter().sum::<DVec3>();
            prop_assert!(sum_n.length() <= 1e-12 * pressed.pressing_n + 1e-18);
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
        assert!((a.energy_j - b.energy_j).abs() < 1e-9 * b.energy_j && (a.heat_j - b.heat_j).abs() < 1e-9 * b.energy_j);
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
    assert!(rolled(1.0) < 0.02 * rolled(0.0) && rolled(-1.0) > 1.5 * rolled(0.0), "{} {}", rolled(1.0), rolled(0.0));
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

/// In the way of a tool that presses another wall, they are pushed out, by a force that is the gradient of what it stores.
#[test]
fn samples_reached_from_behind_are_pushed_out_where_they_are_in_the_way() {
    let mut bench = Bench::new(0.0);
    bench.meets_from_behind = true;
    let at = |depth: f64| DVec3::new(0.004, 0.004, -RADIUS_M + depth * RADIUS_M);
    let (mut pressed, mut forces) = bench.press(at(0.0));
    for step in 1..=30 {
        let before = pressed;
        (pressed, forces) = bench.press(at(0.01 * f64::from(step)));
        let work_j = -0.5 * (pressed.force_n + before.force_n).z * 0.01 * RADIUS_M;
        let stored_j = pressed.energy_j - before.energy_j;
        assert!((work_j - stored_j).abs() < 0.02 * pressed.energy_j, "step {step}: {work_j} {stored_j}");
    }
    assert!(pressed.force_n.z < 0.0 && pressed.contacts > 100, "{}", pressed.force_n);
    let pushed: DVec3 = forces.iter().sum();
    assert!(pushed.z > 0.0 && (pushed + pressed.force_n).length() < 1e-12 * pushed.length(), "{pushed}");
    // What came so stays so until it leaves, even when the other wall is let go.
    bench.meets_from_behind = false;
    assert!(bench.press(at(0.3)).0.force_n.z < 0.0);
    bench.press(DVec3::Z);
    bench.press(at(0.3));
    assert_eq!(bench.press(at(0.3)).0.contacts, 0);
}

/// Where all that could be kept was met from behind, nothing told in the next tick that the tool was put there, and
/// what could not be kept pressed with its full depth.
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

/// A device came back in the middle of a press, and its tool was put where its centre was just above the surface. The
/// surface passed the centre without a force, and from then on held the tool from above: it was caught in the wall, however
/// often the device went out and in.
#[test]
fn a_tool_put_into_the_surface_is_not_caught_when_its_centre_passes_it() {
    for height in [0.01, 0.1, 0.4] {
        let mut bench = Bench::new(0.0);
        let at = |height: f64| DVec3::new(0.008, 0.008, height * RADIUS_M);
        bench.meet(at(height), true);
        // In until the centre is on the other side of the surface, and out again, in small steps.
        let steps = ((height + 0.5) / 0.01).round() as i32;
        for step in 0..=steps {
            bench.meet(at(height - 0.01 * f64::from(step)), false);
        }
        for step in 0..=170 {
            let height = -0.5 + 0.01 * f64::from(step);
            let (pressed, _) = bench.meet(at(height), false);
            assert_eq!((pressed.force_n, pressed.energy_j), (DVec3::ZERO, 0.0), "at a height of {height} radii");
        }
        assert!(bench.touching.records().is_empty(), "it is outside");
        let (pressed, _) = bench.meet(at(0.8), false);
        assert!(pressed.force_n.z > 0.0, "and meets the surface as any other tool");
    }
}

/// A sphere beside a face has samples of the next face inside it, reached from behind. It went up, over the edge and down
/// again without leaving them, and sank into the body through the face as if there were none.
#[test]
fn a_tool_that_comes_round_an_edge_is_held_off_by_what_it_came_round_to() {
    let mut bench = Bench::new(0.0);
    let at = |x: f64, z: f64| DVec3::new(x * RADIUS_M, 1.2 * RADIUS_M, z * RADIUS_M);
    let corners = [at(-0.7, -0.4), at(-0.3, 0.25), at(0.4, 0.25), at(0.4, 0.05), at(0.4, 1.2)];
    let (mut before, _) = bench.press(corners[0]);
    let (mut pressed_up, mut given_j, start_j) = (0.0_f64, 0.0, before.energy_j);
    let mut most_j = start_j;
    for leg in corners.windows(2) {
        for step in 1..=400 {
            let (from, to) =
                (leg[0].lerp(leg[1], f64::from(step - 1) / 400.0), leg[0].lerp(leg[1], f64::from(step) / 400.0));
            let (pressed, _) = bench.press(to);
            // No energy comes from nowhere or goes there, where samples come round or elsewhere.
            given_j -= 0.5 * (before.force_n + pressed.force_n).dot(to - from);
            most_j = most_j.max(pressed.energy_j);
            assert!((pressed.energy_j - start_j - given_j).abs() < 2e-3 * most_j, "{to}");
            if to == corners[3] {
                pressed_up = pressed.force_n.z;
            }
            before = pressed;
        }
    }
    // The same sphere that comes from above is the measure. What it came round to makes half of the force: what it meets from the
    // front beside that, 0.37 of the measure.
    let mut straight = Bench::new(0.0);
    (0..=100).for_each(|step| _ = straight.press(at(0.4, 1.05 - 0.01 * f64::from(step))));
    let (of_straight, _) = straight.press(corners[3]);
    println!("{pressed_up:.3} N of {:.3}", of_straight.force_n.z);
    assert!(pressed_up > 0.6 * of_straight.force_n.z, "{pressed_up} {}", of_straight.force_n);
    assert!(bench.touching.records().is_empty() && before.force_n == DVec3::ZERO, "it leaves as any other");
}
