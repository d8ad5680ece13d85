//! From an arm's own axes to the world's, and back: turned, moved, magnified, and let go of by a button.
use super::{Arm, Effort, Fault, LastWords, Reading};
use glam::{DMat3, DQuat, DVec3};
use palpate_control::{ContactPlane, Motion};
use thiserror::Error;

/// Scales that make sense: a hand's breadth to a cell, or to a room.
const SCALES: std::ops::RangeInclusive<f64> = 1e-3..=1e3;

/// `x_world = origin + s R x_arm`, `v_world = s R v_arm`, `F_arm = Rᵀ F_world`.
///
/// The force is not magnified, so the power at the arm is the world's over s: what is passive in the world is at the arm. A stiffness K of the world is felt
/// as s K, and a damping or mass of the arm is seen in the world as its s-th part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Workspace {
    rotation: DMat3,
    origin_m: DVec3,
    scale: f64,
}

/// Why a workspace is none.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum WorkspaceError {
    /// Not one of six names.
    #[error("\"{0}\" is no axis: write +x, -x, +y, -y, +z or -z")]
    Unknown(String),
    /// An axis twice, or a mirrored frame.
    #[error(
        "{0}, {1}, {2} are not the axes of a right-handed frame: each letter once, and an even number of them turned round"
    )]
    NotRightHanded(String, String, String),
    /// The origin is not finite.
    #[error("the origin must be finite")]
    Origin,
    /// Out of range.
    #[error("a scale of {0} is out of range: use {first} to {last}", first = SCALES.start(), last = SCALES.end())]
    Scale(f64),
}

impl WorkspaceError {
    /// The key that is wrong.
    pub fn key(&self) -> &'static str {
        match self {
            Self::Unknown(_) | Self::NotRightHanded(..) => "workspace.axes",
            Self::Origin => "workspace.origin_m",
            Self::Scale(_) => "workspace.scale",
        }
    }
}

impl Workspace {
    /// `K_world = K_arm/s` (N/m).
    pub(super) fn stiffness_of_world(&self, of_arm_n_per_m: f64) -> f64 {
        of_arm_n_per_m / self.scale
    }

    /// The arm's x, y and z point along these axes of the world, its origin is there (m, world), and the world moves `scale` times as far as the arm.
    ///
    /// # Errors
    /// [`WorkspaceError`].
    pub fn new(axes: &[String; 3], origin_m: DVec3, scale: f64) -> Result<Self, WorkspaceError> {
        let axis = |name: &String| match name.as_str() {
            "+x" | "x" => Ok(DVec3::X),
            "-x" => Ok(DVec3::NEG_X),
            "+y" | "y" => Ok(DVec3::Y),
            "-y" => Ok(DVec3::NEG_Y),
            "+z" | "z" => Ok(DVec3::Z),
            "-z" => Ok(DVec3::NEG_Z),
            _ => Err(WorkspaceError::Unknown(name.clone())),
        };
        let [x, y, z] = axes;
        let rotation = DMat3::from_cols(axis(x)?, axis(y)?, axis(z)?);
        // A frame of axes has determinant 1, a mirrored one −1, and one with an axis twice 0.
        if rotation.determinant() < 0.5 {
            return Err(WorkspaceError::NotRightHanded(x.clone(), y.clone(), z.clone()));
        }
        if !origin_m.is_finite() {
            return Err(WorkspaceError::Origin);
        }
        if !SCALES.contains(&scale) {
            return Err(WorkspaceError::Scale(scale));
        }
        Ok(Self { rotation, origin_m, scale })
    }

    /// Where the tool is, and how it moves.
    pub fn to_world(&self, arm: &Motion) -> Motion {
        Motion {
            position_m: self.origin_m + self.scale * (self.rotation * arm.position_m),
            orientation: DQuat::from_mat3(&self.rotation) * arm.orientation,
            velocity_m_per_s: self.scale * (self.rotation * arm.velocity_m_per_s),
            angular_velocity_rad_per_s: self.rotation * arm.angular_velocity_rad_per_s,
        }
    }

    /// A force of the arm (N), in the world's axes.
    pub fn force_to_world_n(&self, arm_n: DVec3) -> DVec3 {
        self.rotation * arm_n
    }

    /// A force or torque of the world, for the arm.
    pub fn to_arm(&self, world: DVec3) -> DVec3 {
        self.rotation.transpose() * world
    }

    /// A plane of the world, for the arm: `K_arm = s K_world`, for the force is the same and the arm's way shorter.
    pub fn plane_to_arm(&self, world: &ContactPlane) -> ContactPlane {
        ContactPlane {
            point_m: self.to_arm(world.point_m - self.origin_m) / self.scale,
            normal: self.to_arm(world.normal),
            stiffness_n_per_m: world.stiffness_n_per_m * self.scale,
            damping_n_s_per_m: world.damping_n_s_per_m * self.scale,
            max_force_n: world.max_force_n,
        }
    }

    /// World movement over the arm's.
    pub fn scale(&self) -> f64 {
        self.scale
    }
}

/// A button that lets go of the tool: while it is pressed the tool stays where it is, turned as the arm is, and the arm moves freely.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClutchSettings {
    /// Its bit in [`Reading::buttons`].
    pub button: u32,
    /// Time (s) in which the force goes away, and comes back.
    pub ramps_s: (f64, f64),
}

/// An arm in the world.
///
/// When the clutch is pressed the force goes to zero first, while the tool still follows: so all work it does is seen. Then the tool stays. When it is let go the
/// tool follows from there, and the force comes back.
#[derive(Debug)]
pub struct Placed {
    arm: Box<dyn Arm>,
    workspace: Workspace,
    clutch: Option<ClutchSettings>,
    period_s: f64,
    share: f64,
    /// Where the tool stays (m), while it does.
    stays_m: Option<DVec3>,
}

impl Placed {
    /// This arm, there.
    pub fn new(arm: Box<dyn Arm>, workspace: Workspace, clutch: Option<ClutchSettings>, period_s: f64) -> Self {
        Self { arm, workspace, clutch, period_s, share: 1.0, stays_m: None }
    }

    fn obey_clutch(&mut self, reading: &mut Reading, periods: u64) {
        let Some(clutch) = self.clutch else { return };
        let passed_s = periods as f64 * self.period_s;
        let (down_s, up_s) = clutch.ramps_s;
        let pressed = reading.buttons >> clutch.button & 1 == 1;
        if pressed && self.share == 0.0 {
            let stays_m = *self.stays_m.get_or_insert(reading.motion.position_m);
            // The arm's place is where the tool stays, whatever it does. It turns with the arm, or it would jump to its turn when let go.
            self.workspace.origin_m += stays_m - reading.motion.position_m;
            reading.motion.position_m = stays_m;
            reading.motion.velocity_m_per_s = DVec3::ZERO;
        } else {
            self.stays_m = None;
            let change = if pressed { -passed_s / down_s } else { passed_s / up_s };
            // Without a time it is there at once; 0/0 would be no number.
            self.share = if change.is_nan() { self.share } else { (self.share + change).clamp(0.0, 1.0) };
        }
        reading.force_share *= self.share;
    }
}

impl Arm for Placed {
    fn read(&mut self, periods: u64) -> Result<Reading, Fault> {
        let mut reading = self.arm.read(periods)?;
        reading.motion = self.workspace.to_world(&reading.motion);
        reading.measured_force_n = reading.measured_force_n.map(|force_n| self.workspace.force_to_world_n(force_n));
        self.obey_clutch(&mut reading, periods);
        Ok(reading)
    }

    fn apply(&mut self, effort: &Effort) {
        let Effort { force_n, torque_nm, plane } = *effort;
        self.arm.apply(&Effort {
            force_n: self.workspace.to_arm(force_n),
            torque_nm: self.workspace.to_arm(torque_nm),
            plane: plane.map(|plane| self.workspace.plane_to_arm(&plane)),
        });
    }

    fn stiffest_wall_n_per_m(&self) -> Option<f64> {
        self.arm.stiffest_wall_n_per_m().map(|of_arm| self.workspace.stiffness_of_world(of_arm))
    }

    fn last_words(&self) -> Option<LastWords> {
        self.arm.last_words()
    }

    fn last_words_were_said(&mut self) {
        self.arm.last_words_were_said();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Witness;
    use std::sync::Arc;

    fn workspace(names: [&str; 3], origin_m: DVec3, scale: f64) -> Result<Workspace, WorkspaceError> {
        Workspace::new(&names.map(str::to_owned), origin_m, scale)
    }

    #[test]
    fn all_24_rotations_are_frames_and_nothing_else_is() {
        let names = ["+x", "-x", "+y", "-y", "+z", "-z"];
        let mut found = Vec::new();
        for n in 0..216 {
            found.extend(workspace([names[n % 6], names[n / 6 % 6], names[n / 36]], DVec3::ONE, 2.0));
        }
        assert_eq!(found.len(), 24);
        for workspace in &found {
            let p = DVec3::new(0.1, -0.2, 0.3);
            // Forces and places turn alike.
            let moved_m = workspace.to_world(&Motion::at(p)).position_m - DVec3::ONE;
            assert!((workspace.force_to_world_n(p) * 2.0).distance(moved_m) < 1e-15);
            assert_eq!(workspace.to_arm(workspace.force_to_world_n(p)), p);
        }
        let refused = |names, origin_m, scale| workspace(names, origin_m, scale).unwrap_err().key();
        assert_eq!(refused(["up", "y", "z"], DVec3::ZERO, 1.0), "workspace.axes");
        assert_eq!(refused(["x", "y", "z"], DVec3::NAN, 1.0), "workspace.origin_m");
        for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(refused(["x", "y", "z"], DVec3::ZERO, scale), "workspace.scale");
        }
    }

    #[test]
    fn axes_go_where_they_are_said_to_point() {
        let workspace = workspace(["-y", "+x", "+z"], DVec3::new(0.0, 0.0, 1.0), 2.0).unwrap();
        let p = DVec3::new(2.0, 3.0, 4.0);
        let arm = Motion { velocity_m_per_s: p, angular_velocity_rad_per_s: p, ..Motion::at(p) };
        let world = workspace.to_world(&arm);
        assert_eq!(world.position_m, DVec3::new(6.0, -4.0, 9.0));
        assert_eq!(world.velocity_m_per_s, DVec3::new(6.0, -4.0, 8.0));
        // An angle is no larger in a larger world.
        assert_eq!(world.angular_velocity_rad_per_s, DVec3::new(3.0, -2.0, 4.0));
        // The tool's axes are the arm's.
        assert!((world.orientation * DVec3::X).distance(DVec3::NEG_Y) < 1e-15);
    }

    /// F · v in the world is s times the arm's, in every workspace.
    #[test]
    fn power_in_the_world_is_the_arms_times_the_scale() {
        let (v, f) = (DVec3::new(0.3, -0.1, 0.2), DVec3::new(-1.0, 2.0, 0.5));
        for scale in [0.1, 1.0, 8.0] {
            let workspace = workspace(["+z", "-x", "-y"], DVec3::ONE, scale).unwrap();
            let world = workspace.to_world(&Motion { velocity_m_per_s: v, ..Motion::at(DVec3::X) });
            let arm_w = workspace.to_arm(f).dot(v);
            assert!((f.dot(world.velocity_m_per_s) - scale * arm_w).abs() < 1e-14);
        }
    }

    /// A plane gives an arm the force that it gives in the world.
    #[test]
    fn a_plane_is_where_it_is_and_as_strong() {
        let (p, v) = (DVec3::new(0.3, -0.1, 0.2), DVec3::new(-0.01, 0.02, 0.03));
        let plane = ContactPlane {
            point_m: DVec3::new(4.0, 0.5, 4.0),
            normal: DVec3::new(0.6, 0.0, 0.8),
            stiffness_n_per_m: 400.0,
            damping_n_s_per_m: 3.0,
            max_force_n: 1e9,
        };
        for scale in [0.1, 1.0, 8.0] {
            let workspace = workspace(["+z", "-x", "-y"], DVec3::new(1.0, 0.5, 0.0), scale).unwrap();
            let world = workspace.to_world(&Motion { velocity_m_per_s: v, ..Motion::at(p) });
            let expected_n = plane.normal_force_n(world.position_m, world.velocity_m_per_s);
            let arms = workspace.plane_to_arm(&plane);
            assert!(expected_n > 1.0 && (arms.normal_force_n(p, v) - expected_n).abs() < 1e-9, "{expected_n} N");
            assert!((workspace.force_to_world_n(arms.normal) - plane.normal).length() < 1e-15);
        }
    }

    /// Follows, lets go, stays, follows from there.
    #[test]
    fn a_clutch_takes_the_force_before_the_tool_stays_and_gives_it_back_slowly() {
        let witness = Arc::new(Witness::panicking_at(u64::MAX));
        let workspace = workspace(["-y", "+x", "+z"], DVec3::ONE, 2.0).unwrap();
        let clutch = ClutchSettings { button: 3, ramps_s: (4e-3, 8e-3) };
        let mut placed = Placed::new(Box::new(Arc::clone(&witness)), workspace, Some(clutch), 1e-3);
        let mut x = 0.0;
        // The arm moves along its x: the world's −y, twice as far.
        let mut step = |pressed: bool| {
            x += 1e-3;
            let orientation = DQuat::from_rotation_z(x);
            let motion = Motion { velocity_m_per_s: DVec3::X, orientation, ..Motion::at(DVec3::X * x) };
            witness.set(Reading { motion, buttons: u32::from(pressed) << 3 | 1, ..Witness::at_rest() });
            placed.read(1).unwrap()
        };
        assert_eq!(step(false).force_share, 1.0);
        let going: Vec<Reading> = (0..4).map(|_| step(true)).collect();
        assert_eq!(going.iter().map(|reading| reading.force_share).collect::<Vec<_>>(), [0.75, 0.5, 0.25, 0.0]);
        // As long as there is force it follows.
        for pair in going.windows(2) {
            assert!((pair[1].motion.position_m - pair[0].motion.position_m + DVec3::Y * 2e-3).length() < 1e-14);
        }
        let stays: Vec<Reading> = (0..50).map(|_| step(true)).collect();
        for reading in &stays {
            assert!(reading.motion.position_m.distance(stays[0].motion.position_m) < 1e-15);
            assert_eq!((reading.motion.velocity_m_per_s, reading.force_share), (DVec3::ZERO, 0.0));
        }
        let back: Vec<Reading> = (0..9).map(|_| step(false)).collect();
        let turned_rad = |a: &Reading, b: &Reading| a.motion.orientation.angle_between(b.motion.orientation);
        assert!(turned_rad(&stays[49], &back[0]) < 1.1e-3, "no jump");
        assert!((back[0].motion.position_m - stays[0].motion.position_m + DVec3::Y * 2e-3).length() < 1e-14);
        assert_eq!((back[0].force_share, back[3].force_share, back[8].force_share), (0.125, 0.5, 1.0));
    }

    #[test]
    fn a_clutch_without_ramps_acts_at_once_and_no_time_changes_nothing() {
        let witness = Arc::new(Witness::panicking_at(u64::MAX));
        let clutch = ClutchSettings { button: 0, ramps_s: (0.0, 0.0) };
        let workspace = workspace(["x", "y", "z"], DVec3::ZERO, 1.0).unwrap();
        let mut placed = Placed::new(Box::new(Arc::clone(&witness)), workspace, Some(clutch), 1e-3);
        let mut share = |buttons, periods| {
            witness.set(Reading { buttons, ..Witness::at_rest() });
            placed.read(periods).unwrap().force_share
        };
        assert_eq!([share(1, 0), share(1, 1), share(1, 1), share(0, 0), share(0, 1)], [1.0, 0.0, 0.0, 0.0, 1.0]);
    }
}
