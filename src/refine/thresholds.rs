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
    // footprints: begin

    // footprints: end
}

/// Thresholds of `samples/visibility.rs`.
pub mod visibility {
    // visibility: begin

    // visibility: end
}

/// Thresholds of `samples/tile_coverage.rs`.
pub mod tile_coverage {
    // tile_coverage: begin

    // tile_coverage: end
}

/// Thresholds of `samples/outlier_mask.rs`.
pub mod outlier_mask {
    // outlier_mask: begin

    // outlier_mask: end
}

/// Thresholds of `tiles/residual_weighting.rs`.
pub mod residual_weighting {
    // residual_weighting: begin

    // residual_weighting: end
}

/// Thresholds of `tiles/denoising.rs`.
pub mod denoising {
    // denoising: begin

    // denoising: end
}

/// Thresholds of `tiles/tile.rs`.
pub mod tile {
    // tile: begin

    // tile: end
}

/// Thresholds of `problem/*.rs`.
pub mod photometric_problem {
    // photometric_problem: begin

    // photometric_problem: end
}

/// Thresholds of `joint/*.rs`.
pub mod joint {
    // joint: begin

    // joint: end
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
