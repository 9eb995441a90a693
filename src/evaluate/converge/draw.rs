//! A survey that could be flown.

use super::{Cell, ConvergeError, ConvergeOptions};
use crate::simulate::{Scene, SimulateError, SimulateOptions};

/// Draws after the first, at the most.
const MOST_REDRAWS: u64 = 1000;
/// From the seed of a draw to that of the next; sweeps have no more seeds than this.
const SEED_STEP: u64 = super::options::MOST_SEEDS;

/// A survey of a cell.
pub(super) struct Draw {
    /// The survey, with the seed that it was drawn by; none if no draw could be flown.
    pub survey: Option<SimulateOptions>,
    /// Draws before it that could not be flown.
    pub redraws: u64,
}

/// Draws surveys by the seeds `seed + 1000 k`, k = 0, 1, …, until the true poses stay inside the
/// tunnel and look at its wall.
///
/// The more noise, the tamer are the draws that remain, compared with those asked for: the number
/// of redraws says by how much.
///
/// # Errors
/// [`ConvergeError::Simulate`] if the survey would be impossible without any noise too.
pub(super) fn draw(
    options: &ConvergeOptions,
    cell: &Cell,
    seed: u64,
) -> Result<Draw, ConvergeError> {
    let planned = SimulateOptions {
        jitter: None,
        ..options.survey(cell, seed)
    };
    Scene::new(&planned)?;
    for redraws in 0..=MOST_REDRAWS {
        let survey = options.survey(cell, seed + SEED_STEP * redraws);
        match Scene::new(&survey) {
            Ok(_) => {
                return Ok(Draw {
                    survey: Some(survey),
                    redraws,
                });
            }
            // The plan is possible, so an option is so only together with this draw: it sees more
            // wall than can be painted.
            Err(
                SimulateError::CameraOutside { .. }
                | SimulateError::LooksAlongTheAxis { .. }
                | SimulateError::Option { .. },
            ) => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(Draw {
        survey: None,
        redraws: MOST_REDRAWS,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::converge::SweepWall;
    use crate::trajectory::JitterModel;

    fn drawn(rotation_deg: f64, translation_scale: f64, frames: usize) -> Draw {
        let options = ConvergeOptions {
            width: 64,
            height: 48,
            frames,
            ..ConvergeOptions::default()
        };
        let cell = Cell::new(
            JitterModel::RandomWalk,
            SweepWall::Brick,
            30.0,
            rotation_deg,
            translation_scale,
        );
        draw(&options, &cell, 7).unwrap()
    }

    #[test]
    fn a_tame_survey_is_drawn_once_and_a_wild_one_again() {
        let tame = drawn(2.0, 1.0, 12);
        assert_eq!((tame.redraws, tame.survey.unwrap().seed), (0, 7));
        let wild = drawn(40.0, 1.0, 12);
        let survey = wild.survey.unwrap();
        assert!(wild.redraws > 0);
        assert_eq!(survey.seed, 7 + 1000 * wild.redraws);
        Scene::new(&survey).unwrap();
    }

    #[test]
    fn the_hopeless_is_given_up() {
        let hopeless = drawn(2.0, 5000.0, 12);
        assert!(hopeless.survey.is_none());
        assert_eq!(hopeless.redraws, MOST_REDRAWS);
    }
}
