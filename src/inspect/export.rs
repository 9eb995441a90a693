//! Exports of the textured wall: one glTF file, 3D Tiles, and the page.

use super::error::InspectError;
use super::glb_target::GlbTarget;
use super::layers::{PosedLayer, TextureOptions, draw_layers, lay_out_texture};
use super::marks::{MARKS_CSV, MARKS_GEOJSON};
use super::tiles_target::{TilesFolder, TilesTarget};
use super::viewer::Viewer;
use crate::persist::atomic::{OutputSet, StagedFolder, WriteError};
use crate::render::{Canvas, PanoramaJob, Target};
use crate::survey::Survey;
use crate::trajectory::Pose;
use std::path::Path;

/// Files of the textured wall, drawn from one panorama.
#[derive(Clone, Copy, Debug, Default)]
pub struct ExportFiles<'a> {
    /// A glTF file (GLB).
    pub glb: Option<&'a Path>,
    /// A folder of 3D Tiles.
    pub tiles: Option<&'a Path>,
}

/// The panorama of a textured wall before it is drawn.
#[derive(Clone, Copy, Debug)]
pub struct WallPlan {
    /// Its canvas.
    pub canvas: Canvas,
    /// Memory that drawing takes at most, bytes.
    pub memory_bytes: u64,
}

/// Lays out what [`stage_wall`] draws, and checks it as far as is possible without frames.
///
/// # Errors
/// Poses that cannot be placed on the wall, too little memory.
pub fn plan_wall(
    survey: &Survey,
    poses: &[Pose],
    options: &TextureOptions,
    files: ExportFiles,
) -> Result<WallPlan, InspectError> {
    let stitch = lay_out_texture(survey, poses, &survey.shutter(), options)?;
    let (canvas, format) = (*stitch.canvas(), stitch.frames().format());
    let single_bytes = match files.glb {
        Some(_) => GlbTarget::bytes_for(&canvas, format)?,
        None => 0,
    };
    let tiles_bytes = match files.tiles {
        Some(_) => TilesTarget::bytes_for(&canvas, format)?,
        None => 0,
    };
    let budget = stitch.budget(single_bytes + tiles_bytes)?;
    let frames_bytes = stitch.frames().frame_bytes() * survey.frames.len() as u64;
    Ok(WallPlan {
        canvas,
        memory_bytes: budget.most(frames_bytes),
    })
}

/// Draws the panorama of `poses`, the first of the job, as textured mesh in `files`, which are
/// added to a set of outputs; returns its canvas.
///
/// # Errors
/// A frame that cannot be decoded, too little memory, too much wall for one file, and whatever the
/// system says.
pub fn stage_wall(
    survey: &Survey,
    poses: &[Pose],
    options: &TextureOptions,
    files: ExportFiles,
    outputs: &mut OutputSet,
    job: &PanoramaJob,
) -> Result<Canvas, InspectError> {
    let surface = survey.surface.as_ref();
    let mut stitch = lay_out_texture(survey, poses, &survey.shutter(), options)?;
    let (canvas, format) = (*stitch.canvas(), stitch.frames().format());
    let quality = options.quality;
    let mut single = match files.glb {
        Some(path) => Some(GlbTarget::new(surface, &canvas, format, path, quality)?),
        None => None,
    };
    let mut tiles = match files.tiles {
        Some(path) => Some(TilesFolder::begin(surface, &canvas, format, path, quality)?),
        None => None,
    };
    let single_bytes = single.as_ref().map_or(0, GlbTarget::max_bytes);
    let tiles_bytes = tiles.as_mut().map_or(0, |tiles| tiles.target().max_bytes());
    let budget = stitch.budget(single_bytes + tiles_bytes)?;
    let mut targets: Vec<&mut dyn Target> = Vec::new();
    targets.extend(single.as_mut().map(|single| single as &mut dyn Target));
    targets.extend(
        tiles
            .as_mut()
            .map(|tiles| tiles.target() as &mut dyn Target),
    );
    let progress = job.panorama(0);
    let settled = stitch.settle(&budget, &progress)?;
    let (plan, frames) = stitch.plan(settled);
    plan.draw(frames, budget.room, &mut targets, &progress)?;
    drop(progress);
    if let Some(single) = single {
        single.finish(outputs)?;
    }
    if let Some(tiles) = tiles {
        tiles.finish(outputs, &canvas)?;
    }
    Ok(canvas)
}

/// Writes the page with all layers as `folder`, which is added to a set of outputs. Marks that are
/// kept in an earlier page there stay.
///
/// # Errors
/// A frame that cannot be decoded, a program built without its viewer, and whatever the system
/// says.
pub fn stage_page(
    survey: &Survey,
    layers: &[PosedLayer],
    options: &TextureOptions,
    twelve_at_deg: f64,
    (folder, outputs): (&Path, &mut OutputSet),
    job: &PanoramaJob,
) -> Result<(), InspectError> {
    let staged = StagedFolder::begin(folder)?;
    let place = staged.path();
    draw_layers(survey, layers, options, twelve_at_deg, place, job)?;
    Viewer::bundled()?.write(place)?;
    for name in [MARKS_GEOJSON, MARKS_CSV] {
        let old = folder.join(name);
        if old.is_file() {
            std::fs::copy(&old, place.join(name))
                .map_err(|source| WriteError::new(&old, source))?;
        }
    }
    Ok(outputs.folder(staged)?)
}
