//! What asks for attention, and what to do.

use super::Check;

/// Neighbours that share less than this are tied loosely.
const LEAST_OVERLAP: f64 = 0.25;
/// Displacements of more than this share of the overlap have not been seen to work.
const MOST_JITTER: f64 = 0.25;
/// Darker, and the wall is in the sensor's noise.
const DARK: f64 = 12.0;
/// Share of clipped pixels that is no longer a glint.
const MOST_CLIPPED: f64 = 0.2;
/// A frame that its own pixels place no better than this ties nothing.
const LEAST_CERTAIN_PX: f64 = 0.1;

/// Warnings, the gravest first.
pub fn advise(check: &Check) -> Vec<String> {
    let mut said = Vec::new();
    let percent = |share: f64| (100.0 * share).round();
    let overlap = &check.overlap;
    if check.frames > 1 && overlap.least_neighbours < LEAST_OVERLAP {
        said.push(format!(
            "frames {} and {} overlap by {} % by the initial poses; refine needs {} % or more: take frames at smaller steps, or check \
             radius_m and the poses' units",
            overlap.least_after,
            overlap.least_after + 1,
            percent(overlap.least_neighbours),
            percent(LEAST_OVERLAP)
        ));
    }
    if overlap.along_the_axis > 0 {
        said.push(format!(
            "{} frames look along the tunnel's axis by the initial poses; check camera_axes and tunnel_frame, or leave them out",
            overlap.along_the_axis
        ));
    }
    if overlap.turns == 0.0 && check.frames > 1 {
        said.push(
            "no turn overlaps another: what neighbours are off adds up, and nothing closes it; let turns overlap by advancing less a \
             turn"
                .to_owned(),
        );
    }
    if check.jitter.share_of_overlap > MOST_JITTER {
        said.push(format!(
            "[prior] lets neighbours be displaced by {:.0} px (1-σ), {} % of what they share; up to {} % has been seen to work: give \
             better poses, smaller sigmas if the poses are better, or more overlap",
            check.jitter.sigma_px,
            percent(check.jitter.share_of_overlap),
            percent(MOST_JITTER)
        ));
    }
    let pictures = &check.pictures;
    if pictures.decoded > 0 && pictures.grey < DARK {
        said.push(format!(
            "the frames are dark (mean grey level {:.0} of 255): more light, or a longer exposure",
            pictures.grey
        ));
    }
    if pictures.clipped > MOST_CLIPPED {
        said.push(format!(
            "{} % of the pixels are full black or white and tell nothing: change the exposure",
            percent(pictures.clipped)
        ));
    }
    if pictures.decoded > 0 && pictures.sigma_px > LEAST_CERTAIN_PX {
        said.push(format!(
            "the wall shows hardly any texture ({:.2} grey levels a pixel, noise {:.1}): frames can be placed to {:.1} px at best; more \
             light along the wall, or a nearer camera",
            pictures.slope_grey_per_px, pictures.noise_grey, pictures.sigma_px
        ));
    }
    if check.shown_share < 1.0 {
        said.push(format!(
            "the lens shows {} % of the picture; what is beyond is left out",
            percent(check.shown_share)
        ));
    }
    said
}
