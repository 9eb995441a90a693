//! Random draw of a feasible survey: true poses inside the tunnel that look at its wall.

use crate::converge::error::ConvergeError;
use crate::converge::options::{ConvergeOptions, MAX_SEEDS};
use crate::converge::sweep_cell::SweepCell;
use tunnelstitch_simulate::{Scene, SimulateError, SimulateOptions};

/// Maximum draws after the first.
const MAX_REDRAWS: u64 = 1000;
/// Difference between the seeds of consecutive draws; a sweep has no more seeds than this.
const SEED_STEP: u64 = MAX_SEEDS;

/// Drawn survey of a cell.
pub(super) struct SurveyDraw {
    /// The survey with the seed of its draw; `None` if no draw is feasible.
    pub survey: Option<SimulateOptions>,
    /// Number of infeasible draws before it.
    pub redraws: u64,
}

/// Draws surveys with the seeds `seed + 1000 k`, k = 0, 1, …, until one is feasible.
///
/// Rejecting infeasible draws biases the noise towards smaller errors, the more so the larger its
/// sigma; the number of redraws measures that bias.
///
/// # Errors
/// [`ConvergeError::Simulate`] if the survey is impossible even without noise.
pub(super) fn draw_survey(
    options: &ConvergeOptions,
    cell: &SweepCell,
    seed: u64,
) -> Result<SurveyDraw, ConvergeError> {
    let planned = SimulateOptions {
        jitter: None,
        ..options.survey(cell, seed)
    };
    Scene::new(&planned)?;
    for redraws in 0..=MAX_REDRAWS {
        let survey = options.survey(cell, seed + SEED_STEP * redraws);
        match Scene::new(&survey) {
            Ok(_) => {
                return Ok(SurveyDraw {
                    survey: Some(survey),
                    redraws,
                });
            }
            // The plan itself is possible, so an impossible option is due to this draw: it sees
            // more wall than fits into memory.
            Err(
                SimulateError::CameraOutside { .. }
                | SimulateError::LooksAlongTheAxis { .. }
                | SimulateError::Option { .. },
            ) => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(SurveyDraw {
        survey: None,
        redraws: MAX_REDRAWS,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::converge::sweep_cell::SweepWall;
    use tunnelstitch_geometry::trajectory::JitterModel;

    fn drawn(rotation_deg: f64, translation_scale: f64, frames: usize) -> SurveyDraw {
        let options = ConvergeOptions {
            width: 64,
            height: 48,
            frames,
            ..ConvergeOptions::default()
        };
        let cell = SweepCell::new(
            JitterModel::RandomWalk,
            SweepWall::Brick,
            30.0,
            rotation_deg,
            translation_scale,
        );
        draw_survey(&options, &cell, 7).unwrap()
    }

    #[test]
    fn a_feasible_survey_is_drawn_once_and_an_infeasible_one_again() {
        let feasible = drawn(2.0, 1.0, 12);
        assert_eq!((feasible.redraws, feasible.survey.unwrap().seed), (0, 7));
        let noisy = drawn(40.0, 1.0, 12);
        let survey = noisy.survey.unwrap();
        assert!(noisy.redraws > 0);
        assert_eq!(survey.seed, 7 + 1000 * noisy.redraws);
        Scene::new(&survey).unwrap();
    }

    #[test]
    fn infeasible_cells_are_given_up() {
        let infeasible = drawn(2.0, 5000.0, 12);
        assert!(infeasible.survey.is_none());
        assert_eq!(infeasible.redraws, MAX_REDRAWS);
    }
}
