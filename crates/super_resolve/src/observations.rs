//! Observations of a region: pixel readings with robust weights.

use crate::footprints::Footprints;
use crate::reading::Reading;
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;

/// Readings of all views with their footprints and weights.
pub(super) struct Observations<'a> {
    pub footprints: &'a Footprints,
    readings: &'a [Vec<Reading>],
    /// Precisions Ω with robust weights, view by view.
    omega: Vec<Vec<f32>>,
}

impl<'a> Observations<'a> {
    /// Observations with weights equal to the precisions `1/σ²`.
    pub fn new(footprints: &'a Footprints, readings: &'a [Vec<Reading>]) -> Self {
        let precisions = readings.iter().map(|readings| {
            let squares = readings.iter().map(|r| r.inverse_sigma * r.inverse_sigma);
            squares.collect()
        });
        Self {
            footprints,
            readings,
            omega: precisions.collect(),
        }
    }

    /// Number of valid pixels.
    pub fn count(&self) -> usize {
        let all = self.readings.iter().flatten();
        all.filter(|reading| reading.inverse_sigma > 0.0).count()
    }

    /// Computes the right-hand side `Wᵀ Ω y`.
    pub fn right(&self) -> Vec<f32> {
        let mut right = vec![0.0; self.footprints.region.pixels()];
        for (view, readings) in self.readings.iter().enumerate() {
            self.add_right(view, readings.iter().map(|r| r.value), &mut right);
        }
        right
    }

    /// Adds `Wᵀ Ω v` for values v of one view's pixels.
    pub fn add_right(&self, view: usize, values: impl Iterator<Item = f32>, right: &mut [f32]) {
        let weighted = self.omega[view].iter().zip(values);
        let weighted: Vec<f32> = weighted.map(|(omega, v)| omega * v).collect();
        self.footprints.views[view].spread(&weighted, right);
    }

    /// Adds `Wᵀ Ω W x` to y.
    pub fn add_to(&self, x: &[f32], y: &mut [f32]) {
        for (stencils, omega) in self.footprints.views.iter().zip(&self.omega) {
            dispatch_simd(
                #[inline(always)]
                || stencils.add_normal(omega, x, y),
            );
        }
    }

    /// Adds the diagonal of `Wᵀ Ω W` to y.
    pub fn add_diagonal(&self, y: &mut [f32]) {
        for (stencils, omega) in self.footprints.views.iter().zip(&self.omega) {
            stencils.add_diagonal(omega, y);
        }
    }

    /// Reweights each pixel by its residual: `Ω = weight((y − W x)/σ)/σ²`.
    pub fn reweight(&mut self, residuals: &[Vec<f32>], weight: impl Fn(f32) -> f32) {
        let views = self.omega.iter_mut().zip(self.readings);
        for ((omega, readings), residuals) in views.zip(residuals) {
            for ((omega, reading), residual) in omega.iter_mut().zip(readings).zip(residuals) {
                *omega = weight(*residual) * reading.inverse_sigma * reading.inverse_sigma;
            }
        }
    }

    /// Computes normalised residuals `(y − W x)/σ` view by view; 0 for invalid pixels.
    pub fn residuals(&self, x: &[f32]) -> Vec<Vec<f32>> {
        let views = self.footprints.views.iter().zip(self.readings);
        views
            .map(|(stencils, readings)| {
                let mut read = Vec::new();
                stencils.read(x, &mut read);
                let pixels = read.iter().zip(readings);
                pixels
                    .map(|(read, reading)| (reading.value - read) * reading.inverse_sigma)
                    .collect()
            })
            .collect()
    }

    /// The residuals of valid pixels.
    pub fn valid<'r>(&'r self, residuals: &'r [Vec<f32>]) -> impl Iterator<Item = f32> + 'r {
        let all = self
            .readings
            .iter()
            .flatten()
            .zip(residuals.iter().flatten());
        all.filter(|(reading, _)| reading.inverse_sigma > 0.0)
            .map(|(_, residual)| *residual)
    }
}
