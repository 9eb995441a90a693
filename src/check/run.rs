//! The check of a survey.

use super::deformation::DeformationCheck;
use super::effort::Effort;
use super::interlacing::interlacing_warning;
use super::jitter::JitterCheck;
use super::masks::MaskCheck;
use super::overlap::OverlapCheck;
use super::pictures::PictureCheck;
use super::poses::PosesCheck;
use super::result::Check;
use super::warnings::warnings;
use crate::camera::Camera;
use crate::refine::{is_motionless, search_readings};
use crate::render::native_px_per_metre;
use crate::surface::SurfaceError;
use crate::survey::{Overlay, Survey};

/// Checks a survey without refining it.
///
/// # Errors
/// A camera that shows no wall at all.
pub fn check(survey: &Survey) -> Result<Check, SurfaceError> {
    let poses = survey.initial_poses();
    let surface = survey.surface.as_ref();
    // Opening a survey checks its poses, so a failure means a camera that shows no wall.
    let px_per_metre = native_px_per_metre(surface, &survey.cameras, &poses)
        .map_err(|_| SurfaceError::LooksAlongTheAxis)?;
    let overlap = OverlapCheck::of(survey, &poses);
    let (pictures, mut faults) = PictureCheck::of(survey);
    let overlay = match survey.find_overlay() {
        Ok(overlay) => overlay,
        Err(error) => {
            // A frame that cannot be read is among the faults already, if it was looked at.
            if faults.is_empty() {
                faults.push(error.to_string());
            }
            Overlay::default()
        }
    };
    let own = survey
        .frames
        .masks()
        .of(0)
        .filter(|_| !survey.cameras.is_rig());
    let own = own.map(|mask| mask.as_ref().clone());
    let proposed_mask = match (own, overlay.mask) {
        (Some(own), Some(found)) => Some(own.union(&found)),
        (own, found) => own.or(found),
    };
    if survey.frames.len() < 2 {
        faults.push("there is one frame; refine needs two that overlap".to_owned());
    }
    if is_motionless(&survey.initial) {
        faults.push(
            "all initial poses are equal; refine needs the motion of the camera (tunnelstitch plan \
             and gyro write poses)"
                .to_owned(),
        );
    }
    let mut check = Check {
        frames: survey.frames.len(),
        size_px: survey.cameras.size(),
        shown_share: mean_visible_fraction(survey),
        masks: MaskCheck::of(survey),
        overlay: overlay.report,
        proposed_mask,
        poses: PosesCheck::of(survey),
        jitter: JitterCheck::of(survey, px_per_metre, &overlap),
        overlap,
        px_per_metre,
        pictures,
        deformation: None,
        effort: Effort::of(survey, px_per_metre),
        readings: None,
        faults,
        warnings: survey.warnings.clone(),
    };
    // Frames that cannot be read are faults already.
    if check.faults.is_empty() {
        match search_readings(survey) {
            Ok(readings) => check.readings = readings,
            Err(error) => check.faults.push(error.to_string()),
        }
        match DeformationCheck::of(survey, &check.pictures) {
            Ok(deformation) => check.deformation = deformation,
            Err(error) => check.faults.push(error.to_string()),
        }
    }
    if check.overlay.interlaced {
        check.warnings.push(interlacing_warning(survey));
    }
    check.warnings.extend(warnings(&check));
    Ok(check)
}

/// Share of the picture that the lens covers, 0 to 1: the mean over the cameras.
fn mean_visible_fraction(survey: &Survey) -> f64 {
    let cameras = survey.cameras.all().iter();
    cameras.map(Camera::visible_fraction).sum::<f64>() / survey.cameras.count() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::simulate::{self, SimulateOptions};

    fn checked(options: SimulateOptions) -> Check {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("survey");
        simulate::write_survey(&options, &path, false, &Silent).unwrap();
        check(&Survey::open(&path).unwrap()).unwrap()
    }

    fn small() -> SimulateOptions {
        SimulateOptions {
            frames: 25,
            camera: crate::camera::Camera::from_vertical_fov(160, 120, 60f64.to_radians()),
            supersample: 2,
            ..SimulateOptions::free()
        }
    }

    #[test]
    fn the_survey_of_the_paper_has_no_warnings() {
        let check = checked(small());
        assert!(check.faults.is_empty(), "{:?}", check.faults);
        assert!(check.warnings.is_empty(), "{:?}", check.warnings);
        assert!((check.poses.step_deg - 30.0).abs() < 1e-6);
        assert!((check.poses.step_m - 0.1).abs() < 1e-9);
        // 75° of view, 30° apart.
        assert!(
            (0.4..0.7).contains(&check.overlap.neighbours),
            "{:?}",
            check.overlap
        );
        assert!(check.overlap.turns > 0.5);
        // 2° at a focal length of 104 px, and 3 cm at 35 px a metre.
        assert!(
            (check.jitter.sigma_px - 3.77).abs() < 0.05,
            "{:?}",
            check.jitter
        );
    }

    #[test]
    fn warnings_name_the_problem() {
        let far_apart = checked(SimulateOptions {
            turn_deg: 80.0,
            advance_m: 0.5,
            ..small()
        });
        let said = far_apart.warnings.join("\n");
        assert!(said.contains("overlap"), "{said}");
        let dark = checked(SimulateOptions {
            bad_frames: "0-24:black".parse().unwrap(),
            ..small()
        });
        let said = dark.warnings.join("\n");
        assert!(said.contains("dark"), "{said}");
    }

    /// The wall's shape shows only where turns see it from both sides.
    #[test]
    fn deformation_is_measurable_where_turns_overlap() {
        let near = checked(small()).deformation.unwrap();
        assert!(near.node_sigma_mm < 0.2 * near.prior_sigma_mm, "{near:?}");
        // Ovality is one figure of the whole survey.
        assert!(near.harmonic_sigma_mm[0] < near.node_sigma_mm, "{near:?}");
        assert!(near.warning().is_none());
        let far = checked(SimulateOptions {
            advance_m: 0.3,
            ..small()
        });
        let deformation = far.deformation.as_ref().unwrap();
        assert!(
            deformation.node_sigma_mm > 2.0 * near.node_sigma_mm,
            "{deformation:?} {near:?}"
        );
        let closer = deformation.half_advance_sigma_mm.unwrap();
        assert!(closer < 0.7 * deformation.node_sigma_mm, "{deformation:?}");
    }

    /// A masked shaft and ignored parts of the wall reduce the overlap.
    #[test]
    fn masked_and_ignored_parts_do_not_overlap() {
        let dir = tempfile::tempdir().unwrap();
        simulate::write_survey(&small(), dir.path(), true, &Silent).unwrap();
        let overlap = |ignore: &str| {
            let opened = Survey::open_with(dir.path(), |file| {
                let table: toml::Table = format!("ignore = {ignore}").parse().unwrap();
                file.tunnel.ignore = table["ignore"].clone().try_into().unwrap();
            });
            let survey = opened.unwrap();
            OverlapCheck::of(&survey, &survey.initial_poses())
        };
        let whole = overlap("[]");
        let half = overlap("[{ theta_deg = [0, 180] }]");
        // Some neighbours share no more wall.
        assert_eq!(half.least_neighbours, 0.0);
        assert!(
            half.neighbours < whole.neighbours && half.turns < whole.turns,
            "{half:?} {whole:?}"
        );
        let none = overlap("[{ theta_deg = [0, 360] }]");
        assert_eq!((none.neighbours, none.turns), (0.0, 0.0));
        let shaft = checked(SimulateOptions {
            shaft_percent: 40.0,
            ..small()
        });
        assert!(
            shaft.overlap.neighbours < 0.8 * whole.neighbours,
            "{:?}",
            shaft.overlap
        );
    }
}
