//! Every tuned number of the estimator, grouped by stage.
//!
//! Each constant says what it bounds and in which unit, what a higher value does, and what it was
//! chosen by: a row of the ablation, a test, or "unknown". Numbers that follow from others, with
//! their derivation, and sizes that follow from the data layout, the memory or the number of random
//! samples (tile size, batch sizes) are no thresholds and stay with their code; numbers that a user
//! may want to change are options ([`crate::RefineOptions`]).

/// Thresholds of `tracking/prescreening.rs`.
pub mod prescreening {
    /// Standard deviation of the grey values at the coarsest level below which a frame shows
    /// nothing, grey levels.
    ///
    /// Higher: more frames are rejected.
    ///
    /// Chosen by: rounding to whole grey levels, `1/√12`.
    pub const MIN_CONTRAST_GREY: f64 = 0.29;

    /// Root mean square difference at the coarsest level below which two frames are the same
    /// picture, grey levels.
    ///
    /// Higher: more frames are rejected as repeated.
    ///
    /// Chosen by: unknown.
    pub const MAX_REPEAT_DIFFERENCE_GREY: f64 = 0.1;
}

/// Thresholds of `stages/solve.rs`.
pub mod last_solve {
    /// Share of noise in the energy of the texture's slopes above which the last solve is tried in
    /// pixels of twice the size.
    ///
    /// Higher: faint walls are solved in finer pixels, where steps wander. Lower: the tries take
    /// more time.
    ///
    /// Chosen by: slopes are mostly noise.
    pub const MAX_SLOPE_NOISE: f64 = 0.5;
}

/// Thresholds of `points/wall_points.rs`.
pub mod wall_points {
    /// Measured points that are kept of a cell of the wall, whose side is a 64th of the perimeter.
    ///
    /// Higher: points weigh more beside the pixels, and the fit takes more time.
    ///
    /// Chosen by: neighbouring points of a scan err together, so that more of them tell hardly
    /// more; 16 are four in every direction.
    pub const MAX_POINTS_PER_CELL: usize = 16;

    /// Distance of a point from the nominal wall beyond which it is not of the wall, of the
    /// distance of the wall from the axis.
    ///
    /// Higher: a tunnel may bend more without a centreline; more equipment is left to the outliers.
    ///
    /// Chosen by: linings deviate by a hundredth; what bends by more needs its centreline.
    pub const MAX_OFF_WALL_SHARE: f64 = 0.25;
}

/// Thresholds of `tracking/*.rs`.
pub mod tracking {
    /// Number of frames in a long window, and of those around a changed frame that are solved
    /// again.
    ///
    /// Higher: less bend is left over several turns, in more time.
    ///
    /// Chosen by: unknown.
    pub const LONG_WINDOW_FRAMES: usize = 160;

    /// Number of frames that do not match the others as right ones do, from the beginning, after
    /// which no others are tried.
    ///
    /// Higher: surveys that cannot be refined take longer.
    ///
    /// Chosen by: three turns of 120°: a wrong frame spoils its neighbours within a turn.
    pub const MAX_FAILURES: usize = 12;

    /// 1-σ of the place of a registered frame over that of a step, by which the cameras of a rig
    /// are placed from each other before all frames are solved together.
    ///
    /// Higher: cameras of a rig are searched for farther, in more time.
    ///
    /// Chosen by: simulated rigs of two and three cameras.
    pub const REGISTERED_SHARE: f64 = 0.25;

    /// The oldest of so many equal parts of a window is held.
    ///
    /// Higher: fewer frames are held, and the window is tied more loosely to the frames before it.
    ///
    /// Chosen by: a prototype whose windows held the oldest third and stayed bounded.
    pub const WINDOW_HELD_DIVISOR: usize = 3;

    /// Number of times that a part of tracking is repeated until it settles: all frames with a new
    /// camera, the first frames with a new shading, the correction of the shading.
    ///
    /// Higher: a camera that is farther off can be estimated, in more time.
    ///
    /// Chosen by: unknown.
    pub const MAX_TRACKING_ITERATIONS: usize = 5;

    /// Number of Gauss–Newton iterations in which a single frame or a window is solved for at one
    /// level.
    ///
    /// Higher: they converge further, in more time. Poses in the basin of an alias then get all the
    /// way into it.
    ///
    /// Chosen by: a sweep of `converge` over tiled bricks with 6° of rotation. With 6 or 8 and
    /// [`STEP_TOLERANCE_PX`] 0.2, and with 20 and a tenth of it, frames more are misregistered.
    pub const MAX_SOLVE_ITERATIONS: u64 = 12;

    /// Step length below which a single frame or a window has converged, pixels of full size; the
    /// global solve does the rest.
    ///
    /// Higher: they stop earlier, and the global solve has more to do.
    ///
    /// Chosen by: as [`MAX_SOLVE_ITERATIONS`].
    pub const STEP_TOLERANCE_PX: f64 = 0.1;
}

/// Thresholds of `tracking/alternating_calibration.rs`.
pub mod alternating_calibration {
    /// Relative change of the shading below which frames need not be tracked again.
    ///
    /// Higher: the first frames are tracked fewer times.
    ///
    /// Chosen by: unknown.
    pub const MAX_SHADING_CHANGE: f64 = 0.01;

    /// Ratio of a change of the shading to the smallest before it from which on it does not settle.
    ///
    /// Higher: more rounds are made in a light that is no common shading.
    ///
    /// Chosen by: a change that is not even halved takes more rounds than there are.
    pub const MAX_CHANGE_RATIO: f64 = 0.5;
}

/// Thresholds of `tracking/registration.rs` and `tracking/candidate.rs`.
pub mod registration {
    /// Number of hypotheses of a frame's pose that are refined.
    ///
    /// Higher: fewer right poses are missed on repetitive walls, in more time.
    ///
    /// Chosen by: unknown.
    pub const MAX_HYPOTHESES: usize = 10;

    /// Mean number of hypotheses that are refined for a frame, at the most.
    ///
    /// Higher: fewer right poses are missed on repetitive walls, and surveys that cannot be refined
    /// take longer.
    ///
    /// Chosen by: 48 frames of brick need 1.2 each, of concrete 3.4.
    pub const MEAN_HYPOTHESES: usize = 6;

    /// Correlation with the reference mosaic, corrected for noise, that a registered frame must
    /// reach.
    ///
    /// Higher: more frames are rejected.
    ///
    /// Chosen by: unknown.
    pub const MIN_CORRELATION: f64 = 0.5;

    /// Share `1 − c²` of the texture's variance that even the right pose leaves unexplained: blur,
    /// interpolation.
    ///
    /// Higher: good matches differ less from each other, so the prior decides more often.
    ///
    /// Chosen by: unknown.
    pub const MIN_UNEXPLAINED: f64 = 0.05;

    /// Ratio of the unexplained shares `1 − c²` of two poses up to which the pixels do not tell
    /// them apart.
    ///
    /// Higher: more frames are left to the prior, or are ambiguous.
    ///
    /// Chosen by: unknown.
    pub const MAX_UNEXPLAINED_RATIO: f64 = 2.0;
}

/// Thresholds of `tracking/correlation_search.rs`.
pub mod correlation_search {
    /// Number ν of samples that share one independent piece of texture.
    ///
    /// Higher: the pixels weigh less against the prior.
    ///
    /// Chosen by: unknown.
    pub const SAMPLES_PER_INDEPENDENT_PIECE: f64 = 4.0;

    /// Share of the frame's pixels that must have a value and lie on known wall.
    ///
    /// Higher: more frames with little overlap are rejected.
    ///
    /// Chosen by: unknown.
    pub const MIN_OVERLAP_SHARE: f64 = 0.08;

    /// Step between pitch hypotheses, radians; shifts along the tunnel make up for what lies
    /// between.
    ///
    /// Higher: a coarser search, which misses more poses, in less time.
    ///
    /// Chosen by: unknown.
    pub const PITCH_STEP_RAD: f64 = 0.12;
}

/// Thresholds of `comparison/ncc_score.rs`.
pub mod reference_mosaic {
    /// Share of the contrast's variance that must be texture for a correlation to be corrected for
    /// noise.
    ///
    /// Higher: more pairs are too noisy to compare.
    ///
    /// Chosen by: unknown.
    pub const MIN_TEXTURE_SHARE: f64 = 0.2;
}

/// Thresholds of `samples/footprints.rs`.
pub mod footprints {
    /// Largest distance in the sequence at which two frames are tested for overlap, frames.
    ///
    /// Higher: overlaps after more turns of a spiral are found, at more time and memory. Chosen by:
    /// unknown.
    pub const MAX_OVERLAP_DISTANCE_FRAMES: usize = 256;
}

/// Thresholds of `samples/visibility.rs`.
pub mod visibility {
    /// Least area of a tile's sample in a frame over that in the frame that sees the tile best.
    /// Where a frame resolves less it is blurred against the others, and differences are no noise.
    ///
    /// Higher: frames along the tunnel are compared with fewer others. Chosen by: a camera that
    /// looks along the tunnel, whose frames disagree half as much at 0.15 to 0.25 as at 0.05.
    pub const MIN_RELATIVE_SHARPNESS: f32 = 0.2;
}

/// Thresholds of `samples/outlier_mask.rs`.
pub mod outlier_mask {
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
}

/// Thresholds of `tiles/tile.rs`.
pub mod tile {
    /// Steps of reweighting from the plain mean (or the median) to the robust texture.
    ///
    /// Higher: the texture is nearer to the minimiser under outliers, at more time per tile. Chosen
    /// by: unknown (the tests of the gradient against the cost pass with it).
    pub const REWEIGHTING_ITERATIONS: usize = 2;
}

/// Thresholds of `problem/*.rs`.
pub mod photometric_problem {
    /// Largest factor by which the variance of the residuals may fall short of the sensor's;
    /// beyond, the sensor's is taken for fine texture and ignored.
    ///
    /// Higher: the noise of single images replaces that of the residuals more often. Chosen by:
    /// unknown.
    pub const MAX_NOISE_UNDERESTIMATE: f64 = 1.25;
}

/// Thresholds of `joint/*.rs`.
pub mod joint {
    /// Samples per pixel along each axis of the wall that is solved for.
    ///
    /// Higher: sharper edges, more time and memory. Chosen by: unknown.
    pub const SAMPLES_PER_PIXEL: f64 = 3.0;
}

/// Thresholds of `solver/gauss_newton.rs`.
pub mod gauss_newton {
    /// Share of the slope along a step, `δᵀ g`, that a step must remove if it does not lower the
    /// cost. Higher: fewer steps count as good. Chosen by: the strong Wolfe condition.
    pub const MIN_SLOPE_REDUCTION: f64 = 0.5;
    /// Share of the cost by which it may rise along a good step. Higher: more steps count as good.
    /// Chosen by: on sharp bricks the cost varies by up to 0.9 % while the whole survey moves along
    /// its gauge, which changes nothing.
    pub const MAX_COST_RISE: f64 = 0.01;
}

/// Thresholds of `solver/stopping.rs`.
pub mod stopping {
    /// Step at which a solve that another one follows ends, pixels of its level. Higher: fewer
    /// steps. Chosen by: unknown.
    pub const INTERMEDIATE_STEP_PX: f64 = 0.01;
    /// Step at which a solve that another one follows ends, multiples of the uncertainty. Higher:
    /// fewer steps. Chosen by: unknown.
    pub const INTERMEDIATE_STEP_SIGMA: f64 = 2.0;
}

/// Thresholds of `comparison/pairwise_ncc.rs` and `comparison/blurred_frames.rs`.
pub mod pairwise_ncc {
    /// Half width of the window of local contrast in the coarse comparison, pixels of the level.
    ///
    /// Higher: larger structures are compared.
    ///
    /// Chosen by: a window that holds a brick or two.
    pub const COARSE_WINDOW_PX: usize = 6;

    /// Half width of the window of local contrast in the fine comparison, pixels of the level.
    ///
    /// Higher: larger structures are compared.
    ///
    /// Chosen by: unknown.
    pub const FINE_WINDOW_PX: usize = 3;

    /// Pyramid level of the fine comparison.
    ///
    /// Higher: less noise, and less fine detail.
    ///
    /// Chosen by: small against a brick's edge, and half the noise of full size.
    pub const FINE_LEVEL: usize = 1;

    /// Distance between samples along each axis, pixels of the level.
    ///
    /// Higher: fewer samples, in less time.
    ///
    /// Chosen by: unknown.
    pub const STRIDE_PX: f64 = 4.0;

    /// Correlation, corrected for noise, below which two frames contradict each other.
    ///
    /// Higher: more pairs contradict, and more frames are rejected.
    ///
    /// Chosen by: the tests `frames_at_true_poses_correlate` (above 0.8) and
    /// `frame_displaced_by_a_brick_contradicts_the_others`.
    pub const MIN_CORRELATION: f64 = 0.6;

    /// Share of the samples that must be left without what stands out of the wall, for the rest to
    /// vouch for the pair.
    ///
    /// Higher: fewer pairs vouch for their frames.
    ///
    /// Chosen by: unknown.
    pub const MIN_SHARE_WITHOUT_OUTLIERS: f64 = 0.5;

    /// Ratio of a frame's variance of fine detail to that of its median partner below which it is
    /// blurred.
    ///
    /// Higher: more frames are rejected as blurred.
    ///
    /// Chosen by: unknown.
    pub const MIN_SHARPNESS_RATIO: f64 = 0.5;
}

/// Thresholds of `comparison/inconsistent_frames.rs`.
pub mod inconsistent_frames {
    /// Share of a frame's samples in contradicting pairs up to which it is kept.
    ///
    /// Higher: fewer frames are rejected.
    ///
    /// Chosen by: unknown.
    pub const MAX_CONTRADICTING_SHARE: f64 = 0.15;

    /// 1-σ up to which the relation of two cameras of a rig connects their frames, pixels of full
    /// size.
    ///
    /// Higher: fewer frames are disconnected.
    ///
    /// Chosen by: unknown.
    pub const MAX_RELATION_SIGMA_PX: f64 = 1.0;
}

/// Thresholds of `validation/disagreement.rs`.
pub mod disagreement {
    /// Share of a frame's weight that the robust loss may reject. Things before the wall, glints
    /// and oblique views cost a right frame some; whether its pose is right is decided by its
    /// comparison with others.
    ///
    /// Higher: fewer frames are rejected.
    ///
    /// Chosen by: unknown.
    pub const MAX_REJECTED_SHARE: f64 = 0.3;
}

/// Thresholds of `validation/aliasing.rs`, `validation/alias_choice.rs` and
/// `validation/alias_search.rs`.
pub mod aliasing {
    /// Difference of two periods, as a share of one of them, below which they are the same.
    ///
    /// Higher: fewer periods are told apart.
    ///
    /// Chosen by: unknown.
    pub const MAX_PERIOD_DIFFERENCE: f64 = 0.1;

    /// Number of times that frames with aliases are moved at the most.
    ///
    /// Higher: fewer frames remain undecided, in more time.
    ///
    /// Chosen by: unknown.
    pub const MAX_ITERATIONS: usize = 8;
}

/// Thresholds of `samples/hidden_bands.rs`.
pub mod hidden_bands {
    /// Least width of a band along the tunnel that is left out as a whole, radians.
    ///
    /// Higher: wider ones are left to the outlier mask, tile by tile.
    ///
    /// Chosen by: half of a usual field of view. Beside narrower ones every frame shows wall.
    pub const MIN_WIDTH_RAD: f64 = std::f64::consts::FRAC_PI_6;

    /// Shares of a column's tiles that are hidden: from which on it belongs to a band beside it,
    /// and from which on there is one.
    ///
    /// Higher: bands end earlier at their edges; fewer bands are found.
    ///
    /// Chosen by: without any band the share is some hundredths, up to a half in pictures along the
    /// tunnel; at a mirror's edge a seventh, within it 0.7 to 1.
    pub const HIDDEN_SHARES: [f64; 2] = [0.1, 0.7];
}

/// Thresholds of `uncertainty/observability.rs` and `uncertainty/solution_uncertainty.rs`.
pub mod observability {
    /// Posterior σ of a shared parameter over that of its prior up to which it is observed.
    ///
    /// Higher: more parameters are estimated, on less evidence.
    ///
    /// Chosen by: unknown.
    pub const MAX_SIGMA_SHARE: f64 = 0.5;

    /// Share of frames that fit nowhere up to which shared parameters are estimated: beyond it the
    /// others may fit each other in wrong places.
    ///
    /// Higher: self-calibration of worse surveys.
    ///
    /// Chosen by: unknown.
    pub const MAX_MISFIT_SHARE: f64 = 0.1;
}

/// Thresholds of `verdict/prior_test.rs`.
pub mod prior_test {
    /// 1-σ of the factor by which lengths of odometers and plans are usually wrong.
    ///
    /// Higher: larger errors of the radius or of units go unnoticed.
    ///
    /// Chosen by: wheels and cable counters in sewers slip by some per cent.
    pub const SCALE_SIGMA: f64 = 0.05;

    /// Ratio of a σ of the prior to the one that fits, beyond which it is reported.
    ///
    /// Higher: σ that are farther off go unnoticed.
    ///
    /// Chosen by: results hardly change for smaller ones; with 24 frames, three times too much or
    /// too little is found.
    pub const MAX_SIGMA_RATIO: f64 = 1.5;
}

/// Thresholds of `uncertainty/rolling_shutter_test.rs`.
pub mod rolling_shutter_test {
    /// Difference from the readout time given that is systematic, σ.
    ///
    /// Higher: fewer wrong times are reported.
    ///
    /// Chosen by: unknown.
    pub const MIN_DIFFERENCE_SIGMA: f64 = 6.0;
}

/// Thresholds of `stages/assess.rs, validate_pairs.rs`.
pub mod assessment {
    /// Share of a frame's pixels that must overlap other frames for its pose to count as
    /// photometric, 0 to 1. Higher: fewer frames are photometric. Chosen by: unknown.
    pub const MIN_PIXEL_SHARE: f64 = 0.03;
    /// Pairwise comparisons of all frames, with rejected frames registered again between two, at
    /// the most. Higher: more attempts, in more time. Chosen by: unknown.
    pub const MAX_PAIR_ITERATIONS: usize = 3;
}
