//! Options of a sweep.

use crate::converge::error::ConvergeError;
use crate::converge::run_record::{SCHEMA_VERSION, Settings};
use crate::converge::sweep_cell::unit_sigmas;
use crate::converge::sweep_cell::{SweepCell, SweepWall};
use crate::converge::wall_deformation::WallDeformation;
use serde::Serialize;
use std::collections::HashSet;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::trajectory::JitterModel;
use tunnelstitch_simulate::SimulateOptions;

/// Vertical field of view of the paper's camera: 60°.
const VERTICAL_FOV_RAD: f64 = std::f64::consts::FRAC_PI_3;

/// Relation of the translation noise to the rotation noise.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum TranslationScale {
    /// Proportional: the `free` experiment's sigmas at its rotation sigma (2°). The grid has one
    /// axis.
    Auto,
    /// Multiples of the `free` experiment's sigmas, each combined with every rotation sigma. The
    /// grid has two axes.
    Factors(Vec<f64>),
}

/// Options of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ConvergeOptions {
    /// Rotation 1-σ about each axis, degrees.
    pub rotations_deg: Vec<f64>,
    /// Translation 1-σ.
    pub translation: TranslationScale,
    /// Noise models.
    pub jitters: Vec<JitterModel>,
    /// Turns from frame to frame, degrees.
    pub turns_deg: Vec<f64>,
    /// Walls.
    pub walls: Vec<SweepWall>,
    /// Number of runs of each cell, with the seeds 1 to this number.
    pub seeds: u64,
    /// Number of frames of a survey.
    pub frames: usize,
    /// Width of a frame, pixels.
    pub width: u32,
    /// Height of a frame, pixels.
    pub height: u32,
    /// 1-σ of the sensor's noise, grey levels.
    pub noise_grey: f64,
    /// Deformation of the wall.
    pub deformation: WallDeformation,
}

impl Default for ConvergeOptions {
    /// Defaults of the command: 2° to 12°, both noise models, 20 seeds, two turns of 12 frames.
    fn default() -> Self {
        Self {
            rotations_deg: vec![2.0, 4.0, 6.0, 8.0, 12.0],
            translation: TranslationScale::Auto,
            jitters: vec![JitterModel::RandomWalk, JitterModel::Independent],
            turns_deg: vec![30.0],
            walls: vec![SweepWall::Brick],
            seeds: 20,
            frames: 24,
            width: 640,
            height: 480,
            noise_grey: 2.0,
            deformation: WallDeformation::default(),
        }
    }
}

/// Maximum seeds of a cell; a larger seed would equal that of another's second draw.
pub(super) const MAX_SEEDS: u64 = 1000;

impl ConvergeOptions {
    /// The cells in order of noise model, wall, turn, translation scale and rotation (innermost).
    pub fn cells(&self) -> Vec<SweepCell> {
        let mut cells = Vec::new();
        for &jitter in &self.jitters {
            for &wall in &self.walls {
                for &turn_deg in &self.turns_deg {
                    for row in 0..self.translation_rows() {
                        for &rotation_deg in &self.rotations_deg {
                            let scale = self.translation_scale(row, rotation_deg);
                            cells.push(SweepCell::new(jitter, wall, turn_deg, rotation_deg, scale));
                        }
                    }
                }
            }
        }
        cells
    }

    /// Number of rows of the grid for one noise model, wall and turn.
    pub(super) fn translation_rows(&self) -> usize {
        match &self.translation {
            TranslationScale::Auto => 1,
            TranslationScale::Factors(factors) => factors.len(),
        }
    }

    fn translation_scale(&self, row: usize, rotation_deg: f64) -> f64 {
        match &self.translation {
            TranslationScale::Auto => rotation_deg / unit_sigmas().rotation_sigma_deg,
            TranslationScale::Factors(factors) => factors[row],
        }
    }

    /// Settings that all runs of the sweep share.
    pub fn settings(&self) -> Settings {
        Settings {
            schema_version: SCHEMA_VERSION,
            program: tunnelstitch_core::PROGRAM.to_owned(),
            frames: self.frames,
            width: self.width,
            height: self.height,
            noise_grey: self.noise_grey,
            deformation: self.deformation,
        }
    }

    /// The survey of a cell and seed: the `free` experiment with the cell's noise.
    pub(super) fn survey(&self, cell: &SweepCell, seed: u64) -> SimulateOptions {
        SimulateOptions {
            frames: self.frames,
            camera: Camera::from_vertical_fov(self.width, self.height, VERTICAL_FOV_RAD),
            turn_deg: cell.turn_deg,
            jitter: Some(cell.prior()),
            wall: cell.wall.into(),
            noise_grey: self.noise_grey,
            as_built: self.deformation.as_built(),
            seed,
            ..SimulateOptions::free()
        }
    }

    /// Validates the options that the simulator does not validate.
    ///
    /// # Errors
    /// [`ConvergeError::Option`] with the impossible option.
    pub(super) fn validate(&self) -> Result<(), ConvergeError> {
        let check = |good: bool, what: &str| {
            if good {
                Ok(())
            } else {
                Err(ConvergeError::Option {
                    what: what.to_owned(),
                })
            }
        };
        let sigma = |v: &f64| v.is_finite() && *v >= 0.0;
        check(
            self.rotations_deg.iter().all(sigma),
            "the rotation sigmas must be finite and not negative",
        )?;
        if let TranslationScale::Factors(factors) = &self.translation {
            check(
                factors.iter().all(sigma),
                "the translation scales must be finite and not negative",
            )?;
        }
        check(
            self.frames >= 2,
            "a survey to refine needs two frames or more",
        )?;
        check(
            (1..=MAX_SEEDS).contains(&self.seeds),
            "1 to 1000 seeds can be swept",
        )?;
        let cells = self.cells();
        check(
            !cells.is_empty(),
            "the sweep is empty; each list needs at least one value",
        )?;
        let keys: HashSet<String> = cells.iter().map(SweepCell::key).collect();
        check(
            keys.len() == cells.len(),
            "a value is in its list twice; name each only once",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grid_has_every_combination_and_auto_follows_the_rotation() {
        let mut options = ConvergeOptions {
            rotations_deg: vec![2.0, 6.0],
            ..ConvergeOptions::default()
        };
        let cells = options.cells();
        assert_eq!(cells.len(), 4);
        assert_eq!(cells[1].translation_scale, 3.0);
        assert!((cells[1].translation_sigma_m[2] - 0.09).abs() < 1e-12);
        assert_eq!(cells[2].jitter, JitterModel::Independent);
        options.translation = TranslationScale::Factors(vec![0.5, 1.0, 2.0]);
        let cells = options.cells();
        assert_eq!(cells.len(), 12);
        assert_eq!(cells[5].rotation_sigma_deg, 6.0);
        assert_eq!(cells[5].translation_sigma_m, [0.04, 0.04, 0.06]);
        options.validate().unwrap();
    }

    #[test]
    fn impossible_options_are_refused() {
        let wrong = [
            ConvergeOptions {
                rotations_deg: vec![2.0, 2.0],
                ..ConvergeOptions::default()
            },
            ConvergeOptions {
                rotations_deg: vec![-1.0],
                ..ConvergeOptions::default()
            },
            ConvergeOptions {
                walls: Vec::new(),
                ..ConvergeOptions::default()
            },
            ConvergeOptions {
                seeds: 1001,
                ..ConvergeOptions::default()
            },
            ConvergeOptions {
                frames: 1,
                ..ConvergeOptions::default()
            },
        ];
        for options in wrong {
            assert!(options.validate().is_err(), "{options:?}");
        }
    }
}
