//! Panoramas that become textures: how they are drawn, and the layers of a tunnel that the viewer
//! shows.

use super::poses::PosesArgument;
use super::stitch::{BlendArguments, memory_size, positive};
use super::{Failure, Terminal};
use crate::frames::JPEG_QUALITY;
use crate::inspect::{
    MANIFEST, Manifest, PanoramaLayer, TilesTarget, WALL, WallPoints, tiles_px_per_metre,
};
use crate::persist::atomic;
use crate::render::{RenderOptions, Stitch, StitchOptions};
use crate::survey::Survey;
use crate::trajectory::{Pose, Shutter, Trajectory, poses_of};
use clap::ValueEnum;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// How textures are drawn.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Textures")]
pub struct TextureArguments {
    /// Pixels per metre of wall, or a little more
    /// [default: the frames' own resolution at the wall].
    #[arg(long, value_name = "N", value_parser = positive)]
    px_per_metre: Option<f64>,
    #[command(flatten)]
    blend: BlendArguments,
    /// Quality of the pictures (JPEG), 1 to 100.
    #[arg(long, value_name = "N", default_value_t = JPEG_QUALITY, value_parser = clap::value_parser!(u8).range(1..=100))]
    pub quality: u8,
    /// Memory to work with, as 512MiB or 2GiB.
    #[arg(long, value_name = "SIZE", default_value = "2GiB", value_parser = memory_size)]
    memory: u64,
}

impl TextureArguments {
    /// Lays out a panorama whose levels meet themselves around the section.
    ///
    /// # Errors
    /// As [`Stitch::new`].
    pub fn stitch<'a>(
        &self,
        survey: &'a Survey,
        poses: &[Pose],
        shutter: &Shutter,
    ) -> Result<Stitch<'a>, Failure> {
        let surface = survey.surface.as_ref();
        let at = |px_per_metre| {
            let options = StitchOptions {
                px_per_metre,
                render: RenderOptions {
                    mode: self.blend.mode.into(),
                    blend: !self.blend.no_blend,
                    super_resolve: self.blend.super_resolve.is_some(),
                    ..RenderOptions::default()
                },
                memory: self.memory,
                ..StitchOptions::default()
            };
            Stitch::new(
                surface,
                &survey.camera,
                &survey.frames,
                poses,
                shutter,
                &options,
            )
        };
        let asked = at(self.px_per_metre)?.canvas().px_per_metre;
        Ok(at(Some(tiles_px_per_metre(surface, asked)))?)
    }
}

/// Which panoramas the viewer can switch between.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Layers of the page")]
pub struct LayersArguments {
    /// Poses to switch between, with commas, the first of them shown first
    /// [default: all there are; `refined` are those of a file of --poses].
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_enum)]
    layers: Option<Vec<LayerName>>,
    /// The angle θ of twelve o'clock, degrees.
    #[arg(
        long,
        value_name = "DEG",
        default_value_t = 0.0,
        allow_hyphen_values = true
    )]
    twelve_at: f64,
}

/// Layers by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LayerName {
    /// The poses of --poses FILE.
    Refined,
    /// The initial poses of the survey.
    Baseline,
    /// The true poses, if the survey has them.
    Truth,
}

impl LayerName {
    /// Its name and that of its folder.
    pub fn text(self) -> &'static str {
        match self {
            Self::Refined => "refined",
            Self::Baseline => "baseline",
            Self::Truth => "truth",
        }
    }
}

/// A layer to be drawn.
pub struct Poses {
    /// Its name.
    pub name: LayerName,
    /// Poses of the frames.
    pub poses: Vec<Pose>,
    /// When their rows are read.
    pub shutter: Shutter,
}

impl LayersArguments {
    /// All layers that are wanted of the survey at `path`, in the order given; by default the
    /// refined ones first. It has been opened with `poses`.
    ///
    /// # Errors
    /// A layer that is not there.
    pub fn of(
        &self,
        path: &Path,
        poses: &PosesArgument,
        (mut survey, given): (Survey, Trajectory),
    ) -> Result<(Survey, Vec<Poses>), Failure> {
        let mut all = Vec::new();
        if poses.file().is_some() {
            all.push(Poses {
                name: LayerName::Refined,
                poses: poses_of(&given),
                shutter: survey.shutter(),
            });
            survey = Survey::open(path)?;
        }
        let shutter = survey.shutter();
        let of_survey = [
            (LayerName::Baseline, Some(&survey.initial)),
            (LayerName::Truth, survey.truth.as_ref()),
        ];
        for (name, trajectory) in of_survey {
            all.extend(trajectory.map(|trajectory| Poses {
                name,
                poses: poses_of(trajectory),
                shutter: shutter.clone(),
            }));
        }
        let wanted = match &self.layers {
            Some(wanted) => wanted.clone(),
            None => all.iter().map(|layer| layer.name).collect(),
        };
        if let Some(name) = wanted
            .iter()
            .find(|name| all.iter().all(|layer| layer.name != **name))
        {
            return Err(Failure::usage(format!(
                "--layers {}: there are no such poses; refined ones are given with --poses FILE, true ones by poses.truth in survey.toml",
                name.text()
            )));
        }
        let place = |layer: &Poses| wanted.iter().position(|name| *name == layer.name);
        all.retain(|layer| place(layer).is_some());
        all.sort_by_key(place);
        Ok((survey, all))
    }

    /// Draws layers into `folder` and writes the manifest beside them.
    ///
    /// # Errors
    /// A frame that cannot be decoded; whatever the system says.
    pub fn draw(
        &self,
        (survey, layers): (&Survey, &[Poses]),
        textures: &TextureArguments,
        folder: &Path,
        terminal: &Terminal,
    ) -> Result<(), Failure> {
        let surface = survey.surface.as_ref();
        let mut drawn = Vec::new();
        for Poses {
            name,
            poses,
            shutter,
        } in layers
        {
            let name = name.text();
            let mut stitch = textures.stitch(survey, poses, shutter)?;
            let (canvas, format) = (*stitch.canvas(), stitch.frames().format());
            let place = folder.join(name);
            atomic::create_folder(&place)?;
            let mut tiles = TilesTarget::new(surface, &canvas, format, &place, textures.quality)?;
            let map = tiles.with_map(&canvas)?;
            let budget = stitch.budget(tiles.max_bytes())?;
            let settled = stitch.settle(&budget, terminal)?;
            let (plan, frames) = stitch.plan(settled);
            plan.draw(frames, budget.room, &mut [&mut tiles], terminal)?;
            tiles.finish(&canvas)?;
            drawn.push(PanoramaLayer::new(name, &canvas, map, poses));
        }
        let names = survey.frames.iter().map(|frame| frame.name()).collect();
        let manifest = Manifest::new(
            name_of(survey),
            surface,
            &survey.camera,
            names,
            self.twelve_at,
            drawn,
        );
        let wall = WallPoints::new(surface, manifest.chainage_m);
        write_json(&folder.join(MANIFEST), &manifest)?;
        write_json(&folder.join(WALL), &wall)
    }
}

/// The name of a survey: that of its folder.
fn name_of(survey: &Survey) -> String {
    let full: Option<PathBuf> = survey.folder.canonicalize().ok();
    let name = full.as_deref().and_then(Path::file_name);
    name.map_or_else(
        || "survey".to_owned(),
        |name| name.to_string_lossy().into_owned(),
    )
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string(value).map_err(|error| Failure::bug(error.to_string()))?;
    Ok(atomic::write_text(path, &text)?)
}
