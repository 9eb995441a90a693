//! Layers of the page: panoramas of several trajectories, drawn as textures.

use super::deformation_layer::{DEFORMATION_LAYER, DeformationPaint, FORMAT};
use super::error::InspectError;
use super::layer_values::{LayerValues, VALUES};
use super::manifest::{MANIFEST, Manifest, PanoramaLayer, WALL, WallPoints};
use super::server::SourceFrames;
use super::tiles_target::{TilesTarget, tiles_px_per_metre};
use crate::evaluate::deformation::{DeviationGrid, DeviationMap};
use crate::persist::atomic;
use crate::progress::Progress;
use crate::render::{
    PanoramaJob, RenderError, RenderOptions, Stitch, StitchOptions, Target, place_frames,
};
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
        let (cameras, frames) = (&survey.cameras, &survey.frames);
        Stitch::new(surface, cameras, frames, poses, shutter, &options)
    };
    let px_per_metre = lay_out(options.px_per_metre)?.canvas().px_per_metre;
    lay_out(Some(tiles_px_per_metre(surface, px_per_metre)))
}

/// Lays out what [`draw_layers`] draws, and checks it as far as is possible without frames; returns
/// the memory that drawing takes at most, bytes.
///
/// # Errors
/// Poses that cannot be placed on the wall, too little memory.
pub fn plan_layers(
    survey: &Survey,
    layers: &[PosedLayer],
    options: &TextureOptions,
) -> Result<u64, InspectError> {
    let mut most_bytes = 0;
    let mut has_deformation = DeviationMap::of_survey(survey)?.is_some();
    for layer in layers {
        let stitch = lay_out_texture(survey, &layer.poses, &layer.shutter, options)?;
        let (canvas, frames) = (stitch.canvas(), stitch.frames());
        let mut target_bytes = TilesTarget::bytes_for(canvas, frames.format())?;
        if std::mem::take(&mut has_deformation) {
            target_bytes += TilesTarget::bytes_for(canvas, FORMAT)?;
        }
        let frames_bytes = frames.frame_bytes() * survey.frames.len() as u64;
        most_bytes = most_bytes.max(stitch.budget(target_bytes)?.most(frames_bytes));
    }
    Ok(most_bytes)
}

/// Draws all layers into `folder`, each a panorama of the job, and writes the manifest beside
/// them.
///
/// # Errors
/// A frame that cannot be decoded; whatever the system says.
pub fn draw_layers(
    survey: &Survey,
    layers: &[PosedLayer],
    options: &TextureOptions,
    twelve_at_deg: f64,
    folder: &Path,
    job: &PanoramaJob,
) -> Result<(), InspectError> {
    let map = DeviationMap::of_survey(survey)?;
    let mut deformation = map
        .as_ref()
        .and_then(|map| Some((map, DeviationGrid::new(map)?)));
    let mut drawn = Vec::new();
    for (k, layer) in layers.iter().enumerate() {
        // The deformation is painted over the first panorama.
        let deformation = deformation.take();
        let progress = job.panorama(k);
        drawn.extend(draw_layer(
            survey,
            layer,
            deformation,
            options,
            folder,
            &progress,
        )?);
    }
    let surface = survey.surface.as_ref();
    let frames = survey.frames.iter().map(|frame| frame.name()).collect();
    let name = survey_name(survey);
    let manifest = Manifest::new(name, surface, &survey.cameras, frames, twelve_at_deg, drawn);
    let wall = WallPoints::new(surface, manifest.chainage_m);
    write_json(folder, MANIFEST, &manifest)?;
    write_json(folder, WALL, &wall)
}

/// Draws one layer into its folder within `folder`, and the deformation over its panorama into
/// another, if it is given.
fn draw_layer(
    survey: &Survey,
    layer: &PosedLayer,
    deformation: Option<(&DeviationMap, DeviationGrid)>,
    options: &TextureOptions,
    folder: &Path,
    progress: &dyn Progress,
) -> Result<Vec<PanoramaLayer>, InspectError> {
    let mut stitch = lay_out_texture(survey, &layer.poses, &layer.shutter, options)?;
    let (canvas, format) = (*stitch.canvas(), stitch.frames().format());
    let surface = survey.surface.as_ref();
    let begin = |name: &str, format| -> Result<(TilesTarget, PanoramaLayer), InspectError> {
        let place = folder.join(name);
        atomic::create_folder(&place)?;
        let mut tiles = TilesTarget::new(surface, &canvas, format, &place, options.quality)?;
        let map = tiles.with_map(&canvas)?;
        Ok((tiles, PanoramaLayer::new(name, &canvas, map, &layer.poses)))
    };
    let (mut tiles, shown) = begin(layer.name, format)?;
    let mut drawn = vec![shown];
    let mut max_bytes = tiles.max_bytes();
    let mut paint = None;
    if let Some((map, grid)) = deformation {
        let (painted, shown) = begin(DEFORMATION_LAYER, FORMAT)?;
        drawn.push(shown.with_values(LayerValues::new(&grid)));
        max_bytes += painted.max_bytes();
        write_json(folder, VALUES, &grid)?;
        paint = Some(DeformationPaint::new(painted, map, grid.size_mm()));
    }
    let budget = stitch.budget(max_bytes)?;
    let settled = stitch.settle(&budget, progress)?;
    let (plan, frames) = stitch.plan(settled);
    let mut targets: Vec<&mut dyn Target> = vec![&mut tiles];
    if let Some(paint) = &mut paint {
        targets.push(paint);
    }
    plan.draw(frames, budget.room, &mut targets, progress)?;
    tiles.finish(&canvas)?;
    if let Some(paint) = paint {
        paint.tiles.finish(&canvas)?;
    }
    Ok(drawn)
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
        let placed = place_frames(surface, &survey.cameras, &layer.poses, &layer.shutter)?;
        placements.push((layer.name.to_owned(), placed));
    }
    // The deformation is painted over the first.
    if let (Some((_, first)), true) = (placements.first(), survey.displacement.is_some()) {
        placements.push((DEFORMATION_LAYER.to_owned(), first.clone()));
    }
    Ok(SourceFrames {
        surface: survey.surface,
        cameras: survey.cameras,
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
