//! Reads a recording. Whatever the file holds, the answer is its rows, or the line and column that are wrong.
use super::{COLUMNS, NEEDED};
use glam::{DQuat, DVec3};
use palpate_control::Motion;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Nothing that an arm does is so large, in any of the units (s apart).
const LARGEST: f64 = 1e6;
/// Times of a clock that counts from 1970 are taken, too (s).
const LATEST_S: f64 = 1e11;
/// A rotation's quaternion is as long as 1, give or take so much.
const UNIT_WITHIN: f64 = 1e-3;
/// The columns of a motion, as [`COLUMNS`] has them.
const MOTION: std::ops::Range<usize> = 0..14;
const BUTTONS: usize = 14;

/// A place in the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Since the first (s).
    pub time_s: f64,
    /// Pose and twist.
    pub motion: Motion,
    /// Bit i is button i.
    pub buttons: u32,
}

/// Why a recording cannot be used.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// Not a file, or not for us.
    #[error("cannot read {path}: {reason}", path = path.display())]
    Read {
        /// Which.
        path: PathBuf,
        /// Why.
        reason: std::io::Error,
    },
    /// Something in it is wrong.
    #[error("{name}, line {line}: {reason}")]
    At {
        /// The file.
        name: String,
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        reason: String,
    },
}

/// The poses of a file, at least one.
///
/// # Errors
/// [`RecordingError`].
pub fn file(path: &Path) -> Result<Vec<Pose>, RecordingError> {
    let bytes = std::fs::read(path).map_err(|reason| RecordingError::Read { path: path.to_owned(), reason })?;
    poses(&bytes, &path.display().to_string())
}

/// The poses of a text; `name` is for messages.
///
/// # Errors
/// [`RecordingError::At`].
pub fn poses(bytes: &[u8], name: &str) -> Result<Vec<Pose>, RecordingError> {
    let mut lines = bytes.split(|&byte| byte == b'\n').enumerate().map(|(index, line)| (index + 1, line));
    let at = |line, reason| RecordingError::At { name: name.to_owned(), line, reason };
    let (_, header) = lines.next().unwrap_or((1, &[]));
    let places = columns(header).map_err(|reason| at(1, reason))?;
    let mut poses: Vec<Pose> = Vec::new();
    let mut begin_s = 0.0;
    let mut last_line = 1;
    for (line, bytes) in lines.filter(|(_, bytes)| !bytes.trim_ascii().is_empty()) {
        let mut pose = row(bytes, &places).map_err(|reason| at(line, reason))?;
        begin_s = if poses.is_empty() { pose.time_s } else { begin_s };
        pose.time_s -= begin_s;
        if let Some(before) = poses.last().filter(|before| pose.time_s <= before.time_s) {
            let reason = format!(
                "time_s is {}, not later than {} in the row before",
                pose.time_s + begin_s,
                before.time_s + begin_s
            );
            return Err(at(line, reason));
        }
        poses.push(pose);
        last_line = line;
    }
    if poses.is_empty() { Err(at(last_line, "no row follows the names of the columns".to_owned())) } else { Ok(poses) }
}

/// How many values a row has, and where in it those are that are needed.
struct Places {
    count: usize,
    of: [usize; NEEDED],
}

fn columns(header: &[u8]) -> Result<Places, String> {
    let header = text(header)?;
    let names: Vec<&str> = header.split(',').map(str::trim).collect();
    let mut of = [0; NEEDED];
    for (place, needed) in of.iter_mut().zip(COLUMNS) {
        let mut found = names.iter().enumerate().filter(|(_, name)| **name == needed).map(|(index, _)| index);
        *place = found.next().ok_or_else(|| format!("the column {needed} is missing"))?;
        if found.next().is_some() {
            return Err(format!("the column {needed} is there twice"));
        }
    }
    Ok(Places { count: names.len(), of })
}

fn row(bytes: &[u8], places: &Places) -> Result<Pose, String> {
    let values: Vec<&str> = text(bytes)?.split(',').map(str::trim).collect();
    if values.len() != places.count {
        return Err(format!("{} values, where the header names {} columns", values.len(), places.count));
    }
    let mut numbers = [0.0; MOTION.end];
    for (index, number) in numbers.iter_mut().enumerate() {
        let most = if index == 0 { LATEST_S } else { LARGEST };
        *number = finite(values[places.of[index]], most).map_err(|reason| format!("{} {reason}", COLUMNS[index]))?;
    }
    let word = values[places.of[BUTTONS]];
    let buttons =
        word.parse().map_err(|_| format!("{} is {}, no whole number of 32 bits", COLUMNS[BUTTONS], quoted(word)))?;
    let [time_s, x, y, z, qw, qx, qy, qz, vx, vy, vz, wx, wy, wz] = numbers;
    let orientation = DQuat::from_xyzw(qx, qy, qz, qw);
    if (orientation.length() - 1.0).abs() > UNIT_WITHIN {
        return Err(format!("the orientation is no rotation: it is {} long, not 1", orientation.length()));
    }
    let motion = Motion {
        position_m: DVec3::new(x, y, z),
        orientation: orientation.normalize(),
        velocity_m_per_s: DVec3::new(vx, vy, vz),
        angular_velocity_rad_per_s: DVec3::new(wx, wy, wz),
    };
    Ok(Pose { time_s, motion, buttons })
}

fn text(bytes: &[u8]) -> Result<&str, String> {
    std::str::from_utf8(bytes).map_err(|_| "is no UTF-8 text".to_owned())
}

fn finite(word: &str, most: f64) -> Result<f64, String> {
    let number: f64 = word.parse().map_err(|_| format!("is {}, no number", quoted(word)))?;
    if number.abs() <= most { Ok(number) } else { Err(format!("is {number}: it must be within {most}")) }
}

/// The beginning of what was found, safe to show.
fn quoted(word: &str) -> String {
    format!("\"{}\"", word.chars().take(20).flat_map(char::escape_debug).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::{
        super::{Row, write_header, write_row},
        *,
    };
    use crate::device::Effort;
    use proptest::prelude::*;

    fn written(rows: &[Row]) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_header(&mut bytes).unwrap();
        for row in rows {
            write_row(&mut bytes, row).unwrap();
        }
        bytes
    }

    fn row_at(time_s: f64) -> Row {
        let motion =
            Motion { velocity_m_per_s: DVec3::new(0.1, -2e-17, 3.0), ..Motion::at(DVec3::new(1.0, 0.5, -0.25)) };
        Row { time_s, motion, buttons: 5, measured_force_n: None, effort: Effort::force(DVec3::Z) }
    }

    fn refused(text: &str) -> String {
        poses(text.as_bytes(), "a.csv").unwrap_err().to_string()
    }

    #[test]
    fn every_mistake_is_named_with_its_line_and_column() {
        let good = String::from_utf8(written(&[row_at(0.0), row_at(0.5)])).unwrap();
        assert_eq!(poses(good.as_bytes(), "a.csv").unwrap().len(), 2);
        let spoilt = |from: &str, to: &str| {
            assert!(good.contains(from), "{from} is in\\n{good}");
            refused(&good.replacen(from, to, 1))
        };
        assert_eq!(refused(""), "a.csv, line 1: the column time_s is missing");
        assert_eq!(spoilt("orientation_w", "w"), "a.csv, line 1: the column orientation_w is missing");
        assert_eq!(spoilt("torque_x_nm", "buttons"), "a.csv, line 1: the column buttons is there twice");
        assert_eq!(spoilt("\n0.5,1", "\n0.5,1,1"), "a.csv, line 3: 25 values, where the header names 24 columns");
        assert_eq!(spoilt("\n0.5,1", "\n0.5,here"), "a.csv, line 3: position_x_m is \"here\", no number");
        assert_eq!(spoilt("\n0.5,1", "\n0.5,NaN"), "a.csv, line 3: position_x_m is NaN: it must be within 1000000");
        assert_eq!(spoilt("\n0.5,1", "\n0.5,-inf"), "a.csv, line 3: position_x_m is -inf: it must be within 1000000");
        assert_eq!(
            spoilt("\n0.5,1", "\n0.5,1e7"),
            "a.csv, line 3: position_x_m is 10000000: it must be within 1000000"
        );
        assert_eq!(spoilt("\n0.5,", "\n0,"), "a.csv, line 3: time_s is 0, not later than 0 in the row before");
        assert_eq!(spoilt("\n0.5,", "\n-1,"), "a.csv, line 3: time_s is -1, not later than 0 in the row before");
        assert_eq!(spoilt(",5,,,", ",-1,,,"), "a.csv, line 2: buttons is \"-1\", no whole number of 32 bits");
        assert!(spoilt("-0.25,1,0", "-0.25,0,0").starts_with("a.csv, line 2: the orientation is no rotation"));
        assert_eq!(refused(good.lines().next().unwrap()), "a.csv, line 1: no row follows the names of the columns");
        let cut = &good.as_bytes()[..good.len() - 30];
        assert!(poses(cut, "a.csv").unwrap_err().to_string().starts_with("a.csv, line 3: "));
        let bytes = [good.as_bytes(), b"\xff\n"].concat();
        assert_eq!(poses(&bytes, "a.csv").unwrap_err().to_string(), "a.csv, line 4: is no UTF-8 text");
        let missing = file(Path::new("/nowhere/a.csv")).unwrap_err().to_string();
        assert!(missing.starts_with("cannot read /nowhere/a.csv: "), "{missing}");
    }

    #[test]
    fn columns_are_found_by_name_and_times_count_from_the_first() {
        let mut header: Vec<&str> = COLUMNS[..NEEDED].iter().rev().copied().collect();
        header.insert(0, "note");
        let values = ["7", "6", "5", "4", "3", "2", "1", "0", "0", "0", "1", "0.3", "0.2", "0.1"];
        let text = format!(
            "{}\r\n#,{},1700000000.5\r\n\r\n#,{},1700000001",
            header.join(","),
            values.join(","),
            values.join(",")
        );
        let found = poses(text.as_bytes(), "a.csv").unwrap();
        assert_eq!([found[0].time_s, found[1].time_s], [0.0, 0.5]);
        assert_eq!((found[0].motion.position_m, found[0].buttons), (DVec3::new(0.1, 0.2, 0.3), 7));
        assert_eq!(found[0].motion.velocity_m_per_s, DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(found[0].motion.angular_velocity_rad_per_s, DVec3::new(4.0, 5.0, 6.0));
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_recording_or_a_line_that_is_wrong(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            let _ = poses(&bytes, "a.csv");
        }

        /// Bytes put into the place of others of a good file: what passes is finite and its times rise.
        #[test]
        fn a_spoilt_recording_is_none_or_a_motion(
            splice in prop::collection::vec(any::<u8>(), 0..12), at in any::<prop::sample::Index>(), cut in 0..12_usize,
        ) {
            let mut bytes = written(&[row_at(0.0), row_at(1.0), row_at(2.0)]);
            let at = at.index(bytes.len());
            bytes.splice(at..(at + cut).min(bytes.len()), splice);
            if let Ok(found) = poses(&bytes, "a.csv") {
                prop_assert!(found.iter().all(|pose| pose.motion.is_finite()));
                prop_assert!(found.windows(2).all(|pair| pair[1].time_s > pair[0].time_s));
            }
        }

        #[test]
        fn what_is_written_comes_back_to_the_bit(
            numbers in prop::array::uniform9(-1e6..1e6_f64), turn in prop::array::uniform3(-3.0..3.0_f64), buttons in any::<u32>(),
        ) {
            let [x, y, z, vx, vy, vz, wx, wy, wz] = numbers;
            let motion = Motion {
                position_m: DVec3::new(x, y, z),
                orientation: DQuat::from_scaled_axis(DVec3::from(turn)),
                velocity_m_per_s: DVec3::new(vx, vy, vz),
                angular_velocity_rad_per_s: DVec3::new(wx, wy, wz),
            };
            let row = Row { motion, buttons, measured_force_n: Some(DVec3::ONE), ..row_at(0.0) };
            let found = poses(&written(&[row]), "a.csv").unwrap()[0];
            prop_assert_eq!(Motion { orientation: motion.orientation, ..found.motion }, motion);
            prop_assert!(found.motion.orientation.angle_between(motion.orientation) < 1e-7);
            prop_assert_eq!(found.buttons, buttons);
        }
    }
}
