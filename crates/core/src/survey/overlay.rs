//! Pixels of a survey that move with the picture and not with the wall.

use super::file::OverlayUse;
use super::open::Survey;
use crate::frames::{
    CombAxis, FrameError, GreyImage, Mask, StaticPixels, StoredFrame, TemporalStatistics,
    comb_ratio, find_static_pixels,
};
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::numerics::median::upper_median;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Smallest number of frames between which the wall moves.
const MIN_FRAMES: usize = 8;
/// Smallest number of frames in which interlacing is sought.
const MIN_COMBED_FRAMES: usize = 4;
/// Smallest median comb ratio of interlaced frames; noise without any texture has 1 ± 0.02 in
/// frames of 320 × 240 px.
const MIN_COMB_RATIO: f64 = 1.12;
/// Smallest share of interlaced frames whose comb ratio is above 1.
const MIN_COMBED_SHARE: f64 = 0.75;

/// Pixels that do not move with the wall.
#[derive(Clone, Debug, Default)]
pub struct Overlay {
    /// The finding in numbers.
    pub report: OverlayReport,
    /// The mask that hides them, if there are any.
    pub mask: Option<Mask>,
}

/// Pixels that do not move with the wall, in numbers.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct OverlayReport {
    /// Number of examined frames, which are lit and between which the wall moves.
    pub frames: usize,
    /// Share of the picture that does not move with the wall, 0 to 1, beyond the given mask.
    pub share: f64,
    /// True if these pixels are left out.
    pub left_out: bool,
    /// The reason for which they were not sought, if they were not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skipped: Option<String>,
    /// True if the frames are interlaced.
    pub interlaced: bool,
}

impl OverlayReport {
    /// The finding in a sentence without its full stop; None if there is nothing to say.
    pub fn sentence(&self) -> Option<String> {
        if let Some(reason) = &self.skipped {
            return Some(format!(
                "pixels that do not move with the wall were not sought: {reason}"
            ));
        }
        (self.share > 0.0).then(|| {
            let use_of = if self.left_out {
                "left out"
            } else {
                "used all the same"
            };
            format!(
                "{:.1} % of the picture does not move with the wall: {use_of}",
                100.0 * self.share
            )
        })
    }
}

impl Survey {
    /// Finds the pixels that do not move with the wall, and whether the frames are interlaced, in
    /// up to 64 frames; the pixels are not sought if `[frames] overlay` keeps them, if there are
    /// too few frames between which the wall moves, or in frames of a rig.
    ///
    /// # Errors
    /// A frame that cannot be read.
    pub fn find_overlay(&self) -> Result<Overlay, FrameError> {
        if self.cameras.is_rig() {
            let reason = "in frames of a rig only the masks of its cameras hide them";
            return Ok(Overlay {
                report: OverlayReport {
                    skipped: Some(reason.to_owned()),
                    ..OverlayReport::default()
                },
                mask: None,
            });
        }
        let (chosen, motion) = self.moving_frames();
        let [width, height] = self.cameras.size();
        let decoded = chosen.as_slice().par_map(|frame| {
            let picture = StoredFrame::decode(&self.frames[*frame], width, height)?;
            let grey = picture.grey_with_clipped();
            let combs = [CombAxis::Rows, CombAxis::Columns].map(|axis| comb_ratio(&grey, axis));
            Ok((combs, TemporalStatistics::reduce(grey)))
        });
        let decoded = decoded
            .into_iter()
            .collect::<Result<Vec<_>, FrameError>>()?;
        let ratios = |axis: usize| -> Vec<f64> {
            let ratios = decoded.iter().filter_map(|(combs, _)| combs[axis]);
            ratios.collect()
        };
        let mut report = OverlayReport {
            interlaced: is_combed(&ratios(0)) && !is_combed(&ratios(1)),
            ..OverlayReport::default()
        };
        let keeps = self.file.frames.overlay == Some(OverlayUse::Keep);
        let pictures: Vec<GreyImage> = decoded.into_iter().map(|(_, grey)| grey).collect();
        let size = [width as usize, height as usize];
        let statistics = TemporalStatistics::new(size, pictures, self.frames.masks().of(0));
        report.frames = statistics.as_ref().map_or(0, TemporalStatistics::frames);
        let statistics = statistics.filter(|statistics| statistics.frames() >= MIN_FRAMES);
        if keeps {
            return Ok(Overlay { report, mask: None });
        }
        let found = statistics.map(|statistics| find_static_pixels(&statistics, &motion));
        let mask = match found {
            Some(StaticPixels::Found(mask)) => Some(mask),
            Some(StaticPixels::Absent) => None,
            Some(StaticPixels::WallRepeats) => {
                let reason = "the wall repeats itself with the step of the camera";
                report.skipped = Some(reason.to_owned());
                None
            }
            None => {
                report.skipped = Some(format!(
                    "they show in {MIN_FRAMES} frames or more between which the wall moves, and \
                     here are {}",
                    report.frames
                ));
                None
            }
        };
        report.share = mask.as_ref().map_or(0.0, Mask::masked_fraction);
        report.left_out = mask.is_some();
        Ok(Overlay { report, mask })
    }

    /// Leaves out the pixels that do not move with the wall ([`Survey::find_overlay`]), in addition
    /// to those of the survey's mask.
    ///
    /// # Errors
    /// A frame that cannot be read.
    pub fn leave_out_overlay(&mut self) -> Result<Overlay, FrameError> {
        let overlay = self.find_overlay()?;
        if let Some(mask) = &overlay.mask {
            self.frames.hide(mask);
        }
        Ok(overlay)
    }
}

/// True if frames of these comb ratios are combed, along rows or columns. Interlaced frames are
/// along rows alone, dithered ones along both.
///
/// The nominal rate of false alarms is below 10⁻⁶: progressive frames have ratios below 1,
/// those of nothing but noise 1 with a standard deviation of 0.02 (at 320 × 240 px), six of which
/// the median of four frames or more would have to deviate by.
fn is_combed(ratios: &[f64]) -> bool {
    let above = ratios.iter().filter(|ratio| **ratio > 1.0).count();
    ratios.len() >= MIN_COMBED_FRAMES
        && above as f64 >= MIN_COMBED_SHARE * ratios.len() as f64
        && upper_median(ratios.to_vec()).is_some_and(|median| median >= MIN_COMB_RATIO)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_combed_if_most_are() {
        assert!(is_combed(&[1.3, 1.5, 0.98, 1.4]));
        assert!(!is_combed(&[1.3, 1.5, 0.9, 0.8]));
        assert!(!is_combed(&[1.05; 12]));
        assert!(!is_combed(&[1.5; 3]));
    }

    #[test]
    fn sentences_state_the_share_or_the_reason() {
        let report = |share: f64, skipped: Option<&str>| OverlayReport {
            share,
            left_out: share > 0.0,
            skipped: skipped.map(str::to_owned),
            ..OverlayReport::default()
        };
        let said = report(0.019, None).sentence().unwrap();
        assert_eq!(
            said,
            "1.9 % of the picture does not move with the wall: left out"
        );
        assert_eq!(report(0.0, None).sentence(), None);
        let said = report(0.0, Some("3 frames")).sentence().unwrap();
        assert!(said.ends_with("not sought: 3 frames"), "{said}");
    }
}
