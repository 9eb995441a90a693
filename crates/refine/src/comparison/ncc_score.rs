//! Normalised cross-correlation of two pictures of the wall, corrected for their noise.

use crate::thresholds::reference_mosaic::MIN_TEXTURE_SHARE;

/// Sums over the samples that two pictures of the wall share, from which their normalised
/// cross-correlation follows.
#[derive(Clone, Copy, Debug, Default)]
pub struct NccScore {
    /// Number of samples.
    pub samples: f64,
    xx: f64,
    yy: f64,
    xy: f64,
    noise_x: f64,
    noise_y: f64,
}

impl NccScore {
    /// Adds a sample: local contrast and the variance of its noise, of both pictures.
    #[inline]
    pub fn add(&mut self, (x, noise_x): (f32, f32), (y, noise_y): (f32, f32)) {
        let (x, y) = (f64::from(x), f64::from(y));
        self.samples += 1.0;
        self.xx += x * x;
        self.yy += y * y;
        self.xy += x * y;
        self.noise_x += f64::from(noise_x);
        self.noise_y += f64::from(noise_y);
    }

    /// The normalised cross-correlation c, −1 to 1, noise included.
    pub fn correlation(&self) -> f64 {
        self.xy / (self.xx * self.yy).sqrt().max(f64::MIN_POSITIVE)
    }

    /// The share of the contrast's variance that is texture and not noise, 0 to 1: the geometric
    /// mean of both pictures.
    pub fn texture_share(&self) -> f64 {
        let share = |all: f64, noise: f64| (1.0 - noise / all.max(f64::MIN_POSITIVE)).max(0.0);
        (share(self.xx, self.noise_x) * share(self.yy, self.noise_y)).sqrt()
    }

    /// The correlation corrected for noise: the normalised cross-correlation over the texture's
    /// share.
    ///
    /// It is about 1 where both pictures show the same wall, however noisy they are. None where
    /// noise drowns the texture.
    ///
    /// Source: C. Spearman, "The proof and measurement of association between two things", 1904
    /// (correction for attenuation).
    pub fn corrected_correlation(&self) -> Option<f64> {
        let texture = self.texture_share();
        (texture > MIN_TEXTURE_SHARE).then(|| (self.correlation() / texture).min(1.0))
    }
}
