//! What is done in each frame of HD's scheduler, on its thread: the pose out, the effort in. Nothing here waits, allocates or logs.
use super::ffi::{self, Device, Hd};
use crate::device::{Effort, Fault, share::Share};
use glam::{DMat3, DQuat, DVec3};
use palpate_control::Motion;
use palpate_realtime::{SlotReader, SlotWriter};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// Frames without a new effort after which the force is let go: the servo has died, or hangs.
pub const PATIENCE_FRAMES: u32 = 20;
/// More errors than this are not taken in one frame.
const MOST_ERRORS: usize = 32;
/// Beside HD's codes: poses that are none, and a panic.
const NO_POSE: u32 = u32::MAX;
const PANIC: u32 = u32::MAX - 1;
/// How far from a rotation what HD says may be.
const ROTATION_ERROR: f64 = 1e-3;

/// `HD_CALIBRATION_OK`.
pub const CALIBRATED: u32 = 0x5000;
/// `HD_CALIBRATION_NEEDS_UPDATE`.
pub const NEEDS_UPDATE: u32 = 0x5001;
/// `HD_CALIBRATION_NEEDS_MANUAL_INPUT`.
pub const NEEDS_HAND: u32 = 0x5002;

/// `HD_CALIBRATION_ENCODER_RESET`: zero is where the arm is, so done when the user says so only.
pub const ENCODER_RESET: u32 = 1;

/// What a frame found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// In the arm's axes.
    pub motion: Motion,
    /// Bit i is button i.
    pub buttons: u32,
}

/// Whether the scheduler is to call again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Next {
    /// Yes.
    Again,
    /// No.
    Done,
}

/// Flags between the frames and whoever started them.
#[derive(Debug, Default)]
pub struct Shared {
    /// The first error, of HD's codes or ours; 0: none.
    error: AtomicU32,
    /// Let go, and be done.
    pub leave: AtomicBool,
    /// It is done: the last frame had no force.
    pub left: AtomicBool,
    /// Style of the calibration that goes on; 0: none does.
    pub calibrating: AtomicU32,
    /// How it stands; 0: not asked yet.
    pub calibration: AtomicU32,
}

impl Shared {
    /// Code of the first error.
    pub fn error(&self) -> Option<u32> {
        let code = self.error.load(Ordering::Relaxed);
        (code != 0).then_some(code)
    }

    /// The first error counts.
    fn fail(&self, code: u32) {
        let _ = self.error.compare_exchange(0, code, Ordering::Relaxed, Ordering::Relaxed);
    }
}

/// What an error of HD means for the arm.
pub fn fault(code: u32) -> Fault {
    match code {
        // HD_WARM_MOTORS
        0x0200 => Fault::Overheated,
        // HD_EXCEEDED_MAX_FORCE, HD_EXCEEDED_MAX_FORCE_IMPULSE
        0x0201 | 0x0202 => Fault::TooMuchForce,
        // HD_EXCEEDED_MAX_VELOCITY
        0x0203 => Fault::TooFast,
        // HD_COMM_ERROR, HD_COMM_CONFIG_ERROR
        0x0302 | 0x0303 => Fault::Disconnected,
        // HD_TIMER_ERROR, HD_INVALID_PRIORITY, HD_SCHEDULER_FULL
        0x0304 | 0x0500 | 0x0501 => Fault::Scheduler,
        // Wrong parameters, values, handles; frames out of order; no licence.
        0x0100..=0x01FF | 0x0400..=0x04FF | 0x0600..=0x06FF => Fault::Refused,
        NO_POSE => Fault::Garbled,
        // HD_FORCE_ERROR, HD_DEVICE_FAULT, what later versions may add, a panic
        _ => Fault::Broken,
    }
}

/// From what HD says (mm, mm/s, a transform column by column, rad/s); `None` when it is no pose.
pub fn pose(
    position_mm: [f64; 3],
    velocity_mm_per_s: [f64; 3],
    transform: [f64; 16],
    angular_rad_per_s: [f64; 3],
    buttons: i32,
) -> Option<Pose> {
    let column = |n: usize| DVec3::new(transform[4 * n], transform[4 * n + 1], transform[4 * n + 2]);
    let rotation = DMat3::from_cols(column(0), column(1), column(2));
    let error = rotation.transpose() * rotation - DMat3::IDENTITY;
    let is_rotation = error.to_cols_array().iter().all(|e| e.abs() < ROTATION_ERROR) && rotation.determinant() > 0.0;
    if !is_rotation {
        return None;
    }
    let motion = Motion {
        position_m: DVec3::from(position_mm) * 1e-3,
        orientation: DQuat::from_mat3(&rotation).normalize(),
        velocity_m_per_s: DVec3::from(velocity_mm_per_s) * 1e-3,
        angular_velocity_rad_per_s: DVec3::from(angular_rad_per_s),
    };
    motion.is_finite().then_some(Pose { motion, buttons: buttons.cast_unsigned() })
}

/// Shortens efforts, and gives none to a servo that is not heard.
#[derive(Debug, Clone, Copy)]
pub struct Guard {
    max_force_n: f64,
    max_torque_nm: f64,
    unheard: u32,
    share: Share,
}

impl Guard {
    /// Nothing heard yet.
    pub fn new(max_force_n: f64, max_torque_nm: f64) -> Self {
        Self { max_force_n, max_torque_nm, unheard: PATIENCE_FRAMES, share: Share::NONE }
    }

    /// What the arm is given in this frame.
    pub fn pass(&mut self, newest: &Effort, is_new: bool) -> Effort {
        self.unheard = if is_new { 0 } else { self.unheard.saturating_add(1) };
        self.share.pass(self.unheard < PATIENCE_FRAMES);
        let share = self.share.now();
        Effort {
            plane: None,
            force_n: share * newest.force_n.clamp_length_max(self.max_force_n),
            torque_nm: share * newest.torque_nm.clamp_length_max(self.max_torque_nm),
        }
        .unless(share == 0.0)
    }
}

/// A frame, again and again.
#[derive(Debug)]
pub struct Frame {
    /// The library.
    pub hd: Hd,
    /// The arm.
    pub device: Device,
    /// It has motors for torque.
    pub turns: bool,
    /// What is given of efforts.
    pub guard: Guard,
    /// To the servo.
    pub poses: SlotWriter<Option<Pose>>,
    /// From the servo.
    pub efforts: SlotReader<Effort>,
    /// Flags.
    pub shared: std::sync::Arc<Shared>,
}

impl Frame {
    /// One frame. The force is written in each: HD would keep the one before.
    pub fn run(&mut self) -> Next {
        let hd = self.hd;
        let leaves = self.shared.leave.load(Ordering::Relaxed);
        let style = self.shared.calibrating.load(Ordering::Relaxed);
        hd.begin_frame(self.device);
        let found = pose(
            hd.doubles(ffi::POSITION),
            hd.doubles(ffi::VELOCITY),
            hd.doubles(ffi::TRANSFORM),
            hd.doubles(ffi::ANGULAR_VELOCITY),
            hd.integer(ffi::BUTTONS),
        );
        let is_new = self.efforts.take().is_some();
        let effort = self.guard.pass(self.efforts.newest(), is_new).unless(leaves || self.shared.error().is_some());
        hd.set(ffi::FORCE, effort.force_n.to_array());
        if self.turns {
            hd.set(ffi::TORQUE, (1e3 * effort.torque_nm).to_array());
        }
        let calibration = if style == 0 { CALIBRATED } else { hd.check_calibration() };
        hd.end_frame(self.device);
        if calibration == NEEDS_UPDATE && style != ENCODER_RESET {
            hd.update_calibration(style);
        }
        if style != 0 {
            self.shared.calibration.store(calibration, Ordering::Relaxed);
        }
        self.take_errors();
        match found {
            Some(pose) => self.poses.publish(Some(pose)),
            None => self.shared.fail(NO_POSE),
        }
        self.shared.left.store(leaves, Ordering::Relaxed);
        if leaves { Next::Done } else { Next::Again }
    }

    /// The oldest error is the cause of the others, and HD gives it last.
    fn take_errors(&mut self) {
        let oldest = std::iter::from_fn(|| self.hd.error()).take(MOST_ERRORS).last();
        if let Some(code) = oldest {
            self.shared.fail(code);
        }
    }

    /// A frame broke off.
    pub(super) fn fail(&mut self) {
        self.shared.fail(PANIC);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Column by column, with the place in the last.
    fn transform(rotation: DMat3, place_mm: DVec3) -> [f64; 16] {
        let (a, b, c, p) = (rotation.x_axis, rotation.y_axis, rotation.z_axis, place_mm);
        [a.x, a.y, a.z, 0.0, b.x, b.y, b.z, 0.0, c.x, c.y, c.z, 0.0, p.x, p.y, p.z, 1.0]
    }

    #[test]
    fn a_pose_is_in_metres_and_turned_as_the_transform_says() {
        // A quarter turn round z takes the tool's x to the arm's y.
        let rotation = DMat3::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let matrix = transform(rotation, DVec3::new(1.0, 2.0, 3.0));
        let found = pose([1.0, 2.0, 3.0], [10.0, 0.0, 0.0], matrix, [0.0, 0.0, 4.0], -1).unwrap();
        assert!(found.motion.position_m.distance(DVec3::new(1e-3, 2e-3, 3e-3)) < 1e-18);
        assert!(found.motion.velocity_m_per_s.distance(DVec3::X * 0.01) < 1e-17);
        assert_eq!(found.motion.angular_velocity_rad_per_s, DVec3::Z * 4.0);
        assert!((found.motion.orientation * DVec3::X).distance(DVec3::Y) < 1e-12);
        assert_eq!(found.buttons, u32::MAX);
    }

    #[test]
    fn what_is_mirrored_scaled_or_no_number_is_no_pose() {
        let at = [0.0; 3];
        for wrong in [
            transform(DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0)), DVec3::ZERO),
            transform(DMat3::IDENTITY * 1.01, DVec3::ZERO),
            transform(DMat3::ZERO, DVec3::ZERO),
            [f64::NAN; 16],
        ] {
            assert_eq!(pose(at, at, wrong, at, 0), None, "{wrong:?}");
        }
        let right = transform(DMat3::IDENTITY, DVec3::ZERO);
        for wrong in [f64::NAN, f64::INFINITY] {
            assert_eq!(pose([0.0, wrong, 0.0], at, right, at, 0), None);
            assert_eq!(pose(at, [wrong, 0.0, 0.0], right, at, 0), None);
            assert_eq!(pose(at, at, right, [0.0, 0.0, wrong], 0), None);
        }
    }

    #[test]
    fn force_is_let_go_after_so_many_frames_without_a_servo_and_comes_back_slowly() {
        let mut guard = Guard::new(2.0, 0.1);
        let push = Effort { torque_nm: DVec3::Y, ..Effort::force(DVec3::X * 5.0) };
        assert_eq!(guard.pass(&push, false), Effort::NONE);
        let rising: Vec<f64> = (0..60).map(|_| guard.pass(&push, true).force_n.x).collect();
        assert!(rising.windows(2).all(|pair| (0.0..0.041).contains(&(pair[1] - pair[0]))), "{rising:?}");
        assert_eq!(rising[59], 2.0);
        assert_eq!(guard.pass(&push, true).torque_nm, DVec3::Y * 0.1);
        let held = (1..PATIENCE_FRAMES).map(|_| guard.pass(&push, false).force_n.x).collect::<Vec<_>>();
        assert!(held.iter().all(|&n| n == 2.0), "{held:?}");
        assert_eq!(guard.pass(&push, false), Effort::NONE);
        assert!(guard.pass(&push, true).force_n.x < 0.041);
    }

    /// No two of these may be one: they are what people read.
    #[test]
    fn errors_are_told_apart() {
        let faults = [0x0200, 0x0201, 0x0203, 0x0300, 0x0302, 0x0304, 0x0102, NO_POSE].map(fault);
        assert_eq!(fault(0x0202), Fault::TooMuchForce);
        for (index, found) in faults.iter().enumerate() {
            assert!(!faults[..index].contains(found), "{found}");
        }
    }

    #[test]
    fn the_first_error_counts() {
        let shared = Shared::default();
        assert_eq!(shared.error(), None);
        shared.fail(0x0203);
        shared.fail(0x0200);
        assert_eq!(shared.error(), Some(0x0203));
    }

    proptest! {
        /// Whatever numbers come, what goes on is finite and turned by a rotation.
        #[test]
        fn any_numbers_are_a_pose_or_none(
            place in any::<[f64; 3]>(), matrix in any::<[f64; 16]>(), turn in any::<[f64; 3]>(), code in any::<u32>(),
        ) {
            let found = pose(place, turn, matrix, turn, 0);
            prop_assert!(found.is_none_or(|pose| pose.motion.is_finite()));
            let _ = fault(code);
        }

        #[test]
        fn every_rotation_is_one(axis in prop::array::uniform3(-3.0..3.0_f64)) {
            let rotation = DQuat::from_scaled_axis(DVec3::from(axis));
            let matrix = transform(DMat3::from_quat(rotation), DVec3::ZERO);
            let found = pose([0.0; 3], [0.0; 3], matrix, [0.0; 3], 0).unwrap();
            prop_assert!(found.motion.orientation.dot(rotation).abs() > 1.0 - 1e-12);
        }

        /// Whoever is heard when, no force or torque is larger than the arm's, and none without a servo.
        #[test]
        fn no_effort_is_beyond_the_limit(
            frames in prop::collection::vec((any::<[f64; 3]>(), any::<bool>()), 1..200),
        ) {
            let mut guard = Guard::new(3.0, 0.2);
            for (numbers, is_new) in frames {
                let v = DVec3::from(numbers);
                let effort = guard.pass(&Effort { torque_nm: v, ..Effort::force(v) }, is_new);
                prop_assert!(effort.force_n.length() <= 3.0 + 1e-9 && effort.torque_nm.length() <= 0.2 + 1e-9);
            }
        }
    }
}
