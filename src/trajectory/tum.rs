//! TUM trajectory files: `time tx ty tz qx qy qz qw`, camera-to-world, seconds and metres.
//!
//! Eight columns with single spaces and no trailing space, which is what `evo` accepts.

use super::{Pose, StampedPose, Trajectory};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Why a trajectory file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TumError {
    /// The file cannot be read.
    #[error("{}: cannot read the trajectory: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// One line is not a pose.
    #[error("{}:{line}: {what}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// 1-based number of the line.
        line: usize,
        /// What is wrong, and the remedy.
        what: String,
    },
    /// No pose in the file.
    #[error("{}: holds no poses; each line should read `time tx ty tz qx qy qz qw`", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

/// Reads a TUM file.
///
/// # Errors
/// An unreadable file; a line without exactly eight numbers; a number that is not finite; a quaternion of
/// length zero (or farther than 1 % from unit length); times that do not increase; no pose at all.
pub fn read(path: &Path) -> Result<Trajectory, TumError> {
    let text = std::fs::read_to_string(path).map_err(|source| TumError::Read {
        path: path.to_owned(),
        source,
    })?;
    let mut trajectory: Trajectory = Vec::new();
    // Some editors begin a file with a byte order mark.
    let text = text.trim_start_matches('\u{feff}');
    for (index, raw) in text.lines().enumerate() {
        let line = raw.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let fail = |what: String| TumError::Line {
            path: path.to_owned(),
            line: index + 1,
            what,
        };
        let stamped = parse_line(line).map_err(fail)?;
        if let Some(last) = trajectory.last() {
            if stamped.time_s == last.time_s {
                return Err(fail(format!(
                    "duplicate timestamp {}: every frame needs a time of its own",
                    stamped.time_s
                )));
            }
            if stamped.time_s < last.time_s {
                return Err(fail(format!(
                    "timestamp {} after {}: sort the file by time",
                    stamped.time_s, last.time_s
                )));
            }
        }
        trajectory.push(stamped);
    }
    if trajectory.is_empty() {
        return Err(TumError::Empty {
            path: path.to_owned(),
        });
    }
    Ok(trajectory)
}

fn parse_line(line: &str) -> Result<StampedPose, String> {
    let mut n = [0.0; 8];
    let mut count = 0;
    for word in line.split_whitespace() {
        let value: f64 = word.parse().map_err(|_| {
            format!("`{word}` is not a number; a pose is `time tx ty tz qx qy qz qw`")
        })?;
        if !value.is_finite() {
            return Err(format!(
                "`{word}` is not finite; remove the frame or give it a pose"
            ));
        }
        if count < 8 {
            n[count] = value;
        }
        count += 1;
    }
    if count != 8 {
        return Err(format!(
            "{count} columns where `time tx ty tz qx qy qz qw` has 8"
        ));
    }
    let quaternion = Quaternion::new(n[7], n[4], n[5], n[6]);
    let norm = quaternion.norm();
    if norm < 1e-6 {
        return Err("the quaternion is zero; no rotation at all is `0 0 0 1`".to_owned());
    }
    if (norm - 1.0).abs() > 0.01 {
        return Err(format!(
            "the quaternion has length {norm:.4}, not 1; the order is qx qy qz qw"
        ));
    }
    Ok(StampedPose {
        time_s: n[0],
        pose: Pose::new(
            UnitQuaternion::from_quaternion(quaternion),
            Vector3::new(n[1], n[2], n[3]),
        ),
    })
}

/// The text of a TUM file; every number with the digits that restore it exactly.
pub fn format(trajectory: &[StampedPose]) -> String {
    let mut text = String::new();
    for StampedPose { time_s, pose } in trajectory {
        let (t, q) = (&pose.t_wc, &pose.r_wc);
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{time_s} {} {} {} {} {} {} {}",
            t.x, t.y, t.z, q.i, q.j, q.k, q.w
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::{indexed, spiral};

    fn read_text(text: &str) -> Result<Trajectory, TumError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("poses.tum");
        std::fs::write(&path, text).unwrap();
        read(&path)
    }

    #[test]
    fn round_trip_is_exact() {
        let trajectory = indexed(spiral(20, 0.1234567890123, 0.7));
        let again = read_text(&format(&trajectory)).unwrap();
        for (a, b) in trajectory.iter().zip(&again) {
            assert_eq!(a.time_s, b.time_s);
            assert_eq!(a.pose.t_wc, b.pose.t_wc);
            assert!(a.pose.r_wc.angle_to(&b.pose.r_wc) < 1e-15);
        }
    }

    #[test]
    fn comments_and_blank_lines_are_skipped() {
        assert_eq!(read_text("# header\n\n0 0 0 0 0 0 0 1\n").unwrap().len(), 1);
    }

    #[test]
    fn bad_lines_name_the_line_and_the_remedy() {
        for (text, expected) in [
            ("0 0 0 0 0 0 0 1\n1 0 0 0 0 0 1\n", ":2: 7 columns"),
            ("0 0 0 NaN 0 0 0 1\n", ":1: `NaN` is not finite"),
            ("0 0 0 0 0 0 0 0\n", ":1: the quaternion is zero"),
            ("0 0 0 0 0 0 0 2\n", ":1: the quaternion has length 2"),
            (
                "0 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n",
                ":2: duplicate timestamp 0",
            ),
            (
                "1 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n",
                "sort the file by time",
            ),
            ("0 x 0 0 0 0 0 1\n", "`x` is not a number"),
            ("# nothing\n", "holds no poses"),
        ] {
            let message = read_text(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
