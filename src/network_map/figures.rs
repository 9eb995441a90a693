//! Figures of a section, from what `refine` has written.

use super::error::MapError;
use crate::evaluate::deformation::{SectionDeformation, read_sections};
use crate::files::limits::MAX_REPORT_BYTES;
use crate::files::read_text;
use crate::refine::{FrameFlag, FrameSigma, SurveyVerdict};
use crate::report::{REFINEMENT_FILE, SECTIONS_FILE};
use serde::Deserialize;
use std::path::Path;
use tunnelstitch_geometry::numerics::median::upper_median;

/// Accuracy of a section's poses.
#[derive(Clone, Debug, PartialEq)]
pub struct Accuracy {
    /// The verdict, in a sentence.
    pub verdict: Option<String>,
    /// Number of frames.
    pub frames: usize,
    /// Number of photometric frames.
    pub photometric: usize,
    /// 1-σ of the photometric frames against each other, median, pixels.
    pub registration_px: Option<f64>,
    /// That 1-σ on the wall, millimetres, by the size of a pixel of each frame there.
    pub registration_mm: Option<f64>,
    /// 1-σ of the photometric frames against the first, median, pixels.
    pub absolute_px: Option<f64>,
    /// That 1-σ on the wall, millimetres.
    pub absolute_mm: Option<f64>,
}

/// The part of `refine.json` that is read.
#[derive(Deserialize)]
struct RefineFile {
    frames: Vec<FrameFigures>,
    #[serde(default)]
    verdict: Option<SurveyVerdict>,
}

#[derive(Deserialize)]
struct FrameFigures {
    flag: FrameFlag,
    sigma: FrameSigma,
}

impl Accuracy {
    /// Reads what `refine` has written into a folder.
    ///
    /// # Errors
    /// A `refine.json` that is missing or of another version.
    pub fn read(refined: &Path) -> Result<Self, MapError> {
        let path = refined.join(REFINEMENT_FILE);
        let fail = |what: String| MapError::Result {
            path: path.clone(),
            what,
        };
        let text = read_text(&path, MAX_REPORT_BYTES).map_err(|error| fail(error.to_string()))?;
        let file = serde_json::from_str(&text).map_err(|error| fail(error.to_string()))?;
        Ok(Self::of(file))
    }

    fn of(file: RefineFile) -> Self {
        let frames = file.frames.iter();
        let photometric = frames.filter(|frame| frame.flag == FrameFlag::Photometric);
        let sigmas: Vec<FrameSigma> = photometric.map(|frame| frame.sigma).collect();
        let median =
            |of: fn(&FrameSigma) -> f64| upper_median(sigmas.iter().map(of).collect::<Vec<f64>>());
        Self {
            verdict: file.verdict.map(|verdict| verdict.sentence),
            frames: file.frames.len(),
            photometric: sigmas.len(),
            registration_px: median(|sigma| sigma.registration_px),
            registration_mm: median(|sigma| {
                1e3 * sigma.registration_px * sigma.wall_m / sigma.wall_px
            }),
            absolute_px: median(|sigma| sigma.wall_px),
            absolute_mm: median(|sigma| 1e3 * sigma.wall_m),
        }
    }

    /// Photometric frames among all.
    pub fn photometric_share(&self) -> Option<f64> {
        (self.frames > 0).then(|| self.photometric as f64 / self.frames as f64)
    }
}

/// The most deformed places of a section; None where nothing was measured.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WorstDeformation {
    /// Deviation of the largest absolute value, millimetres, positive outwards, and its chainage,
    /// metres.
    pub deviation: Option<(f64, f64)>,
    /// Largest ovality (largest less smallest diameter), millimetres, and its chainage, metres.
    pub ovality: Option<(f64, f64)>,
    /// 1-σ of that ovality, millimetres.
    pub ovality_sigma_mm: Option<f64>,
}

impl WorstDeformation {
    /// Reads what `refine` has written into a folder; empty if it has found no deformation.
    ///
    /// # Errors
    /// A `sections.csv` that is of another version.
    pub fn read(refined: &Path) -> Result<Self, MapError> {
        let path = refined.join(SECTIONS_FILE);
        if !path.is_file() {
            return Ok(Self::default());
        }
        let text = read_text(&path, MAX_REPORT_BYTES).map_err(|error| error.to_string());
        let sections = text.and_then(|text| read_sections(&text));
        let sections = sections.map_err(|what| MapError::Result { path, what })?;
        Ok(Self::of(&sections))
    }

    fn of(sections: &[SectionDeformation]) -> Self {
        let worst = |of: fn(&SectionDeformation) -> Option<f64>| {
            let values = sections.iter();
            let values =
                values.filter_map(|section| Some((section, of(section)?, section.chainage_m?)));
            values.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
        };
        let ovality = worst(|section| section.ovality_mm);
        Self {
            deviation: worst(|section| section.deviation_extreme_mm).map(|(_, mm, m)| (mm, m)),
            ovality: ovality.map(|(_, mm, m)| (mm, m)),
            ovality_sigma_mm: ovality.and_then(|(section, ..)| section.ovality_sigma_mm),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_those_of_the_photometric_frames() {
        let frame = |flag: &str, wall_px: &str, registration_px: f64| {
            format!(
                r#"{{"flag": "{flag}", "residual": 2.0, "sigma": {{"rotation_deg": 0.1,
                "translation_m": 0.1, "wall_m": 0.004, "wall_px": {wall_px},
                "registration_px": {registration_px}}}}}"#
            )
        };
        let frames = [
            frame("photometric", "0.2", 0.01),
            frame("prior", "null", 9.0),
            frame("photometric", "0.4", 0.03),
            frame("photometric", "0.3", 0.02),
        ];
        let text = format!(
            r#"{{"frames": [{}], "verdict": {{"photometric": 3, "frames": 4, "sentence": "s"}}}}"#,
            frames.join(",")
        );
        let accuracy = Accuracy::of(serde_json::from_str(&text).unwrap());
        assert_eq!((accuracy.photometric, accuracy.frames), (3, 4));
        assert_eq!(accuracy.photometric_share(), Some(0.75));
        assert_eq!(accuracy.registration_px, Some(0.02));
        assert_eq!(accuracy.absolute_px, Some(0.3));
        assert_eq!(accuracy.absolute_mm, Some(4.0));
        // 0.01 px of 20 mm, 0.02 px of 13.3 mm, 0.03 px of 10 mm.
        assert!((accuracy.registration_mm.unwrap() - 0.8 / 3.0).abs() < 1e-12);
        assert_eq!(accuracy.verdict.as_deref(), Some("s"));
    }

    #[test]
    fn the_worst_places_are_found_with_their_chainages() {
        let dir = tempfile::tempdir().unwrap();
        let read = || WorstDeformation::read(dir.path());
        assert_eq!(read().unwrap(), WorstDeformation::default());
        let sections = [(1.0, 5.0, 2.0), (2.0, 7.0, -9.0), (3.0, 6.0, 4.0)];
        let sections = sections.map(|(chainage_m, ovality_mm, extreme_mm)| {
            let mut section = SectionDeformation::default();
            section.chainage_m = Some(chainage_m);
            section.ovality_mm = Some(ovality_mm);
            section.ovality_sigma_mm = Some(0.1 * chainage_m);
            section.deviation_extreme_mm = Some(extreme_mm);
            section
        });
        let worst = WorstDeformation {
            deviation: Some((-9.0, 2.0)),
            ovality: Some((7.0, 2.0)),
            ovality_sigma_mm: Some(0.2),
        };
        assert_eq!(WorstDeformation::of(&sections), worst);
        std::fs::write(dir.path().join(SECTIONS_FILE), "chainage_m\nx\n").unwrap();
        let message = read().unwrap_err().to_string();
        assert!(message.contains("sections.csv"), "{message}");
    }
}
