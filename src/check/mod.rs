//! What a survey is like, before hours are spent on it: frames, overlap, jitter, texture, effort,
//! and what to do about them.
//!
//! A dozen frames are decoded, the others only measured by their headers; everything else is
//! geometry.

mod advice;
mod effort;
mod overlap;
mod pictures;

pub use effort::Effort;
pub use overlap::OverlapCheck;
pub use pictures::PictureCheck;

use crate::numerics::median::upper_median;
use crate::render::native_px_per_metre;
use crate::surface::{SurfaceError, WallPoint};
use crate::survey::Survey;
use crate::trajectory::{Jitter, JitterModel};
use serde::Serialize;

/// A survey, looked over.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Check {
    /// Number of frames.
    pub frames: usize,
    /// Width and height of the frames by the calibration, pixels.
    pub size_px: [u32; 2],
    /// Share of the picture that the lens shows.
    pub shown_share: f64,
    /// What is not compared.
    pub masks: MaskCheck,
    /// Where the initial poses are.
    pub poses: PosesCheck,
    /// What neighbours and turns share.
    pub overlap: OverlapCheck,
    /// Median resolution of the frames at the wall, pixels per metre.
    pub px_per_metre: f64,
    /// How far off the initial poses may be.
    pub jitter: JitterCheck,
    /// What the pictures are like.
    pub pictures: PictureCheck,
    /// What refining and stitching will take.
    pub effort: Effort,
    /// What makes `refine` or `stitch` fail, and the remedy.
    pub faults: Vec<String>,
    /// What is possible but asks for attention, and what to do.
    pub warnings: Vec<String>,
}

/// What of the pictures and of the wall is left out.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct MaskCheck {
    /// Share of every picture that the mask hides.
    pub hidden_share: f64,
    /// Parts of the wall by which frames are not compared.
    pub ignored: usize,
    /// Share of the wall between the first and the last camera that these are.
    pub ignored_share: f64,
}

/// The initial poses.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct PosesCheck {
    /// Least and greatest chainage, metres.
    pub chainage_m: [f64; 2],
    /// Median distance from one pose to the next, metres.
    pub step_m: f64,
    /// Median turn from one pose to the next, degrees.
    pub step_deg: f64,
    /// Farthest that a camera stands from the axis, metres.
    pub off_axis_m: f64,
    /// Whether true poses are known.
    pub truth: bool,
}

/// The noise of the initial poses as it appears in the picture.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct JitterCheck {
    /// 1-σ of the displacement from one frame to the next that the poses do not tell, pixels.
    pub sigma_px: f64,
    /// The same as a share of what neighbours share along the way they are displaced: up to a
    /// quarter has been seen to work.
    pub share_of_overlap: f64,
}

/// Looks a survey over.
///
/// # Errors
/// A camera that looks along the tunnel's axis, in whose picture nothing can be measured.
pub fn check(survey: &Survey) -> Result<Check, SurfaceError> {
    let poses = survey.initial_poses();
    let surface = survey.surface.as_ref();
    // The poses have been checked when the survey was opened: a failure is a camera that looks
    // along the axis.
    let px_per_metre = native_px_per_metre(surface, &survey.camera, &poses)
        .map_err(|_| SurfaceError::LooksAlongTheAxis)?;
    let overlap = OverlapCheck::of(survey, &poses);
    let (pictures, mut faults) = PictureCheck::of(survey);
    let jitter = jitter(&survey.prior, px_per_metre, survey, &overlap);
    let mut check = Check {
        frames: survey.frames.len(),
        size_px: [survey.camera.width, survey.camera.height],
        shown_share: survey.camera.shown_share(),
        masks: MaskCheck::of(survey),
        poses: PosesCheck::of(survey),
        overlap,
        px_per_metre,
        jitter,
        pictures,
        effort: Effort::of(survey, px_per_metre),
        faults: Vec::new(),
        warnings: survey.warnings.clone(),
    };
    if check.frames < 2 {
        faults.push("there is one frame; refine needs two that overlap".to_owned());
    }
    check.faults = faults;
    check.warnings.extend(advice::advise(&check));
    Ok(check)
}

/// 1-σ of the displacement between neighbours: turns about the picture's two axes and shifts,
/// `f σ_R ⊕ σ_t px/m`, twice the variance where each pose is off on its own.
fn jitter(
    prior: &Jitter,
    px_per_metre: f64,
    survey: &Survey,
    overlap: &OverlapCheck,
) -> JitterCheck {
    let focal_px = survey.camera.focal_px();
    let [x, y, z] = prior.translation_sigma_m;
    let shift_px = px_per_metre * y.max(x).max(z);
    let one = (focal_px * prior.rotation_sigma_rad).hypot(shift_px);
    let sigma_px = match prior.model {
        JitterModel::RandomWalk => one,
        JitterModel::Independent => one * std::f64::consts::SQRT_2,
    };
    let shared_px = overlap.neighbours_width_m * px_per_metre;
    JitterCheck {
        sigma_px,
        share_of_overlap: sigma_px / shared_px.max(1e-9),
    }
}

/// Points around and along at which the wall is asked whether it is ignored.
const ASKED: [u32; 2] = [360, 200];

impl MaskCheck {
    fn of(survey: &Survey) -> Self {
        let surface = survey.surface.as_ref();
        let initial = survey.initial.iter();
        let chainage = initial.map(|stamped| surface.chainage_m(&stamped.pose.t_wc));
        let from_m = chainage.clone().fold(f64::INFINITY, f64::min);
        let to_m = chainage.fold(f64::NEG_INFINITY, f64::max);
        let share = |k: u32, of: u32| (f64::from(k) + 0.5) / f64::from(of);
        let point = |k: u32| WallPoint {
            s_m: share(k % ASKED[0], ASKED[0]) * surface.perimeter_m(),
            h_m: from_m + share(k / ASKED[0], ASKED[1]) * (to_m - from_m),
        };
        let points = ASKED[0] * ASKED[1];
        let ignored = (0..points).filter(|k| survey.ignored.hold(&point(*k)));
        Self {
            hidden_share: survey.frames.mask().map_or(0.0, |mask| mask.share()),
            ignored: survey.file.tunnel.ignore.len(),
            ignored_share: ignored.count() as f64 / f64::from(points),
        }
    }
}

impl PosesCheck {
    fn of(survey: &Survey) -> Self {
        let poses = survey.initial_poses();
        let steps = || poses.windows(2);
        let straight = || poses.iter().map(|pose| survey.surface.straightened(pose));
        let chainage = || straight().map(|pose| pose.t_wc.y);
        Self {
            chainage_m: [
                chainage().fold(f64::INFINITY, f64::min),
                chainage().fold(f64::NEG_INFINITY, f64::max),
            ],
            step_m: median(steps().map(|pair| (pair[1].t_wc - pair[0].t_wc).norm())),
            step_deg: median(steps().map(|pair| pair[0].r_wc.angle_to(&pair[1].r_wc))).to_degrees(),
            off_axis_m: straight()
                .map(|pose| pose.t_wc.x.hypot(pose.t_wc.z))
                .fold(0.0, f64::max),
            truth: survey.truth.is_some(),
        }
    }
}

/// The middle value; 0 of none.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    upper_median(values.collect()).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::simulate::{self, SimulateOptions};

    fn looked_over(options: SimulateOptions) -> Check {
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
    fn the_papers_survey_is_sound() {
        let check = looked_over(small());
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
    fn what_is_wrong_is_said() {
        let far_apart = looked_over(SimulateOptions {
            turn_deg: 80.0,
            advance_m: 0.5,
            ..small()
        });
        let said = far_apart.warnings.join("\n");
        assert!(said.contains("overlap"), "{said}");
        let dark = looked_over(SimulateOptions {
            bad_frames: "0-24:black".parse().unwrap(),
            ..small()
        });
        let said = dark.warnings.join("\n");
        assert!(said.contains("dark"), "{said}");
    }

    /// A shaft in the picture takes its share of every overlap, and so does wall that is ignored.
    #[test]
    fn what_is_left_out_is_no_overlap() {
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
        // Of some neighbours nothing is left.
        assert_eq!(half.least_neighbours, 0.0);
        assert!(
            half.neighbours < whole.neighbours && half.turns < whole.turns,
            "{half:?} {whole:?}"
        );
        let none = overlap("[{ theta_deg = [0, 360] }]");
        assert_eq!((none.neighbours, none.turns), (0.0, 0.0));
        let shaft = looked_over(SimulateOptions {
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
