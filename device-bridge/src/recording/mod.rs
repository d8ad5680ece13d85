//! What an arm did, a row a tick, in a table of text (CSV): `docs/arms/playback.md` describes it.
//!
//! All of it is as the arm's driver has it, in the arm's own axes, before `[workspace]` places the arm in the world: so it can be played back as that arm.
pub mod read;
pub mod recorder;

use crate::device::{Effort, Reading};
use glam::DVec3;
use palpate_control::Motion;
use std::io::{self, Write};

/// The columns that are written, in this order. A driver that has no sensor leaves those of the measured force empty.
pub const COLUMNS: [&str; 24] = [
    "time_s",
    "position_x_m",
    "position_y_m",
    "position_z_m",
    "orientation_w",
    "orientation_x",
    "orientation_y",
    "orientation_z",
    "velocity_x_m_per_s",
    "velocity_y_m_per_s",
    "velocity_z_m_per_s",
    "angular_velocity_x_rad_per_s",
    "angular_velocity_y_rad_per_s",
    "angular_velocity_z_rad_per_s",
    "buttons",
    "measured_force_x_n",
    "measured_force_y_n",
    "measured_force_z_n",
    "force_x_n",
    "force_y_n",
    "force_z_n",
    "torque_x_nm",
    "torque_y_nm",
    "torque_z_nm",
];
/// How many of them a file must have to be played back: the others are for whoever looks at it.
pub const NEEDED: usize = 15;

/// What an arm did in a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Since the arm was opened (s, the servo's).
    pub time_s: f64,
    /// What the arm said.
    pub motion: Motion,
    /// Bit i is button i.
    pub buttons: u32,
    /// Force of the hand (N), if there is a sensor.
    pub measured_force_n: Option<DVec3>,
    /// What was put on the arm.
    pub effort: Effort,
}

impl Row {
    /// A reading, and what was put on the arm then.
    pub fn new(time_s: f64, reading: &Reading, effort: Effort) -> Self {
        let Reading { motion, buttons, measured_force_n, .. } = *reading;
        Self { time_s, motion, buttons, measured_force_n, effort }
    }
}

/// The names of the columns.
///
/// # Errors
/// The writer's.
pub fn write_header(out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{}", COLUMNS.join(","))
}

/// A row. Every number comes back to the bit.
///
/// # Errors
/// The writer's.
pub fn write_row(out: &mut impl Write, row: &Row) -> io::Result<()> {
    let (m, q) = (&row.motion, row.motion.orientation);
    let vector = |v: DVec3| format!("{},{},{}", v.x, v.y, v.z);
    writeln!(
        out,
        "{},{},{},{},{},{},{},{},{},{},{},{}",
        row.time_s,
        vector(m.position_m),
        q.w,
        q.x,
        q.y,
        q.z,
        vector(m.velocity_m_per_s),
        vector(m.angular_velocity_rad_per_s),
        row.buttons,
        row.measured_force_n.map_or_else(|| ",,".to_owned(), vector),
        vector(row.effort.force_n),
        vector(row.effort.torque_nm),
    )
}
