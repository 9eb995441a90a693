//! Options of a refinement.

use tunnelstitch_core::survey::CalibrationGroup;
use tunnelstitch_geometry::numerics::significance::FALSE_ALARM_RATE;

/// Treatment of the wall's shape.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ShapeMode {
    /// The deviation from the nominal shape is estimated with the poses, and the lens with both, as
    /// far as the frames show any.
    #[default]
    Estimated,
    /// The wall is as given.
    Fixed,
}

/// Treatment of the light in the frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Photometry {
    /// By the model, or, where the light defies it, by local normalisation.
    #[default]
    Auto,
    /// By the model: gain and bias of every frame, and a shading that all have in common.
    Model,
    /// By local normalisation ([`tunnelstitch_core::frames::normalise_locally`]).
    Normalised,
}

/// Options of a refinement. The defaults suit most surveys; the noise model of the poses comes with
/// the input.
#[derive(Clone, Debug, serde::Serialize)]
pub struct RefineOptions {
    /// Shared parameters to estimate besides the poses; if None, those that the input asks for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibrate: Option<Vec<CalibrationGroup>>,
    /// Treatment of the wall's shape.
    pub shape: ShapeMode,
    /// Treatment of the light.
    pub photometry: Photometry,
    /// 1-σ of the logarithm of a frame's gain around 0 (0.3 is about ±30 %).
    pub log_gain_sigma: f64,
    /// 1-σ of a frame's bias around 0, grey levels.
    pub bias_sigma: f64,
    /// Pixels of the shorter side at the coarsest pyramid level, at least.
    pub coarsest_side: u32,
    /// Pyramid levels that tracking and windows use, from the coarsest; the global solve starts
    /// where they end.
    pub tracking_levels: usize,
    /// Frames registered between two solves of the sliding window.
    pub window_stride: usize,
    /// Wall samples per pixel along each axis in the last solve (but for a joint one).
    pub final_density: f64,
    /// Wall samples per pixel along each axis at which the outlier mask of the last solve is found;
    /// if None, those of that solve. (A joint solve always uses two a pixel.)
    pub outlier_mask_density: Option<f64>,
    /// Solve once more, for the wall at a third of a pixel jointly with the poses, instead of
    /// interpolating between the frames' pixels: on walls with sharp edges errors are about a third
    /// smaller, in ten to twenty times the time. The solve is skipped where the wall is too smooth
    /// to gain from it.
    pub joint: bool,
    /// Largest 1-σ of a photometric frame against those that show the same wall, pixels.
    pub max_sigma_px: f64,
    /// Rate of false alarms of a survey: of right frames that tests reject, and of right priors
    /// that they contradict.
    pub false_alarm_rate: f64,
    /// Memory for decoded frames, bytes. Frames that do not fit are decoded again when needed.
    pub cache_bytes: usize,
    /// Largest number of steps of a global solve.
    pub max_iterations: u64,
    /// The last global solve ends when no wall point moves by more than this in a step, pixels, ...
    pub step_tolerance_px: f64,
    /// ... or when a step is shorter than this share of the estimate's own uncertainty. (A joint
    /// one ends sooner: at three tenths of it.)
    pub step_tolerance_sigma: f64,
}

impl Default for RefineOptions {
    fn default() -> Self {
        Self {
            calibrate: None,
            shape: ShapeMode::Estimated,
            photometry: Photometry::Auto,
            log_gain_sigma: 0.3,
            bias_sigma: 10.0,
            coarsest_side: 30,
            tracking_levels: 3,
            window_stride: 6,
            final_density: 2.0,
            outlier_mask_density: None,
            joint: false,
            max_sigma_px: 0.25,
            false_alarm_rate: FALSE_ALARM_RATE,
            cache_bytes: 2 << 30,
            max_iterations: 20,
            step_tolerance_px: 0.0005,
            step_tolerance_sigma: 0.1,
        }
    }
}

impl RefineOptions {
    /// Options for speed: the last solve ends with the first step shorter than a tenth of a pixel
    /// or twice the uncertainty, most often its first. Gauss–Newton leaves a few hundredths of such
    /// a step. The outlier mask is found at coarser samples.
    pub fn fast() -> Self {
        Self {
            final_density: 1.5,
            outlier_mask_density: Some(1.0),
            step_tolerance_px: 0.1,
            step_tolerance_sigma: 2.0,
            ..Self::default()
        }
    }

    /// The coarsest pyramid level for frames whose shorter side has this many pixels (0 is full
    /// size).
    pub fn coarsest_level(&self, side: u32) -> usize {
        let mut level = 0;
        while side >> (level + 1) >= self.coarsest_side.max(2) {
            level += 1;
        }
        level
    }

    /// The finest level of tracking, where the global solve starts.
    pub fn handover_level(&self, side: u32) -> usize {
        self.coarsest_level(side)
            .saturating_sub(self.tracking_levels.saturating_sub(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_follow_the_shorter_side() {
        let options = RefineOptions::default();
        assert_eq!(options.coarsest_level(480), 4);
        assert_eq!(options.coarsest_level(360), 3);
        assert_eq!(options.handover_level(480), 2);
        assert_eq!(options.coarsest_level(20), 0);
        assert_eq!(options.handover_level(20), 0);
    }
}
