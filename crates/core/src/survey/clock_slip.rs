//! Offsets by which the clocks of cameras and of positioning systems differ.

use super::associate::{TimeAssociation, by_time};
use crate::frames::FrameFile;
use tunnelstitch_geometry::trajectory::PoseFile;

/// Zones of time are multiples of a quarter of an hour, at most 14 hours from UTC.
const ZONE_STEP_S: f64 = 900.0;
const MAX_ZONE_STEPS: i32 = 56;
/// GPS is 18 seconds ahead of UTC, and atomic time 37, since 2017 (IERS, Bulletin C).
const LEAP_SECONDS: [f64; 5] = [0.0, 18.0, -18.0, 37.0, -37.0];

/// A clock of the poses that is behind that of the frames by a usual offset.
pub(super) struct ClockSlip {
    /// The offset, seconds; negative if it is ahead.
    offset_s: f64,
}

impl ClockSlip {
    /// Finds the offset, the shortest first, with which every frame has its pose.
    pub fn find(
        file: &PoseFile,
        frames: &[FrameFile],
        times_s: &[f64],
        how: TimeAssociation,
    ) -> Option<Self> {
        let mut offsets: Vec<f64> = (-MAX_ZONE_STEPS..=MAX_ZONE_STEPS)
            .flat_map(|k| LEAP_SECONDS.map(|leap| f64::from(k) * ZONE_STEP_S + leap))
            .collect();
        offsets.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        let fits = |offset_s: &f64| {
            let shifted: Vec<f64> = times_s.iter().map(|time_s| time_s - offset_s).collect();
            by_time(file, frames, &shifted, how).is_ok()
        };
        let offset_s = offsets
            .into_iter()
            .filter(|offset| *offset != 0.0)
            .find(fits)?;
        Some(Self { offset_s })
    }

    /// The slip in one sentence with the line that mends it; `given_s` is the offset that is given
    /// already.
    pub fn sentence(&self, given_s: Option<f64>) -> String {
        let (ahead, behind) = match self.offset_s > 0.0 {
            true => ("frames", "poses"),
            false => ("poses", "frames"),
        };
        let minutes = (self.offset_s.abs() / 60.0).floor();
        let seconds = self.offset_s.abs() - 60.0 * minutes;
        let (hours, minutes) = ((minutes / 60.0).floor(), minutes % 60.0);
        format!(
            "the clock of the {ahead} is {hours} h {minutes} min {seconds} s ahead of that of the \
             {behind}, by a zone of time or GPS's leap seconds; time_offset_s = {} under [poses] \
             of survey.toml adds it to the times of the poses",
            self.offset_s + given_s.unwrap_or_default()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::trajectory::{PoseEntry, PoseFormat, spiral};

    fn slip(offset_s: f64) -> Option<String> {
        let poses = spiral(12, 0.1, 0.5);
        let entry = |(k, pose): (usize, _)| PoseEntry {
            camera: None,
            name: None,
            time_s: Some(1.7e9 + k as f64),
            pose,
        };
        let file = PoseFile {
            path: "poses.tum".into(),
            format: PoseFormat::Tum,
            entries: poses.into_iter().enumerate().map(entry).collect(),
            conflicts: Vec::new(),
        };
        let frame = |k: usize| FrameFile::picture(k, format!("{k}.png").into());
        let frames: Vec<FrameFile> = (0..12).map(frame).collect();
        let times_s: Vec<f64> = (0..12).map(|k| 1.7e9 + offset_s + f64::from(k)).collect();
        let how = TimeAssociation {
            tolerance_s: 0.01,
            interpolate: false,
        };
        ClockSlip::find(&file, &frames, &times_s, how).map(|slip| slip.sentence(None))
    }

    #[test]
    fn zones_and_leap_seconds_are_told() {
        for (offset_s, expected) in [
            (
                7200.0,
                "of the frames is 2 h 0 min 0 s ahead of that of the poses",
            ),
            (-19800.0, "of the poses is 5 h 30 min 0 s ahead"),
            (18.0, "of the frames is 0 h 0 min 18 s ahead"),
            (-3618.0, "time_offset_s = -3618 under [poses]"),
        ] {
            let said = slip(offset_s).unwrap();
            assert!(said.contains(expected), "{said}");
        }
        for offset_s in [7207.0, 1e6, 0.5] {
            assert_eq!(slip(offset_s), None, "{offset_s}");
        }
    }
}
