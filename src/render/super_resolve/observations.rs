//! What the frames read of a region in one channel.

use super::footprints::Footprints;
use super::huber;
use crate::vectors::wide;

/// One channel of a view's frame.
#[derive(Clone, Copy, Debug)]
pub struct Channel<'a> {
    /// Values, row-major, grey levels of the wall (exposure and shading undone); NaN where there is none.
    pub values: &'a [f32],
    /// 1-σ of their noise, grey levels.
    pub noise: f32,
}

/// Noise is at least this, grey levels: rounding to 8 bits gives 0.29.
const LEAST_NOISE: f32 = 0.2;
/// Weight of pixels above which a fine pixel counts as seen: a pixel of two by two gives 0.25.
const SEEN: f32 = 0.05;

/// Pixels with their values; a pixel without one has a value of 0 with precision 0.
pub(super) struct Observations<'a> {
    footprints: &'a Footprints,
    views: Vec<Values>,
}

struct Values {
    /// y.
    values: Vec<f32>,
    /// `1/σ`, or 0.
    inverse_sigma: Vec<f32>,
    /// Precision with robust weight.
    omega: Vec<f32>,
}

impl<'a> Observations<'a> {
    pub fn new(footprints: &'a Footprints, channels: &[Channel]) -> Self {
        let pairs = footprints.views.iter().zip(channels);
        let views = pairs.map(|(stencils, channel)| {
            let read = stencils.pixels.iter().map(|p| channel.values[*p as usize]);
            let read: Vec<f32> = read.collect();
            let inverse = 1.0 / channel.noise.max(LEAST_NOISE);
            let known = |value: f32, of: &f32| if of.is_finite() { value } else { 0.0 };
            Values {
                inverse_sigma: read.iter().map(|y| known(inverse, y)).collect(),
                omega: read.iter().map(|y| known(inverse * inverse, y)).collect(),
                values: read.iter().map(|y| known(*y, y)).collect(),
            }
        });
        Self {
            footprints,
            views: views.collect(),
        }
    }

    /// Number of pixels with a value.
    pub fn count(&self) -> usize {
        let all = self.views.iter().flat_map(|view| &view.inverse_sigma);
        all.filter(|inverse| **inverse > 0.0).count()
    }

    /// True for every fine pixel that pixels with a value show.
    pub fn seen(&self) -> Vec<bool> {
        let mut weight = vec![0.0; self.footprints.region.pixels()];
        for (stencils, view) in self.footprints.views.iter().zip(&self.views) {
            let ones = view.inverse_sigma.iter();
            let ones: Vec<f32> = ones
                .map(|inverse| if *inverse > 0.0 { 1.0 } else { 0.0 })
                .collect();
            stencils.spread(&ones, &mut weight);
        }
        weight.into_iter().map(|weight| weight > SEEN).collect()
    }

    /// `Wᵀ Ω y`.
    pub fn right(&self) -> Vec<f32> {
        let mut right = vec![0.0; self.footprints.region.pixels()];
        for (stencils, view) in self.footprints.views.iter().zip(&self.views) {
            let weighted = view.omega.iter().zip(&view.values);
            let weighted: Vec<f32> = weighted.map(|(omega, y)| omega * y).collect();
            stencils.spread(&weighted, &mut right);
        }
        right
    }

    /// Adds `Wᵀ Ω W x` to y.
    pub fn add_to(&self, x: &[f32], y: &mut [f32]) {
        for (stencils, view) in self.footprints.views.iter().zip(&self.views) {
            wide(
                #[inline(always)]
                || stencils.add_normal(&view.omega, x, y),
            );
        }
    }

    /// Adds the diagonal of `Wᵀ Ω W` to y.
    pub fn add_diagonal(&self, y: &mut [f32]) {
        for (stencils, view) in self.footprints.views.iter().zip(&self.views) {
            stencils.add_diagonal(&view.omega, y);
        }
    }

    /// Weighs each pixel by what it reads of x: `Ω = ω/(σ² v)` with Huber's weight ω for residuals beyond `limit` of
    /// their own robust standard deviation. v is what they say of the noise over what was stated, if that is more than
    /// 1, where `free` is the share of the residuals that x is not fitted to.
    pub fn weigh(&mut self, x: &[f32], free: f32, limit: f32) {
        let residuals = self.residuals(x);
        let known = residuals.iter().flatten().copied().filter(|r| !r.is_nan());
        let sigma = huber::sigma(known).max(free.sqrt());
        let inflation = sigma * sigma / free;
        for (view, residuals) in self.views.iter_mut().zip(&residuals) {
            let pixels = view
                .omega
                .iter_mut()
                .zip(&view.inverse_sigma)
                .zip(residuals);
            for ((omega, inverse), residual) in pixels {
                if *inverse > 0.0 {
                    let weight = huber::weight(*residual, limit * sigma);
                    *omega = weight * inverse * inverse / inflation;
                }
            }
        }
    }

    /// `(y − W x)/σ` view by view; NaN for pixels without a value.
    fn residuals(&self, x: &[f32]) -> Vec<Vec<f32>> {
        let views = self.footprints.views.iter().zip(&self.views);
        views
            .map(|(stencils, view)| {
                let mut read = Vec::new();
                stencils.read(x, &mut read);
                let pixels = read.iter().zip(&view.values).zip(&view.inverse_sigma);
                pixels
                    .map(|((read, y), inverse)| {
                        if *inverse > 0.0 {
                            (y - read) * inverse
                        } else {
                            f32::NAN
                        }
                    })
                    .collect()
            })
            .collect()
    }
}
