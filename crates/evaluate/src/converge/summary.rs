//! Summary of a sweep, converge.json: statistics of the runs of each cell.

use crate::converge::majority_error::GOOD_PX;
use crate::converge::options::ConvergeOptions;
use crate::converge::run_record::{RunRecord, SCHEMA_VERSION};
use crate::converge::sweep_cell::SweepCell;
use crate::error_statistics::ErrorStatistics;
use serde::Serialize;
use tunnelstitch_refine::RefineOptions;

/// Result of a sweep, the content of converge.json.
#[derive(Clone, Debug, Serialize)]
pub struct Convergence {
    /// Version of the content, [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Name and version of the program.
    pub program: &'static str,
    /// Options of the sweep.
    pub options: ConvergeOptions,
    /// Options of the refinement.
    pub refine_options: RefineOptions,
    /// Limit of a good frame, [`GOOD_PX`].
    pub good_px: f64,
    /// Summaries of the cells, in the order of [`ConvergeOptions::cells`].
    pub cells: Vec<CellSummary>,
}

/// Statistics of the runs of a cell.
///
/// Errors are over the runs with a feasible survey. A run without poses, or with a frame that
/// misses the wall, has an infinite error; an infinite statistic is `None`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CellSummary {
    /// The cell.
    #[serde(flatten)]
    pub cell: SweepCell,
    /// Number of runs with a feasible survey.
    pub runs: usize,
    /// Number of runs in which every frame is good.
    pub successes: usize,
    /// Share of successful runs, 0–1; `None` without runs.
    pub success_rate: Option<f64>,
    /// Number of runs that the refinement refused.
    pub refused: usize,
    /// Number of frames, over all runs, flagged as photometric although they are not good.
    pub false_successes: usize,
    /// Number of frames, over all runs, flagged as anything but photometric.
    pub flagged_frames: usize,
    /// Median over the runs of their root mean square wall error, pixels.
    pub median_rms_px: Option<f64>,
    /// Median over the runs of their worst frame's wall error, pixels.
    pub median_worst_frame_px: Option<f64>,
    /// Wall error of the worst frame of all runs, pixels.
    pub worst_frame_px: Option<f64>,
    /// Number of infeasible draws.
    pub redraws: u64,
    /// Number of seeds without a feasible survey; they do not count as runs.
    pub infeasible_seeds: usize,
    /// Median duration of a refinement, seconds.
    pub median_seconds: Option<f64>,
}

impl CellSummary {
    /// Summarises the runs of a cell.
    pub fn of(cell: &SweepCell, runs: &[&RunRecord]) -> Self {
        let feasible: Vec<&RunRecord> = runs
            .iter()
            .copied()
            .filter(|run| run.seed_used.is_some())
            .collect();
        let successes = feasible.iter().filter(|run| run.success).count();
        let statistics = |value: fn(&RunRecord) -> Option<f64>| {
            let values: Vec<f64> = feasible
                .iter()
                .map(|run| value(run).unwrap_or(f64::INFINITY))
                .collect();
            ErrorStatistics::of(&values)
        };
        let finite = |value: f64| (!feasible.is_empty() && value.is_finite()).then_some(value);
        let worst_frame = statistics(|run| run.worst_frame_px);
        Self {
            cell: cell.clone(),
            runs: feasible.len(),
            successes,
            success_rate: (!feasible.is_empty()).then(|| successes as f64 / feasible.len() as f64),
            refused: feasible.iter().filter(|run| !run.refined).count(),
            false_successes: feasible.iter().map(|run| run.false_successes).sum(),
            flagged_frames: feasible.iter().map(|run| run.flagged_frames).sum(),
            median_rms_px: finite(statistics(|run| run.rms_px).median),
            median_worst_frame_px: finite(worst_frame.median),
            worst_frame_px: finite(worst_frame.max),
            redraws: runs.iter().map(|run| run.redraws).sum(),
            infeasible_seeds: runs.len() - feasible.len(),
            median_seconds: finite(statistics(|run| Some(run.seconds)).median),
        }
    }
}

impl Convergence {
    /// Combines the summaries of all cells.
    pub(super) fn new(options: &ConvergeOptions, cells: Vec<CellSummary>) -> Self {
        Self {
            schema_version: SCHEMA_VERSION,
            program: tunnelstitch_core::PROGRAM,
            options: options.clone(),
            refine_options: RefineOptions::default(),
            good_px: GOOD_PX,
            cells,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::converge::run_record::tests::record;

    #[test]
    fn runs_are_counted_by_their_outcome() {
        let good = record(8.0, 1);
        let lost = RunRecord {
            success: false,
            worst_frame_px: Some(90.0),
            rms_px: Some(20.0),
            good_frames: 20,
            flagged_frames: 3,
            false_successes: 1,
            redraws: 4,
            seed_used: Some(4002),
            seconds: 3.5,
            ..record(8.0, 2)
        };
        let refused = RunRecord {
            refined: false,
            error: Some("no overlap".to_owned()),
            success: false,
            worst_frame_px: None,
            rms_px: None,
            good_frames: 0,
            seconds: 0.1,
            ..record(8.0, 3)
        };
        let infeasible = RunRecord {
            seed_used: None,
            redraws: 1000,
            ..refused.clone()
        };
        let cell = good.cell.clone();
        let summary = CellSummary::of(&cell, &[&good, &lost, &refused, &infeasible]);
        assert_eq!(
            (summary.runs, summary.successes, summary.refused),
            (3, 1, 1)
        );
        assert_eq!(summary.success_rate, Some(1.0 / 3.0));
        assert_eq!((summary.redraws, summary.infeasible_seeds), (1004, 1));
        assert_eq!((summary.false_successes, summary.flagged_frames), (1, 3));
        assert_eq!(summary.median_worst_frame_px, Some(90.0));
        assert_eq!(summary.median_rms_px, Some(20.0));
        assert_eq!(summary.worst_frame_px, None);
        assert_eq!(summary.median_seconds, Some(1.5));
        let nothing = CellSummary::of(&cell, &[&infeasible]);
        assert_eq!((nothing.runs, nothing.success_rate), (0, None));
        assert_eq!(nothing.median_rms_px, None);
    }
}
