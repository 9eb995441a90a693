//! Layers of the page: panoramas of several trajectories, drawn as textures.

use super::error::InspectError;
use super::manifest::{MANIFEST, Manifest, PanoramaLayer, WALL, WallPoints};
use super::server::SourceFrames;
use super::tiles_target::{TilesTarget, tiles_px_per_metre};
use crate::persist::atomic;
use crate::progress::Progress;
use crate::render::{RenderError, RenderOptions, Stitch, StitchOptions, place_frames};
use crate::survey::Survey;
use crate::trajectory::{Pose, Shutter};
use serde::Serialize;
use std::path::Path;

/// Options of panoramas that become textures.
#[derive(Clone, Copy, Debug)]
pub struct TextureOptions {
    /// Pixels per metre of wall; the drawn resolution is the next higher one at which the levels of
    /// detail close around the section. `None`: the frames' own resolution at the wall.
    pub px_per_metre: Option<f64>,
    /// Combination of overlapping frames.
    pub render: RenderOptions,
    /// Quality of JPEG, 1–100.
    pub quality: u8,
    /// Memory that may be used, bytes.
    pub memory: u64,
}

/// A trajectory whose panorama is one layer of the page.
#[derive(Clone, Debug)]
pub struct PosedLayer {
    /// Name of the layer and of its folder.
    pub name: &'static str,
    /// Poses of the frames.
    pub poses: Vec<Pose>,
    /// Times at which the rows of the frames are read.
    pub shutter: Shutter,
}

/// Lays out a panorama whose levels of detail close around the section.
///
/// # Errors
/// The errors of [`Stitch::new`].
pub(super) fn lay_out_texture<'a>(
    survey: &'a Survey,
    poses: &[Pose],
    shutter: &Shutter,
    options: &TextureOptions,
) -> Result<Stitch<'a>, RenderError> {
    let surface = survey.surface.as_ref();
    let lay_out = |px_per_metre| {
        let options = StitchOptions {
            px_per_metre,
            render: options.render,
            memory: options.memory,
            ..StitchOptions::default()
        };
        let (camera, frames) = (&survey.camera, &survey.frames);
        Stitch::new(surface, camera, frames, poses, shutter, &options)
    };
    let px_per_metre = lay_out(options.px_per_metre)?.canvas().px_per_metre;
    lay_out(Some(tiles_px_per_metre(surface, px_per_metre)))
}

/// Draws all layers into `folder` and writes the manifest beside them.
///
/// # Errors
/// A frame that cannot be decoded; whatever the system says.
pub fn draw_layers(
    survey: &Survey,
    layers: &[PosedLayer],
    options: &TextureOptions,
    twelve_at_deg: f64,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<(), InspectError> {
    let mut drawn = Vec::new();
    for layer in layers {
        drawn.push(draw_layer(survey, layer, options, folder, progress)?);
    }
    let surface = survey.surface.as_ref();
    let frames = survey.frames.iter().map(|frame| frame.name()).collect();
    let name = survey_name(survey);
    let manifest = Manifest::new(name, surface, &survey.camera, frames, twelve_at_deg, drawn);
    let wall = WallPoints::new(surface, manifest.chainage_m);
    write_json(folder, MANIFEST, &manifest)?;
    write_json(folder, WALL, &wall)
}

/// Draws one layer into its folder within `folder`.
fn draw_layer(
    survey: &Survey,
    layer: &PosedLayer,
    options: &TextureOptions,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<PanoramaLayer, InspectError> {
    let mut stitch = lay_out_texture(survey, &layer.poses, &layer.shutter, options)?;
    let (canvas, format) = (*stitch.canvas(), stitch.frames().format());
    let place = folder.join(layer.name);
    atomic::create_folder(&place)?;
    let surface = survey.surface.as_ref();
    let mut tiles = TilesTarget::new(surface, &canvas, format, &place, options.quality)?;
    let map = tiles.with_map(&canvas)?;
    let budget = stitch.budget(tiles.max_bytes())?;
    let settled = stitch.settle(&budget, progress)?;
    let (plan, frames) = stitch.plan(settled);
    plan.draw(frames, budget.room, &mut [&mut tiles], progress)?;
    tiles.finish(&canvas)?;
    Ok(PanoramaLayer::new(layer.name, &canvas, map, &layer.poses))
}

/// Places the frames of a survey with the poses of every layer, for the page's view of the frames.
///
/// # Errors
/// A frame that cannot be placed on the wall.
pub fn pose_source_frames(
    survey: Survey,
    layers: Vec<PosedLayer>,
) -> Result<SourceFrames, InspectError> {
    let surface = survey.surface.as_ref();
    let mut placements = Vec::new();
    for layer in layers {
        let placed = place_frames(surface, &survey.camera, &layer.poses, &layer.shutter)?;
        placements.push((layer.name.to_owned(), placed));
    }
    Ok(SourceFrames {
        surface: survey.surface,
        camera: survey.camera,
        frames: survey.frames,
        placements,
    })
}

/// Name of a survey: that of its folder.
fn survey_name(survey: &Survey) -> String {
    let full = survey.folder.canonicalize().ok();
    let name = full.as_deref().and_then(Path::file_name);
    name.map_or_else(
        || "survey".to_owned(),
        |name| name.to_string_lossy().into_owned(),
    )
}

fn write_json(
    folder: &Path,
    name: &'static str,
    value: &impl Serialize,
) -> Result<(), InspectError> {
    let text =
        serde_json::to_string(value).map_err(|source| InspectError::Json { name, source })?;
    Ok(atomic::write_text(&folder.join(name), &text)?)
}
