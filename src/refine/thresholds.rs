//! Every tuned number of the estimator, grouped by stage.
//!
//! Each constant says what it bounds and in which unit, what a higher value does, and what it was
//! chosen by: a row of the ablation, a test, a derivation, or "unknown". Sizes that follow from the
//! data layout (tile size, batch sizes) are no thresholds and stay with their code; numbers that a
//! user may want to change are options ([`crate::refine::RefineOptions`]).

/// Thresholds of `tracking/prescreening.rs`.
pub mod prescreening {
    // prescreening: begin

    // prescreening: end
}

/// Thresholds of `tracking/track.rs`.
pub mod tracking {
    // tracking: begin

    // tracking: end
}

/// Thresholds of `tracking/alternating_calibration.rs`.
pub mod alternating_calibration {
    // alternating_calibration: begin

    // alternating_calibration: end
}

/// Thresholds of `tracking/registration.rs`.
pub mod registration {
    // registration: begin

    // registration: end
}

/// Thresholds of `tracking/correlation_search.rs`.
pub mod correlation_search {
    // correlation_search: begin

    // correlation_search: end
}

/// Thresholds of `tracking/reference_mosaic.rs`.
pub mod reference_mosaic {
    // reference_mosaic: begin

    // reference_mosaic: end
}

/// Thresholds of `tracking/shading_correction.rs`.
pub mod shading_correction {
    // shading_correction: begin

    // shading_correction: end
}

/// Thresholds of `samples/footprints.rs`.
pub mod footprints {
    /// Largest distance in the sequence at which two frames are tested for overlap, frames.
    ///
    /// Higher: overlaps after more turns of a spiral are found, at more time and memory. Chosen by:
    /// unknown.
    pub const MAX_OVERLAP_DISTANCE_FRAMES: usize = 256;

    /// Largest distance along the tunnel at which a frame is compared, radii of a circle with the
    /// section's perimeter.
    ///
    /// Higher: frames that look along the tunnel keep more of their oblique wall. Chosen by:
    /// unknown.
    pub const MAX_REACH_RADII: f64 = 6.0;
}

/// Thresholds of `samples/visibility.rs`.
pub mod visibility {
    /// Least distance of a tile from the image's border and from masked pixels, pixels: room for
    /// the steps to come.
    ///
    /// Higher: larger steps stay inside the image, but less of its border is used. Chosen by:
    /// unknown.
    pub const MIN_BORDER_DISTANCE_PX: f64 = 1.0;

    /// Least area of a sample in a frame over that at the distance the lattice was laid out for.
    ///
    /// Higher: more oblique or distant tiles are excluded. Chosen by: unknown.
    pub const MIN_RELATIVE_SAMPLE_AREA: f64 = 0.05;
}

/// Thresholds of `samples/tile_coverage.rs`.
pub mod tile_coverage {
    /// Observations per stretch of the wall.
    ///
    /// Higher: more work for parallel threads at once, and more memory. Chosen by: unknown (work
    /// for all threads within little memory).
    pub const MAX_STRETCH_OBSERVATIONS: f64 = 1e6;

    /// Frames per stretch of the wall, apart from those that reach over from its neighbours.
    ///
    /// Higher: fewer stretches at coarse levels, and more memory. Chosen by: unknown.
    pub const MAX_STRETCH_FRAMES: f64 = 256.0;

    /// Observations whose visibility is kept from one linearisation to the next; further ones are
    /// computed anew each time.
    ///
    /// Higher: less time and more memory on long surveys. Chosen by: unknown.
    pub const MAX_KEPT_OBSERVATIONS: usize = 16_000_000;
}

/// Thresholds of `samples/outlier_mask.rs`.
pub mod outlier_mask {
    /// Excess of a misfit over the typical one, in spreads, from which a frame does not show the
    /// wall.
    ///
    /// Higher: fewer tiles are excluded. Chosen by: the test
    /// `a_glint_and_its_flanks_are_excluded_and_the_wall_is_not` bounds it; otherwise unknown.
    pub const MIN_OUTLIER_EXCESS: f32 = 5.0;

    /// Largest excess of a tile, in spreads, that counts in the test of its neighbourhood.
    ///
    /// Higher: a single bad tile excludes more of its neighbours. Chosen by: unknown.
    pub const MAX_NEIGHBOUR_EXCESS: f32 = 15.0;

    /// Least spread of the misfits R: frames differ in sharpness from tile to tile.
    ///
    /// Higher: fewer tiles are excluded on walls where the frames agree well. Chosen by: unknown.
    pub const MIN_MISFIT_SPREAD: f32 = 0.08;
}

/// Thresholds of `tiles/residual_weighting.rs`.
pub mod residual_weighting {
    /// Cutoff c of Tukey's biweight, standard deviations of the residual.
    ///
    /// Higher: less of the information in Gaussian noise is lost (2 % at 6), but outliers exert
    /// more force. Chosen by: unknown.
    pub const TUKEY_CUTOFF_SIGMAS: f32 = 6.0;

    /// Least σ of the noise model, grey levels.
    ///
    /// Higher: fewer residuals are rejected on images without noise. Chosen by: derivation:
    /// rounding to 8 bits gives 0.29, which the averaging of interpolation lowers.
    pub const MIN_SIGMA_GREY: f64 = 0.2;

    /// Least number of residuals in a gradient bin for it to enter the fit of the noise model.
    ///
    /// Higher: the fit is less noisy, but uses fewer of the steep bins. Chosen by: unknown.
    pub const MIN_RESIDUALS_PER_BIN: u64 = 100;
}

/// Thresholds of `tiles/tile.rs`.
pub mod tile {
    /// Steps of reweighting from the plain mean (or the median) to the robust texture.
    ///
    /// Higher: the texture is nearer to the minimiser under outliers, at more time per tile. Chosen
    /// by: unknown (the tests of the gradient against the cost pass with it).
    pub const REWEIGHTING_ITERATIONS: usize = 2;

    /// Number of frames from which on the second smallest gradient sets the variance of a sample
    /// instead of the smallest.
    ///
    /// Higher: the variance is lower where few frames observe the wall. Chosen by: unknown.
    pub const MIN_FRAMES_FOR_SECOND_SMALLEST_GRADIENT: usize = 4;
}

/// Thresholds of `problem/*.rs`.
pub mod photometric_problem {
    /// Least number of wall samples over the height of an image.
    ///
    /// Higher: coarse pyramid levels are sampled more densely, so that whole tiles use more of the
    /// images' borders, at more time. Chosen by: unknown.
    pub const MIN_SAMPLES_PER_IMAGE_HEIGHT: u32 = 90;

    /// Largest viewing distance for which the lattice is laid out, radii of the section.
    ///
    /// Higher: frames that look along the tunnel make the lattice coarser. Chosen by: unknown.
    pub const MAX_VIEWING_DISTANCE_RADII: f64 = 3.0;

    /// Largest log-gain of a feasible estimate, standard deviations of its prior.
    ///
    /// Higher: a frame that fits nowhere may lower its cost by a gain near 0, which amplifies
    /// rounding. Chosen by: unknown.
    pub const MAX_LOG_GAIN_SIGMAS: f64 = 10.0;

    /// Stiffness of the gauge constraint at the first compared frame over that of its pixels.
    ///
    /// Higher: rounding moves the frames less along the gauge, but the matrix is worse conditioned.
    /// Chosen by: unknown.
    pub const GAUGE_STIFFNESS_RATIO: f64 = 1e6;

    /// Number of tiles from which the noise and the typical misfit are estimated.
    ///
    /// Higher: better estimates at more time. Chosen by: unknown.
    pub const NOISE_ESTIMATION_TILES: usize = 600;

    /// Number of blocks of tiles that are solved for to estimate roughness and stiffness of the
    /// wall.
    ///
    /// Higher: better estimates at more time. Chosen by: unknown.
    pub const WALL_MODEL_BLOCKS: usize = 48;

    /// Least variance that detail finer than pixels adds to a pixel, over the variance of its
    /// noise, for the wall to be solved for jointly.
    ///
    /// Higher: fewer walls are solved for jointly. Chosen by: derivation: below it, less than a
    /// fortieth of the error is at stake. On bricks of 30 × 10 pixels the ratio is 1.1, 0.35 and
    /// 0.13 with noise of 1, 2 and 4 grey levels, on concrete 0.02 with 2.
    pub const MIN_ALIASED_VARIANCE_RATIO: f64 = 0.05;

    /// Largest factor by which the variance of the residuals may fall short of the sensor's;
    /// beyond, the sensor's is taken for fine texture and ignored.
    ///
    /// Higher: the noise of single images replaces that of the residuals more often. Chosen by:
    /// unknown.
    pub const MAX_NOISE_UNDERESTIMATE: f64 = 1.25;

    /// Random frequencies by which the information of an unknown texture is averaged.
    ///
    /// Higher: less Monte Carlo noise at more time. Chosen by: unknown.
    pub const RANDOM_FREQUENCIES: usize = 800;

    /// Random sets of sub-pixel positions for each of these frequencies.
    ///
    /// Higher: less Monte Carlo noise at more time. Chosen by: unknown.
    pub const RANDOM_POSITION_SETS: usize = 4;

    /// Largest number of frames that the information of an unknown texture is computed for.
    ///
    /// Higher: more time. Chosen by: beyond it the information hardly changes.
    pub const MAX_TEXTURE_FRAMES: usize = 24;
}

/// Thresholds of `joint/*.rs`.
pub mod joint {
    /// Samples per pixel along each axis of the wall that is solved for.
    ///
    /// Higher: sharper edges, more time and memory. Chosen by: unknown.
    pub const SAMPLES_PER_PIXEL: f64 = 3.0;

    /// Samples per pixel of the lattice on which outliers are detected before the joint solve.
    ///
    /// Higher: smaller outliers are found at more time. Chosen by: unknown.
    pub const OUTLIER_MASK_SAMPLES_PER_PIXEL: f64 = 2.0;

    /// Largest step that ends the joint solve, standard deviations of the estimates.
    ///
    /// Higher: fewer of its expensive steps. Chosen by: the step after one of this length is a
    /// tenth of it.
    pub const MAX_FINAL_STEP_SIGMA: f64 = 0.3;

    /// Conjugate-gradient iterations on the wall between two rounds of reweighting.
    ///
    /// Higher: the wall is nearer to the minimiser, at more time. Chosen by: unknown.
    pub const MAX_WALL_ITERATIONS: usize = 10;

    /// Rounds of reweighting of edges and pixels.
    ///
    /// Higher: sharper edges at more time. Chosen by: on bricks with noise of 2 grey levels, two
    /// rounds make the poses' squared error 14 % larger, and seven 4 % smaller.
    pub const REWEIGHTING_ROUNDS: usize = 4;

    /// Width of Huber's loss in the first round of reweighting, standard deviations.
    ///
    /// Higher: outliers distort the first wall more. Chosen by: unknown.
    pub const HUBER_WIDTH_SIGMAS: f32 = 2.0;

    /// Conjugate-gradient iterations for the response of the wall to the motion of a frame.
    ///
    /// Higher: a more exact stiffness at more time. Chosen by: unknown.
    pub const MAX_RESPONSE_ITERATIONS: usize = 20;

    /// Largest number of frames that is distinguished in the stiffness of the wall.
    ///
    /// Higher: finer classes, each from fewer tiles. Chosen by: on bricks the stiffness is constant
    /// from five frames on.
    pub const MAX_STIFFNESS_FRAMES: usize = 12;

    /// Least stiffness ratio.
    ///
    /// Higher: a wall of which hardly anything is known constrains frames more. Chosen by: unknown.
    pub const MIN_STIFFNESS_RATIO: f64 = 0.05;
}

/// Thresholds of `solver/gauss_newton.rs, solve_record.rs`.
pub mod gauss_newton {
    use std::ops::RangeInclusive;

    /// Share of the slope along a step, `δᵀ g`, that a step must remove if it does not lower the
    /// cost. Higher: fewer steps count as good. Chosen by: the strong Wolfe condition.
    pub const MIN_SLOPE_REDUCTION: f64 = 0.5;
    /// Share of the cost by which it may rise along a good step. Higher: more steps count as good.
    /// Chosen by: on sharp bricks the cost varies by up to 0.9 % while the whole survey moves along
    /// its gauge, which changes nothing.
    pub const MAX_COST_RISE: f64 = 0.01;
    /// First damping λ after a rejected step. Higher: the first damped step is shorter. Chosen by:
    /// unknown.
    pub const MIN_DAMPING: f64 = 1e-4;
    /// Factor from one damping to the next. Higher: fewer, coarser dampings are tried. Chosen by:
    /// Marquardt's original choice.
    pub const DAMPING_FACTOR: f64 = 10.0;
    /// Dampings tried before a step is given up. Higher: longer search for a step. Chosen by: unknown.
    pub const MAX_DAMPING_ITERATIONS: usize = 8;
    /// Plausible curvatures of a solve; others belong to solves that were still far from their end.
    /// Wider: curvatures of such solves count, too. Chosen by: unknown.
    pub const PLAUSIBLE_CURVATURES: RangeInclusive<f64> = 0.6..=1.2;
}

/// Thresholds of `solver/stopping.rs`.
pub mod stopping {
    /// Step at which a solve that another one follows ends, pixels of its level. Higher: fewer steps.
    /// Chosen by: unknown.
    pub const INTERMEDIATE_STEP_PX: f64 = 0.01;
    /// Step at which a solve that another one follows ends, multiples of the uncertainty. Higher:
    /// fewer steps. Chosen by: unknown.
    pub const INTERMEDIATE_STEP_SIGMA: f64 = 2.0;
}

/// Thresholds of `solver/neighbourhood.rs`.
pub mod neighbourhood {
    /// Frames on either side of a changed one that are solved again. Higher: more of the trajectory
    /// adapts, in more time. Chosen by: a wrong frame bends its neighbours over a few turns.
    pub const MAX_CHANGED_DISTANCE: usize = 64;
}

/// Thresholds of `validation/overlaps.rs`.
pub mod overlaps {
    // overlaps: begin

    // overlaps: end
}

/// Thresholds of `validation/pairwise_ncc.rs`.
pub mod pairwise_ncc {
    // pairwise_ncc: begin

    // pairwise_ncc: end
}

/// Thresholds of `validation/pairwise_lucas_kanade.rs`.
pub mod pairwise_lucas_kanade {
    // pairwise_lucas_kanade: begin

    // pairwise_lucas_kanade: end
}

/// Thresholds of `validation/inconsistent_frames.rs`.
pub mod inconsistent_frames {
    // inconsistent_frames: begin

    // inconsistent_frames: end
}

/// Thresholds of `validation/aliasing.rs`.
pub mod aliasing {
    // aliasing: begin

    // aliasing: end
}

/// Thresholds of `validation/repair.rs`.
pub mod repair {
    // repair: begin

    // repair: end
}

/// Thresholds of `uncertainty/observability.rs, solution_uncertainty.rs`.
pub mod observability {
    // observability: begin

    // observability: end
}

/// Thresholds of `uncertainty/overdispersion.rs`.
pub mod overdispersion {
    // overdispersion: begin

    // overdispersion: end
}

/// Thresholds of `uncertainty/rolling_shutter_test.rs`.
pub mod rolling_shutter_test {
    // rolling_shutter_test: begin

    // rolling_shutter_test: end
}

/// Thresholds of `pose_convention_search.rs`.
pub mod pose_convention_search {
    // pose_convention_search: begin

    // pose_convention_search: end
}

/// Thresholds of `stages/assess.rs, validate_pairs.rs`.
pub mod assessment {
    /// Share of a frame's pixels that must overlap other frames for its pose to count as photometric,
    /// 0 to 1. Higher: fewer frames are photometric. Chosen by: unknown.
    pub const MIN_PIXEL_SHARE: f64 = 0.02;
    /// Largest step left of a photometric pose, pixels on the wall. Higher: more frames are
    /// photometric. Chosen by: as [`MAX_SIGMA_PX`].
    pub const MAX_STEP_PX: f64 = 0.25;
    /// Largest step left of a photometric pose, multiples of σ, if that is more. Higher: more frames
    /// are photometric. Chosen by: 2 σ.
    pub const MAX_STEP_SIGMA: f64 = 2.0;
    /// Largest 1-σ on the wall of a photometric pose, pixels. Higher: more frames are photometric.
    /// Chosen by: twice that is half a pixel.
    pub const MAX_SIGMA_PX: f64 = 0.25;
    /// Pairwise comparisons of all frames, with rejected frames registered again between two, at the
    /// most. Higher: more attempts, in more time. Chosen by: unknown.
    pub const MAX_PAIR_ITERATIONS: usize = 3;
}
