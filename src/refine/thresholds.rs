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

    /// Largest deficit of the log-posterior that a hypothesis may attain to that of the best one,
    /// nats, for it to be refined: log-posterior odds.
    ///
    /// The probability that a hypothesis is right whose log-posterior is Δ lower is no more than
    /// `exp(−Δ)`. The deficit is taken from the most that refinement can make of the hypothesis to
    /// the least that it makes of the best one, for the search underestimates both, in proportion to
    /// the samples.
    ///
    /// Higher: more hypotheses are refined, and fewer right ones are dismissed.
    ///
    /// Chosen by: derivation. `ln(10/0.001)`: with ten hypotheses, a right one is dismissed once
    /// in a thousand frames.
    pub const MAX_SCORE_DEFICIT_NATS: f64 = 9.2;

    /// Least gain in log-posterior, nats, for which another closer look is worth its time.
    ///
    /// Higher: fewer closer looks.
    ///
    /// Chosen by: derivation. Twice the gain that fitting the six unknowns of a pose to other noise
    /// brings follows χ² with six degrees of freedom (Wilks), whose mean is 6: a smaller gain is
    /// noise.
    pub const MIN_SCORE_GAIN_NATS: f64 = 3.0;

    // registration: end
}

/// Thresholds of `tracking/correlation_search.rs`.
pub mod correlation_search {
    // correlation_search: begin

    /// Share of its squared correlation that a right hypothesis keeps, at least, half a step of the
    /// search off.
    ///
    /// Higher: fewer hypotheses are refined, fewer aliases are looked at closer.
    ///
    /// Chosen by: derivation. With the autocorrelation `exp(−d²/2L²)` of the texture, `π L²` = 4
    /// samples (an independent piece), half a sample off along both axes (d² = 1/2) and half a step
    /// of roll off (one sample at the corners, d² = 1/3 in the mean) leave
    /// `exp(−d²/L²)` = 0.52 of it.
    pub const MIN_SQUARED_CORRELATION_LEFT: f64 = 0.5;

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
    // gauss_newton: begin

    // gauss_newton: end
}

/// Thresholds of `solver/stopping.rs`.
pub mod stopping {
    // stopping: begin

    // stopping: end
}

/// Thresholds of `solver/neighbourhood.rs`.
pub mod neighbourhood {
    // neighbourhood: begin

    // neighbourhood: end
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
    // assessment: begin

    // assessment: end
}
