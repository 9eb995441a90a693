//! Arguments of panoramas that become textures, and of the layers that the viewer shows.

use super::numbers::{memory_size, positive};
use super::poses::PosesArguments;
use super::rendering::BlendArguments;
use crate::cli::output::Failure;
use crate::frames::JPEG_QUALITY;
use crate::inspect::{PosedLayer, TextureOptions};
use crate::render::Interpolation;
use crate::survey::Survey;
use crate::trajectory::{Trajectory, poses_of};
use clap::ValueEnum;
use serde::Serialize;
use std::path::Path;

/// Resolution, blending and compression of textures.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Textures")]
pub struct TextureArguments {
    /// Pixels per metre of wall; rounded up a little so that tiles close around the section
    /// [default: the frames' own resolution at the wall].
    #[arg(long, value_name = "N", value_parser = positive)]
    px_per_metre: Option<f64>,
    #[command(flatten)]
    blend: BlendArguments,
    /// Quality of the JPEG textures, 1 to 100.
    #[arg(
        long,
        value_name = "N",
        default_value_t = JPEG_QUALITY,
        value_parser = clap::value_parser!(u8).range(1..=100)
    )]
    quality: u8,
    /// Memory limit, as 512MiB or 2GiB.
    #[arg(long, value_name = "SIZE", default_value = "2GiB", value_parser = memory_size)]
    memory: u64,
}

impl TextureArguments {
    /// Options for the library.
    pub fn options(&self) -> TextureOptions {
        TextureOptions {
            px_per_metre: self.px_per_metre,
            render: self.blend.render_options(Interpolation::default()),
            quality: self.quality,
            memory: self.memory,
        }
    }
}

/// Layers of the page.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Layers of the page")]
pub struct LayerArguments {
    /// Trajectories to switch between, separated by commas; the first one is shown first
    /// [default: all there are; `refined` are the poses of a file of --poses].
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_enum)]
    layers: Option<Vec<LayerName>>,
    /// Angle θ of twelve o'clock, degrees.
    #[arg(
        long = "twelve-at",
        value_name = "DEG",
        default_value_t = 0.0,
        allow_hyphen_values = true
    )]
    pub twelve_at_deg: f64,
}

/// Names of layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LayerName {
    /// Poses of --poses FILE.
    Refined,
    /// Initial poses of the survey.
    Baseline,
    /// True poses, if the survey has them.
    Truth,
}

impl LayerName {
    /// Name of the layer and of its folder.
    pub fn text(self) -> &'static str {
        match self {
            Self::Refined => "refined",
            Self::Baseline => "baseline",
            Self::Truth => "truth",
        }
    }
}

impl LayerArguments {
    /// Number of layers that [`LayerArguments::select`] selects.
    pub fn count(&self, path: &Path, poses: &PosesArguments) -> usize {
        let has_truth = || Survey::read_file(path).is_ok_and(|file| file.poses.truth.is_some());
        self.layers.as_ref().map_or_else(
            || 1 + usize::from(poses.file().is_some()) + usize::from(has_truth()),
            Vec::len,
        )
    }

    /// Selects the layers of the survey at `path`, which has been opened with `poses`; the refined
    /// poses come first unless --layers orders them.
    ///
    /// # Errors
    /// A layer whose poses do not exist.
    pub fn select(
        &self,
        path: &Path,
        poses: &PosesArguments,
        (mut survey, given): (Survey, Trajectory),
    ) -> Result<(Survey, Vec<(LayerName, PosedLayer)>), Failure> {
        let layer = |name: LayerName, trajectory: &Trajectory, survey: &Survey| {
            let posed = PosedLayer {
                name: name.text(),
                poses: poses_of(trajectory),
                shutter: survey.shutter(),
            };
            (name, posed)
        };
        let mut all = Vec::new();
        if poses.file().is_some() {
            all.push(layer(LayerName::Refined, &given, &survey));
            survey = poses.open_survey(path, |_| ())?;
        }
        let of_survey = [
            (LayerName::Baseline, Some(&survey.initial)),
            (LayerName::Truth, survey.truth.as_ref()),
        ];
        for (name, trajectory) in of_survey {
            all.extend(trajectory.map(|trajectory| layer(name, trajectory, &survey)));
        }
        let Some(wanted) = &self.layers else {
            return Ok((survey, all));
        };
        let exists = |name: &LayerName| all.iter().any(|(existing, _)| existing == name);
        if let Some(name) = wanted.iter().find(|name| !exists(name)) {
            return Err(Failure::usage(format!(
                "--layers {}: there are no such poses; give refined poses with --poses FILE, true \
                 poses with poses.truth in survey.toml",
                name.text()
            )));
        }
        let place = |(name, _): &(LayerName, _)| wanted.iter().position(|other| other == name);
        all.retain(|layer| place(layer).is_some());
        all.sort_by_key(place);
        Ok((survey, all))
    }
}
