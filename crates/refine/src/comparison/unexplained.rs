//! Shares of a frame's variance that the wall, as other frames show it, leaves unexplained.

use crate::comparison::ncc_score::NccScore;
use crate::thresholds::registration::{MAX_UNEXPLAINED_RATIO, MIN_UNEXPLAINED};

/// Unexplained shares `1 − c²`, c a correlation; no less than
/// [`crate::thresholds::registration::MIN_UNEXPLAINED`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unexplained {
    /// Of the variance of the texture, c being corrected for noise. The least where noise drowns
    /// the texture: nothing speaks against the pose, and the covariance states how uncertain it is.
    pub texture: f64,
    /// Of the variance of the contrast, noise included.
    pub contrast: f64,
    /// True where noise drowns the texture.
    pub is_drowned: bool,
}

impl Unexplained {
    /// The shares by a normalised cross-correlation; None if the two share fewer than `min_samples`
    /// samples, or do not correlate.
    pub fn of(ncc_score: &NccScore, min_samples: f64) -> Option<Self> {
        let unexplained = |correlation: f64| (1.0 - correlation.powi(2)).max(MIN_UNEXPLAINED);
        let contrast = ncc_score.correlation();
        let texture = ncc_score.corrected_correlation();
        (ncc_score.samples >= min_samples && contrast > 0.0).then(|| Self {
            texture: unexplained(texture.unwrap_or(1.0)),
            contrast: unexplained(contrast),
            is_drowned: texture.is_none(),
        })
    }

    /// True if another pose, which leaves `other`, matches as well as this one for all that the
    /// pixels tell: by the texture, as far as noise leaves it, and by the contrast with its noise.
    pub fn is_matched_by(&self, other: &Self) -> bool {
        other.texture <= max_unexplained(self.texture)
            && other.contrast <= max_unexplained(self.contrast)
    }

    /// Least squared correlation c² of the contrast, noise included, at a pose that matches this
    /// one; `texture_share`: of the contrast's variance.
    pub fn min_squared_correlation(&self, texture_share: f64) -> f64 {
        let by_texture = (1.0 - max_unexplained(self.texture)) * texture_share.powi(2);
        by_texture.max(1.0 - max_unexplained(self.contrast))
    }

    /// True if the frame matches the wall as well as two right poses may differ, once for the
    /// frame's own pose and once for those that the wall is fused from.
    pub fn is_of_right_poses(&self) -> bool {
        self.texture <= MAX_UNEXPLAINED_RATIO * MAX_UNEXPLAINED_RATIO * MIN_UNEXPLAINED
    }

    /// Correlation c corrected for noise.
    pub fn correlation(&self) -> f64 {
        (1.0 - self.texture).sqrt()
    }
}

/// The unexplained share up to which a pose matches as well as one that leaves the share `present`.
///
/// It is bounded by odds: (1 − u)/u no less than 1/[`MAX_UNEXPLAINED_RATIO`] of that at the present
/// pose. Where little is explained there, a pose that explains nothing is no match, though it
/// leaves less than twice as much.
fn max_unexplained(present: f64) -> f64 {
    MAX_UNEXPLAINED_RATIO * present / (1.0 + (MAX_UNEXPLAINED_RATIO - 1.0) * present)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of two pictures that correlate by c, each with that share of noise in its variance.
    fn compared(c: f32, noise: f32) -> NccScore {
        let mut score = NccScore::default();
        let (sine, cosine) = (c, (1.0 - c * c).sqrt());
        for (a, b) in [(1.0f32, 1.0f32), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            score.add((a, noise), (sine * a + cosine * b, noise));
        }
        score
    }

    fn of(c: f32, noise: f32) -> Option<Unexplained> {
        Unexplained::of(&compared(c, noise), 4.0)
    }

    #[test]
    fn matches_have_at_least_half_the_odds() {
        let odds = |unexplained: f64| (1.0 - unexplained) / unexplained;
        for present in [0.05, 0.3, 0.9, 0.99] {
            let ratio = odds(max_unexplained(present)) / odds(present);
            let expected = 1.0 / MAX_UNEXPLAINED_RATIO;
            assert!((ratio - expected).abs() < 1e-9, "{present}: {ratio}");
        }
        assert!(max_unexplained(0.99) < 1.0);
    }

    #[test]
    fn shares_follow_from_the_correlation() {
        let found = of(0.6, 0.25).unwrap();
        assert!((found.contrast - 0.64).abs() < 1e-6, "{found:?}");
        assert!((found.texture - 0.36).abs() < 1e-6, "{found:?}");
        assert!((found.correlation() - 0.8).abs() < 1e-6);
        assert!(!found.is_of_right_poses());
        // A match that differs from a perfect one by noise alone is no worse.
        let perfect = of(0.75, 0.25).unwrap();
        assert_eq!(perfect.texture, MIN_UNEXPLAINED);
        assert!(perfect.is_of_right_poses());
        assert!(of(-0.1, 0.25).is_none());
        assert!(Unexplained::of(&compared(0.6, 0.25), 5.0).is_none());
    }

    /// By the contrast where noise drowns the texture; by the texture where its share is known.
    #[test]
    fn matches_are_told_by_texture_and_by_contrast() {
        let of = |c: f32, noise: f32| of(c, noise).unwrap();
        let drowned = of(0.3, 0.95);
        assert!(drowned.is_drowned);
        assert_eq!(drowned.texture, MIN_UNEXPLAINED);
        assert!(drowned.is_matched_by(&of(0.25, 0.95)));
        assert!(!drowned.is_matched_by(&of(0.15, 0.95)));
        let noisy = of(0.5, 0.5);
        assert!(!noisy.is_drowned);
        assert!(noisy.is_matched_by(&of(0.49, 0.5)));
        assert!(!noisy.is_matched_by(&of(0.4, 0.5)));
        let least = noisy.min_squared_correlation(0.5);
        assert!(least > 0.4f64.powi(2) && least < 0.49f64.powi(2), "{least}");
        assert!(drowned.min_squared_correlation(0.05) > 0.15f64.powi(2));
    }
}
