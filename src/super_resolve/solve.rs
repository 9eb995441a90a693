//! The most likely fine pixels, given what frames show of them and how rough the wall is.

use super::conjugate_gradients::conjugate_gradients;
use super::footprints::Footprints;
use super::observations::{Observations, Reading};
use super::roughness::{KINDS, Roughness};

/// Fine pixels on every side of a tile that its region should reach beyond it.
pub const MARGIN: usize = 8;
/// Huber's loss of a difference is linear beyond so many σ.
const EDGE: f32 = 1.5;

/// A solve for the fine pixels x of a region: least squares between rounds of reweighting.
pub struct WallSolve<'a> {
    pub(super) observations: Observations<'a>,
    pub(super) rough: Roughness,
    pub(super) seen: Vec<bool>,
    pub(super) x: Vec<f32>,
}

impl<'a> WallSolve<'a> {
    /// Begins at `start`, row-major, whose holes are NaN.
    ///
    /// `readings`: of the pixels of each view, in the order of [`Footprints::pixels`]; `strengths`:
    /// how rough the wall is, grey levels⁻² ([`super::Evidence::strengths`]).
    ///
    /// # Panics
    /// If `start` has not the region's size, or there are not as many readings as pixels.
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
            x: without_holes(start),
        }
    }

    /// Brings x closer to the minimum with the present weights, by steps of conjugate gradients.
    pub fn improve(&mut self, steps: usize) {
        let right = self.observations.right();
        let mut x = std::mem::take(&mut self.x);
        self.solve(&right, steps, &mut x);
        self.x = x;
    }

    /// Brings x closer to `A⁻¹ right`, A the matrix of the normal equations.
    pub(super) fn solve(&self, right: &[f32], steps: usize, x: &mut [f32]) {
        let mut diagonal = vec![0.0; x.len()];
        self.observations.add_diagonal(&mut diagonal);
        self.rough.add_diagonal(&mut diagonal);
        let mut scratch = vec![0.0; x.len()];
        let times = |x: &[f32], y: &mut [f32]| {
            y.fill(0.0);
            self.observations.add_to(x, y);
            self.rough.add_to(x, &mut scratch, y);
        };
        conjugate_gradients(times, &diagonal, right, steps, x);
    }

    /// How what a view's pixels read of x changes if they show `more` than they do, grey levels of
    /// the wall: `W A⁻¹ Wᵀ Ω more`, A the matrix of the normal equations.
    pub fn follow(&self, view: usize, more: &[f32], steps: usize) -> Vec<f32> {
        let mut right = vec![0.0; self.x.len()];
        let more = more.iter().copied();
        self.observations.add_right(view, more, &mut right);
        let mut change = vec![0.0; right.len()];
        self.solve(&right, steps, &mut change);
        self.observations.footprints.read(view, &change)
    }

    /// Weighs each pixel by its residual `(y − W x)/σ`.
    pub fn weigh_pixels(&mut self, weight: impl Fn(f32) -> f32) {
        let residuals = self.observations.residuals(&self.x);
        self.observations.weigh(&residuals, weight);
    }

    /// Weighs each difference of fine pixels by Huber's loss: where the wall has an edge, it may.
    pub fn weigh_edges(&mut self) {
        self.rough.weigh(&self.x, EDGE);
    }

    /// The fine pixels, row-major; what no pixel shows is nothing but smooth.
    pub fn x(&self) -> &[f32] {
        &self.x
    }
}

/// The values with the mean of what is known in their holes.
fn without_holes(start: &[f32]) -> Vec<f32> {
    let known = || start.iter().copied().filter(|v| v.is_finite());
    let mean = known().sum::<f32>() / known().count().max(1) as f32;
    start
        .iter()
        .map(|v| if v.is_finite() { *v } else { mean })
        .collect()
}
