//! Texts of a folder that were tried as parts of a survey, and refused.

use tunnelstitch_geometry::camera::CalibrationError;
use tunnelstitch_geometry::trajectory::PoseError;

/// A part of a survey that a text may hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum SurveyPart {
    Calibration,
    Poses,
}

impl SurveyPart {
    /// Larger files are not tried.
    fn max_bytes(self) -> u64 {
        match self {
            Self::Calibration => 4 << 20,
            Self::Poses => 256 << 20,
        }
    }

    /// Reads a file of `bytes` bytes as this part, if it is not larger than allowed.
    ///
    /// # Errors
    /// The error of reading, or the size.
    pub fn read<T, E: Into<Refusal>>(
        self,
        bytes: u64,
        read: impl FnOnce() -> Result<T, E>,
    ) -> Result<T, Refusal> {
        if bytes > self.max_bytes() {
            let reason = format!("larger than {} MiB", self.max_bytes() >> 20);
            return Err(Refusal::new(self, &reason, false));
        }
        read().map_err(Into::into)
    }
}

/// The refusal of a file by the reader of a part.
#[derive(Debug)]
pub(super) struct Refusal {
    /// The part.
    pub part: SurveyPart,
    /// The reason, in words.
    pub what: String,
    /// True if the file is faulty, false if it is of another kind.
    pub is_faulty: bool,
}

impl Refusal {
    fn new(part: SurveyPart, reason: &str, is_faulty: bool) -> Self {
        let name = match part {
            SurveyPart::Calibration => "calibration",
            SurveyPart::Poses => "poses",
        };
        Self {
            part,
            what: format!("no {name}: {reason}"),
            is_faulty,
        }
    }
}

impl From<CalibrationError> for Refusal {
    fn from(error: CalibrationError) -> Self {
        let is_faulty = !matches!(error, CalibrationError::OtherKind { .. });
        Self::new(SurveyPart::Calibration, &error.to_string(), is_faulty)
    }
}

impl From<PoseError> for Refusal {
    fn from(error: PoseError) -> Self {
        let is_faulty = !matches!(error, PoseError::OtherKind { .. });
        Self::new(SurveyPart::Poses, &error.to_string(), is_faulty)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::camera::read_calibration;
    use tunnelstitch_geometry::trajectory::read_poses;

    /// A text with these words is faulty as poses or as a calibration, or of another kind.
    #[test]
    fn faulty_files_are_told_from_those_of_another_kind() {
        let dir = tempfile::tempdir().unwrap();
        let is_faulty = |name: &str, text: &str| {
            let path = dir.path().join(name);
            std::fs::write(&path, text).unwrap();
            let calibration = read_calibration(&path, None).map_err(Refusal::from);
            let poses = read_poses(&path, None).map_err(Refusal::from);
            [calibration.err(), poses.err()].map(|refusal| refusal.map(|r| r.is_faulty))
        };
        let other = [Some(false); 2];
        assert_eq!(
            is_faulty("a.txt", "holds no poses in no known format\n"),
            other
        );
        assert_eq!(
            is_faulty("b.txt", "# only a comment\n"),
            [Some(true), Some(false)]
        );
        assert_eq!(is_faulty("c.json", "{\"a\": 1}"), other);
        let short = "0 0 0 0 0 0 0 1\n1 0 0 0.1 0 0 0\n";
        assert_eq!(is_faulty("d.txt", short), [Some(false), Some(true)]);
        let camera = "1 OPENCVX 64 48 50 50 32 24 0 0 0\n";
        assert_eq!(is_faulty("e.txt", camera), [Some(true), Some(false)]);
    }

    #[test]
    fn larger_files_are_not_tried() {
        let read = || -> Result<(), CalibrationError> { unreachable!() };
        let refusal = SurveyPart::Calibration
            .read((4 << 20) + 1, read)
            .unwrap_err();
        assert_eq!(refusal.what, "no calibration: larger than 4 MiB");
        assert!(!refusal.is_faulty);
    }
}
