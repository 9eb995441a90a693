//! Warnings of a check, each with its remedy.

use super::deformation::DeformationCheck;
use super::result::Check;

/// Smallest overlap of neighbours, share of a frame, without a warning.
const MIN_OVERLAP: f64 = 0.25;
/// Largest expected displacement, share of the overlap, without a warning: larger ones have not
/// been shown to converge.
const MAX_JITTER: f64 = 0.25;
/// Smallest mean grey level without a warning: below it, noise covers the texture.
const MIN_GREY: f64 = 12.0;
/// Largest share of saturated pixels without a warning: more are not specular highlights only.
const MAX_SATURATED: f64 = 0.2;
/// Largest 1-σ of a frame's registration, pixels, without a warning.
const MAX_REGISTRATION_SIGMA_PX: f64 = 0.1;

/// Lists the warnings, the most severe first.
pub(super) fn warnings(check: &Check) -> Vec<String> {
    let of_poses = match &check.readings {
        // Poses that are read wrongly tell nothing else.
        Some(readings) => vec![readings.sentence()],
        None => of_poses(check),
    };
    let of_pictures = [
        dark_frames(check),
        saturated_frames(check),
        weak_texture(check),
        uncovered_image(check),
    ];
    let of_pictures = of_pictures.into_iter().flatten();
    of_poses.into_iter().chain(of_pictures).collect()
}

/// The warnings that follow from the initial poses.
fn of_poses(check: &Check) -> Vec<String> {
    let all = [
        weak_overlap(check),
        frames_without_wall(check),
        open_turns(check),
        large_jitter(check),
        (check.deformation.as_ref()).and_then(DeformationCheck::warning),
    ];
    all.into_iter().flatten().collect()
}

fn percent(share: f64) -> f64 {
    (100.0 * share).round()
}

fn weak_overlap(check: &Check) -> Option<String> {
    let overlap = &check.overlap;
    (check.frames > 1 && overlap.least_neighbours < MIN_OVERLAP).then(|| {
        format!(
            "frames {} and {} overlap by {} % according to the initial poses, radius_m and the \
             calibration; refine needs {} % or more, as of frames at smaller steps",
            overlap.least_after,
            overlap.least_after + 1,
            percent(overlap.least_neighbours),
            percent(MIN_OVERLAP)
        )
    })
}

fn frames_without_wall(check: &Check) -> Option<String> {
    let count = check.overlap.without_wall;
    (count > 0).then(|| {
        format!(
            "{count} frames show no wall within camera.max_range_m according to the initial poses; \
             give a longer range, or remove these frames"
        )
    })
}

fn open_turns(check: &Check) -> Option<String> {
    (check.overlap.turns == 0.0 && check.frames > 1).then(|| {
        "no turn overlaps another one, so errors accumulate without loop closure; advance less per \
         turn so that turns overlap"
            .to_owned()
    })
}

fn large_jitter(check: &Check) -> Option<String> {
    let jitter = &check.jitter;
    (jitter.share_of_overlap > MAX_JITTER).then(|| {
        format!(
            "according to [prior], neighbouring frames are displaced by {:.0} px (1-σ), {} % of \
             their overlap; convergence is tested for up to {} %: give better poses, smaller \
             sigmas if the poses are better, or more overlap",
            jitter.sigma_px,
            percent(jitter.share_of_overlap),
            percent(MAX_JITTER)
        )
    })
}

fn dark_frames(check: &Check) -> Option<String> {
    let pictures = &check.pictures;
    (pictures.decoded > 0 && pictures.grey < MIN_GREY).then(|| {
        format!(
            "the frames are dark (mean grey level {:.0} of 255): use more light or a longer \
             exposure",
            pictures.grey
        )
    })
}

fn saturated_frames(check: &Check) -> Option<String> {
    let share = check.pictures.clipped;
    (share > MAX_SATURATED).then(|| {
        format!(
            "{} % of the pixels are saturated (black or white) and carry no information: change \
             the exposure",
            percent(share)
        )
    })
}

fn weak_texture(check: &Check) -> Option<String> {
    let pictures = &check.pictures;
    let is_enough = pictures
        .sigma_px
        .is_some_and(|sigma_px| sigma_px <= MAX_REGISTRATION_SIGMA_PX);
    (pictures.decoded > 0 && !is_enough).then(|| {
        format!(
            "the wall has hardly any texture (gradient {:.2} grey levels per px, noise {:.1}): \
             {}; use grazing light, or a camera nearer to the wall",
            pictures.slope_grey_per_px,
            pictures.noise_grey,
            pictures.describe_registration(1)
        )
    })
}

fn uncovered_image(check: &Check) -> Option<String> {
    (check.shown_share < 1.0).then(|| {
        format!(
            "the lens covers {} % of the image; the rest is left out",
            percent(check.shown_share)
        )
    })
}
