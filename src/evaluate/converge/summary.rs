//! converge.json: the runs of each cell in a few numbers.

use super::{Cell, ConvergeOptions, GOOD_PX, RunRecord, SCHEMA_VERSION};
use crate::evaluate::Spread;
use crate::refine::RefineOptions;
use serde::Serialize;

/// The result of a sweep; also converge.json.
#[derive(Clone, Debug, Serialize)]
pub struct Convergence {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Name and version of the program.
    pub program: &'static str,
    /// What was swept.
    pub options: ConvergeOptions,
    /// Settings of the refinement.
    pub refine_options: RefineOptions,
    /// [`GOOD_PX`].
    pub good_px: f64,
    /// The cells, in the order of [`ConvergeOptions::cells`].
    pub cells: Vec<CellSummary>,
}

/// The runs of a cell in a few numbers.
///
/// Errors are over the runs that were flown; one without poses, or with a frame that has no place
/// on the wall, counts as infinitely wrong, and a number that is infinite for that is none.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CellSummary {
    /// The cell.
    #[serde(flatten)]
    pub cell: Cell,
    /// Surveys flown.
    pub runs: usize,
    /// Runs with every frame good.
    pub successes: usize,
    /// Their share, 0 to 1; none without runs.
    pub success_rate: Option<f64>,
    /// Runs that the refinement refused.
    pub refused: usize,
    /// Frames of all runs that the refinement called photometric and that are not good.
    pub false_successes: usize,
    /// Frames of all runs that the refinement called unsure.
    pub flagged_frames: usize,
    /// Median over the runs of their root mean square wall error, pixels.
    pub median_rms_px: Option<f64>,
    /// Median over the runs of their worst frame's wall error, pixels.
    pub median_worst_frame_px: Option<f64>,
    /// The worst frame of all runs, pixels.
    pub worst_frame_px: Option<f64>,
    /// Surveys drawn that nobody could fly.
    pub redraws: u64,
    /// Seeds without any survey that could be flown; they are no runs.
    pub unflyable: usize,
    /// Median time of a refinement, seconds.
    pub median_seconds: Option<f64>,
}

impl CellSummary {
    /// Sums up the runs of a cell.
    pub fn of(cell: &Cell, runs: &[&RunRecord]) -> Self {
        let flown: Vec<&RunRecord> = runs
            .iter()
            .copied()
            .filter(|run| run.seed_used.is_some())
            .collect();
        let successes = flown.iter().filter(|run| run.success).count();
        let spread = |value: fn(&RunRecord) -> Option<f64>| {
            let values: Vec<f64> = flown
                .iter()
                .map(|run| value(run).unwrap_or(f64::INFINITY))
                .collect();
            Spread::of(&values)
        };
        let finite = |value: f64| (!flown.is_empty() && value.is_finite()).then_some(value);
        let worst_frame = spread(|run| run.worst_frame_px);
        Self {
            cell: cell.clone(),
            runs: flown.len(),
            successes,
            success_rate: (!flown.is_empty()).then(|| successes as f64 / flown.len() as f64),
            refused: flown.iter().filter(|run| !run.refined).count(),
            false_successes: flown.iter().map(|run| run.false_successes).sum(),
            flagged_frames: flown.iter().map(|run| run.flagged_frames).sum(),
            median_rms_px: finite(spread(|run| run.rms_px).median),
            median_worst_frame_px: finite(worst_frame.median),
            worst_frame_px: finite(worst_frame.max),
            redraws: runs.iter().map(|run| run.redraws).sum(),
            unflyable: runs.len() - flown.len(),
            median_seconds: finite(spread(|run| Some(run.seconds)).median),
        }
    }
}

impl Convergence {
    /// Puts the cells of a sweep together.
    pub(super) fn new(options: &ConvergeOptions, cells: Vec<CellSummary>) -> Self {
        Self {
            schema_version: SCHEMA_VERSION,
            program: crate::PROGRAM,
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
    use crate::evaluate::converge::run_record::tests::record;

    #[test]
    fn runs_are_counted_by_what_became_of_them() {
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
        let unflyable = RunRecord {
            seed_used: None,
            redraws: 1000,
            ..refused.clone()
        };
        let cell = good.cell.clone();
        let summary = CellSummary::of(&cell, &[&good, &lost, &refused, &unflyable]);
        assert_eq!(
            (summary.runs, summary.successes, summary.refused),
            (3, 1, 1)
        );
        assert_eq!(summary.success_rate, Some(1.0 / 3.0));
        assert_eq!((summary.redraws, summary.unflyable), (1004, 1));
        assert_eq!((summary.false_successes, summary.flagged_frames), (1, 3));
        assert_eq!(summary.median_worst_frame_px, Some(90.0));
        assert_eq!(summary.median_rms_px, Some(20.0));
        assert_eq!(summary.worst_frame_px, None);
        assert_eq!(summary.median_seconds, Some(1.5));
        let nothing = CellSummary::of(&cell, &[&unflyable]);
        assert_eq!((nothing.runs, nothing.success_rate), (0, None));
        assert_eq!(nothing.median_rms_px, None);
    }
}
