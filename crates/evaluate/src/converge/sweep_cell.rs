//! Cell of a sweep: one point of the grid of noise models, walls and sigmas.

use serde::{Deserialize, Serialize};
use std::fmt;
use tunnelstitch_core::survey::PriorSection;
use tunnelstitch_geometry::trajectory::JitterModel;
use tunnelstitch_simulate::{SimulateOptions, Wall};

/// Wall of a sweep; each is one that needs no image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum SweepWall {
    /// [`Wall::Brick`].
    Brick,
    /// [`Wall::Concrete`].
    Concrete,
    /// [`Wall::TiledBrick`].
    TiledBrick,
    /// [`Wall::Target`].
    Target,
}

impl SweepWall {
    /// Name of the wall on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Brick => "brick",
            Self::Concrete => "concrete",
            Self::TiledBrick => "tiled-brick",
            Self::Target => "target",
        }
    }
}

impl From<SweepWall> for Wall {
    fn from(wall: SweepWall) -> Self {
        match wall {
            SweepWall::Brick => Self::Brick,
            SweepWall::Concrete => Self::Concrete,
            SweepWall::TiledBrick => Self::TiledBrick,
            SweepWall::Target => Self::Target,
        }
    }
}

/// Name of a noise model on the command line.
pub(super) fn jitter_name(model: JitterModel) -> &'static str {
    match model {
        JitterModel::RandomWalk => "random-walk",
        JitterModel::Independent => "independent",
    }
}

/// Sigmas of the `free` experiment, which are those of scale 1.
pub(super) fn unit_sigmas() -> PriorSection {
    SimulateOptions::free().jitter.unwrap_or_default()
}

/// Cell of a sweep: one point of the grid.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SweepCell {
    /// Correlation of the errors of consecutive poses.
    pub jitter: JitterModel,
    /// Appearance of the wall.
    pub wall: SweepWall,
    /// Turn from frame to frame, degrees, which sets the overlap.
    pub turn_deg: f64,
    /// Rotation 1-σ about each axis, degrees.
    pub rotation_sigma_deg: f64,
    /// Multiple of the `free` experiment's translation sigmas.
    pub translation_scale: f64,
    /// Translation 1-σ along x, y, z, metres.
    pub translation_sigma_m: [f64; 3],
}

impl SweepCell {
    /// A cell with angles in degrees and a multiple of the `free` experiment's translation sigmas.
    pub fn new(
        jitter: JitterModel,
        wall: SweepWall,
        turn_deg: f64,
        rotation_sigma_deg: f64,
        translation_scale: f64,
    ) -> Self {
        Self {
            jitter,
            wall,
            turn_deg,
            rotation_sigma_deg,
            translation_scale,
            translation_sigma_m: unit_sigmas()
                .translation_sigma_m
                .map(|m| m * translation_scale),
        }
    }

    /// The noise model of the poses.
    pub(super) fn prior(&self) -> PriorSection {
        PriorSection {
            model: self.jitter,
            rotation_sigma_deg: self.rotation_sigma_deg,
            translation_sigma_m: self.translation_sigma_m,
        }
    }

    /// Key that identifies the cell, robust against rounding of its numbers in JSON.
    pub(super) fn key(&self) -> String {
        format!(
            "{} {} {:.9} {:.9} {:.9}",
            jitter_name(self.jitter),
            self.wall.name(),
            self.turn_deg,
            self.rotation_sigma_deg,
            self.translation_scale
        )
    }
}

impl fmt::Display for SweepCell {
    /// Formats as `random-walk, brick, turn 30°, rotation 4°, translation ×2`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}, {}, turn {}°, rotation {}°, translation ×{}",
            jitter_name(self.jitter),
            self.wall.name(),
            self.turn_deg,
            self.rotation_sigma_deg,
            self.translation_scale
        )
    }
}
