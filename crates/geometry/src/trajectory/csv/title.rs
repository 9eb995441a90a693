//! Names that this program, ROS and EuRoC give to the columns of poses.

use super::pose_column::PoseColumn;
use crate::trajectory::euler::AngleUnit;
use crate::trajectory::length_unit::LengthUnit;
use crate::trajectory::time_unit::TimeUnit;

const FRAME: &[&str] = &[
    "frame",
    "name",
    "file",
    "filename",
    "file_name",
    "image",
    "image_name",
    "imagename",
    "photo",
];
/// Names of times, best first: the stamp of a message of ROS is the camera's, its `%time` may be
/// that of the recording.
const TIMES: [&[&str]; 3] = [
    &["header_stamp", "field_header_stamp"],
    &["time_s", "time", "timestamp", "timestamp_s"],
    &["stamp", "t", "rosbagtimestamp"],
];
/// Words before an axis in the names of translations and rotations, as in
/// `pose.pose.position.x`.
const TRANSLATIONS: &[&str] = &["position", "translation", "pos"];
const ROTATIONS: &[&str] = &["orientation", "rotation", "quaternion", "quat"];
/// Names of angles about x, y and z.
const ANGLES: [&[&str]; 3] = [
    &["roll", "omega", "rx"],
    &["pitch", "phi", "ry"],
    &["yaw", "heading", "kappa", "rz"],
];

/// The title of a column: its name in lower case, with `_` for other separators of words, and its
/// unit.
pub(super) struct Title {
    name: String,
    unit: String,
}

impl Title {
    /// The title that a cell of a header holds, such as `p_RS_R_x [m]` or `%time`.
    pub fn of(text: &str) -> Self {
        let text = text.trim().trim_matches(['\'', '"']).to_lowercase();
        let in_brackets = |open, close| text.strip_suffix(close)?.rsplit_once(open);
        let (name, unit) = in_brackets('[', ']')
            .or_else(|| in_brackets('(', ')'))
            .unwrap_or((text.as_str(), ""));
        let is_mark = |c: char| "_%#".contains(c);
        Self {
            name: name
                .trim()
                .replace(['/', '.', ' ', '-'], "_")
                .trim_matches(is_mark)
                .to_owned(),
            unit: unit.trim().to_owned(),
        }
    }

    /// The rank of this title among those of a column, 0 for the one that is preferred; `None` if
    /// it is that of another.
    pub fn rank(&self, column: PoseColumn) -> Option<usize> {
        let is = |names: &[&str]| names.contains(&self.name.as_str());
        let has_unit = |units: &[&str]| units.contains(&self.unit.as_str());
        match column {
            PoseColumn::Frame => (is(FRAME) && has_unit(&[""])).then_some(0),
            PoseColumn::TimeS if has_unit(&[""]) => TIMES.iter().position(|names| is(names)),
            PoseColumn::TimeS => self.rank_of_time(TimeUnit::S),
            PoseColumn::TimeMs => self.rank_of_time(TimeUnit::Ms),
            PoseColumn::TimeUs => self.rank_of_time(TimeUnit::Us),
            PoseColumn::TimeNs => self.rank_of_time(TimeUnit::Ns),
            PoseColumn::Tx => self.rank_of_translation("x"),
            PoseColumn::Ty => self.rank_of_translation("y"),
            PoseColumn::Tz => self.rank_of_translation("z"),
            PoseColumn::Qx => self.rank_of_rotation("x"),
            PoseColumn::Qy => self.rank_of_rotation("y"),
            PoseColumn::Qz => self.rank_of_rotation("z"),
            PoseColumn::Qw => self.rank_of_rotation("w"),
            PoseColumn::Rx => self.rank_of_angle(0),
            PoseColumn::Ry => self.rank_of_angle(1),
            PoseColumn::Rz => self.rank_of_angle(2),
        }
    }

    /// True for the seconds of a stamp whose nanoseconds are a column of their own.
    pub fn is_stamp_seconds(&self) -> bool {
        self.name.ends_with("stamp_secs") || self.name.ends_with("stamp_sec")
    }

    /// True for the nanoseconds of a stamp whose seconds are a column of their own.
    pub fn is_stamp_nanoseconds(&self) -> bool {
        ["stamp_nsecs", "stamp_nsec", "stamp_nanosec"]
            .iter()
            .any(|end| self.name.ends_with(end))
    }

    /// The unit of an angle, which brackets or the last word of the name tell.
    pub fn angle_unit(&self) -> Option<AngleUnit> {
        let last = self.name.rsplit('_').next().unwrap_or_default();
        let word = if self.unit.is_empty() {
            last
        } else {
            self.unit.as_str()
        };
        let mut units = AngleUnit::ALL.into_iter();
        units.find(|unit| unit.is_called(word))
    }

    /// True for a coordinate on the globe.
    pub fn is_geographic(&self) -> bool {
        let mut words = self.name.split('_');
        words.any(|word| ["lat", "latitude", "lon", "lng", "longitude"].contains(&word))
    }

    /// True for an angle of photogrammetry.
    pub fn is_omega(&self) -> bool {
        self.name.split('_').any(|word| word == "omega")
    }

    /// The rank of a time in a unit that brackets or the last word of the name tell; `stamp_secs`
    /// is a part of one.
    fn rank_of_time(&self, unit: TimeUnit) -> Option<usize> {
        let name = match (self.unit.as_str(), self.name.rsplit_once('_')) {
            ("", Some((name, last))) if unit.name() == last => name,
            (own, _) if unit.is_called(own) => self.name.as_str(),
            _ => return None,
        };
        TIMES.iter().position(|names| names.contains(&name))
    }

    fn rank_of_translation(&self, axis: &str) -> Option<usize> {
        if !self.unit.is_empty() && !is_length_unit(&self.unit) {
            return None;
        }
        let name = self.name_without_length();
        if name == axis || name.strip_prefix('t') == Some(axis) {
            return Some(0);
        }
        let is_other =
            name.strip_prefix('p') == Some(axis) || is_axis_of(name, axis, 'p', TRANSLATIONS);
        // The last column of a matrix, counted from 1.
        let is_other = is_other || matches!((name, axis), ("t1", "x") | ("t2", "y") | ("t3", "z"));
        is_other.then_some(1)
    }

    /// The name without the unit of a length at its end.
    fn name_without_length(&self) -> &str {
        let parts = self.name.rsplit_once('_');
        let parts = parts.filter(|(_, unit)| self.unit.is_empty() && is_length_unit(unit));
        parts.map_or(self.name.as_str(), |(name, _)| name)
    }

    /// Metres of the unit of a length, which brackets or the last word of the name tell.
    pub fn length_unit_m(&self) -> Option<f64> {
        let last = self.name.rsplit_once('_').map_or("", |(_, last)| last);
        let word = if self.unit.is_empty() {
            last
        } else {
            &self.unit
        };
        LengthUnit::of_word(word).map(|unit| unit.length_m)
    }

    /// Row and column of an entry of a matrix, as `r11`, `R_0_2` or `m03` name it.
    pub fn matrix_place(&self) -> Option<[usize; 2]> {
        let rest = self
            .name
            .strip_prefix("rot")
            .or(self.name.strip_prefix(['r', 'm', 't']))?;
        let digits: String = rest.chars().filter(|c| *c != '_').collect();
        let [row, column] = digits.as_bytes() else {
            return None;
        };
        let digit = |byte: &u8| byte.is_ascii_digit().then(|| usize::from(byte - b'0'));
        Some([digit(row)?, digit(column)?])
    }

    fn rank_of_rotation(&self, axis: &str) -> Option<usize> {
        if !["", "-", "1"].contains(&self.unit.as_str()) {
            return None;
        }
        if self.name.strip_prefix('q') == Some(axis) {
            return Some(0);
        }
        is_axis_of(&self.name, axis, 'q', ROTATIONS).then_some(1)
    }

    /// The rank of an angle about an axis, such as `roll_deg` or `pose.yaw [rad]`.
    fn rank_of_angle(&self, axis: usize) -> Option<usize> {
        let has_unit = self.unit.is_empty() || self.angle_unit().is_some();
        let is_so_called = |word: &str| has_unit && ANGLES[axis].contains(&word);
        let mut words = self.name.split('_');
        words.any(is_so_called).then_some(0)
    }
}

/// True for names like `pose_position_x`, whose last word but one is one of `words`, and for names
/// like EuRoC's `p_rs_r_x`, whose first word is `letter`.
fn is_axis_of(name: &str, axis: &str, letter: char, words: &[&str]) -> bool {
    let rest = name.strip_suffix(axis);
    let Some(rest) = rest.and_then(|rest| rest.strip_suffix('_')) else {
        return false;
    };
    let first = rest.split('_').next();
    let last = rest.rsplit('_').next();
    first.is_some_and(|first| first.strip_prefix(letter) == Some(""))
        || last.is_some_and(|last| words.contains(&last))
}

/// True for the unit of a length, in brackets or not.
pub(super) fn is_length_unit(word: &str) -> bool {
    LengthUnit::of_word(word.trim_matches(['[', ']', '(', ')'])).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_told_from_other_columns() {
        use PoseColumn::{Rx, Ry, Rz};
        let (degrees, radians) = (Some(AngleUnit::Deg), Some(AngleUnit::Rad));
        for (text, column, unit) in [
            ("roll", Rx, None),
            ("Yaw [deg]", Rz, degrees),
            ("pose.pitch", Ry, None),
            ("omega_rad", Rx, radians),
            ("Phi (°)", Ry, degrees),
            ("heading_degrees", Rz, degrees),
            ("rx", Rx, None),
        ] {
            let title = Title::of(text);
            assert_eq!(title.rank(column), Some(0), "{text}");
            assert_eq!(title.angle_unit(), unit, "{text}");
        }
        for text in ["qx", "x", "time", "rolled", "roll [m]"] {
            let title = Title::of(text);
            let ranks = PoseColumn::ANGLES.map(|column| title.rank(column));
            assert_eq!(ranks, [None; 3], "{text}");
        }
    }

    #[test]
    fn names_of_ros_and_euroc_are_known() {
        use PoseColumn::{Frame, Qw, Qx, TimeMs, TimeNs, TimeS, TimeUs, Tx, Ty, Tz};
        for (text, column) in [
            ("field.pose.position.x", Tx),
            ("pose.position.y", Ty),
            ("/pose/pose/position/z", Tz),
            ("position_x", Tx),
            ("transforms[0].transform.translation.x", Tx),
            ("px", Tx),
            ("p_RS_R_x [m]", Tx),
            ("X (m)", Tx),
            ("tx_m", Tx),
            ("q_RS_w []", Qw),
            ("pose.orientation.w", Qw),
            ("/tf/transform/rotation/x", Qx),
            ("%time", TimeS),
            ("field.header.stamp", TimeS),
            ("header.stamp", TimeS),
            ("__time", TimeS),
            ("#timestamp [ns]", TimeNs),
            ("time_ns", TimeNs),
            ("time [ms]", TimeMs),
            ("timestamp_ms", TimeMs),
            ("t (µs)", TimeUs),
            ("time (sec)", TimeS),
            ("image_name", Frame),
        ] {
            assert!(Title::of(text).rank(column).is_some(), "{text}");
        }
        for (text, column) in [
            ("p_RS_R_x [s]", Tx),
            ("time [ms]", TimeS),
            ("v_RS_R_x [m s^-1]", Tx),
            ("field.twist.linear.x", Tx),
            ("field.header.frame_id", Frame),
            ("b_w_RS_S_x [rad s^-1]", Qx),
        ] {
            assert!(Title::of(text).rank(column).is_none(), "{text}");
        }
    }
}
