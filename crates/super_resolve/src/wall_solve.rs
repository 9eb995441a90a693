//! Least-squares solve for the fine pixels of a region, for given weights and roughness.

use crate::conjugate_gradients::conjugate_gradients;
use crate::footprints::Footprints;
use crate::observations::Observations;
use crate::reading::Reading;
use crate::roughness::{KINDS, Roughness};

/// Margin of a region around its tile, fine pixels.
pub const MARGIN: usize = 8;
/// Difference of fine pixels, in σ, beyond which Huber's loss is linear.
const EDGE_LIMIT_SIGMAS: f32 = 1.5;

/// Iteratively reweighted least-squares solve for the fine pixels x of a region.
pub struct WallSolve<'a> {
    pub(super) observations: Observations<'a>,
    pub(super) rough: Roughness,
    pub(super) seen: Vec<bool>,
    pub(super) x: Vec<f32>,
}

impl<'a> WallSolve<'a> {
    /// Starts from `start`, row-major, with NaN in its holes.
    ///
    /// `readings`: those of each view's pixels, in the order of [`Footprints::pixels`].
    /// `strengths`: roughness of the wall, grey levels⁻², from
    /// [`RoughnessEvidence::strengths`](super::RoughnessEvidence::strengths).
    ///
    /// # Panics
    /// If `start` does not have the region's size, or the numbers of readings and pixels differ.
    pub fn new(
        footprints: &'a Footprints,
        readings: &'a [Vec<Reading>],
        start: &[f32],
        strengths: [f64; KINDS],
    ) -> Self {
        let region = footprints.region;
        assert_eq!(start.len(), region.pixels(), "fine pixels to start from");
        assert!(
            footprints.views.len() == readings.len()
                && (footprints.views.iter().zip(readings)).all(|(v, r)| v.len() == r.len()),
            "a reading of every pixel"
        );
        let observations = Observations::new(footprints, readings);
        let seen = footprints.seen(readings);
        let mut rough = Roughness::new(region.columns, region.rows, &seen);
        rough.strengths = strengths;
        Self {
            observations,
            rough,
            seen,
            x: fill_holes(start),
        }
    }

    /// Improves x under the current weights by conjugate gradients.
    pub fn improve(&mut self, iterations: usize) {
        let right = self.observations.right();
        let mut x = std::mem::take(&mut self.x);
        self.solve(&right, iterations, &mut x);
        self.x = x;
    }

    /// Iterates x towards `A⁻¹ right`, with A the matrix of the normal equations.
    pub(super) fn solve(&self, right: &[f32], iterations: usize, x: &mut [f32]) {
        let mut diagonal = vec![0.0; x.len()];
        self.observations.add_diagonal(&mut diagonal);
        self.rough.add_diagonal(&mut diagonal);
        let mut scratch = vec![0.0; x.len()];
        let times = |x: &[f32], y: &mut [f32]| {
            y.fill(0.0);
            self.observations.add_to(x, y);
            self.rough.add_to(x, &mut scratch, y);
        };
        conjugate_gradients(times, &diagonal, right, iterations, x);
    }

    /// Computes the change of a view's predicted readings if its pixels change by `more`.
    ///
    /// It is `W A⁻¹ Wᵀ Ω more`, grey levels of the wall, with A the matrix of the normal equations.
    pub fn response(&self, view: usize, more: &[f32], iterations: usize) -> Vec<f32> {
        let mut right = vec![0.0; self.x.len()];
        let more = more.iter().copied();
        self.observations.add_right(view, more, &mut right);
        let mut change = vec![0.0; right.len()];
        self.solve(&right, iterations, &mut change);
        self.observations.footprints.read(view, &change)
    }

    /// Reweights each pixel by its residual `(y − W x)/σ`.
    pub fn reweight_pixels(&mut self, weight: impl Fn(f32) -> f32) {
        let residuals = self.observations.residuals(&self.x);
        self.observations.reweight(&residuals, weight);
    }

    /// Reweights each difference of fine pixels by Huber's loss, which preserves edges.
    pub fn reweight_edges(&mut self) {
        self.rough.reweight(&self.x, EDGE_LIMIT_SIGMAS);
    }

    /// The fine pixels, row-major; unseen ones are determined by smoothness alone.
    pub fn x(&self) -> &[f32] {
        &self.x
    }
}

/// Fills holes with the mean of the known values.
fn fill_holes(start: &[f32]) -> Vec<f32> {
    let known = || start.iter().copied().filter(|v| v.is_finite());
    let mean = known().sum::<f32>() / known().count().max(1) as f32;
    start
        .iter()
        .map(|v| if v.is_finite() { *v } else { mean })
        .collect()
}
