//! The files of a panorama while it is being drawn.

use super::{GAPS, PREVIEW, RESOLUTION, UNCERTAINTY};
use crate::camera::Camera;
use crate::cli::Failure;
use crate::frames::{PictureFormat, write_picture};
use crate::persist::atomic::{self, WriteError};
use crate::persist::checkpoint::Checkpoint;
use crate::raster::RasterError;
use crate::render::{
    Band, Canvas, Coverage, Gap, Layout, Map, Panorama, Plan, Preview, RasterState, RasterTarget,
    RenderError, Target, gaps_csv,
};
use crate::surface::Surface;
use image::DynamicImage;
use nalgebra::Matrix6;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::path::PathBuf;

/// The outputs of one panorama, begun.
pub struct Outputs {
    pub(super) layout: Layout,
    pub(super) out: PathBuf,
    /// Bands that all of them have had.
    pub(super) bands: usize,
    pub(super) picture: Option<(Panorama, PictureFormat)>,
    pub(super) cog: Option<RasterTarget>,
    pub(super) dzi: Option<RasterTarget>,
    pub(super) maps: Option<Maps>,
    pub(super) coverage: Coverage,
}

/// The maps beside it.
pub(super) struct Maps {
    pub(super) folder: PathBuf,
    pub(super) coverage: RasterTarget,
    pub(super) frames: RasterTarget,
    pub(super) preview: Preview,
}

/// Name of the states.
pub(super) const STATE: &str = "files";

/// How far the files have come; nothing has begun by default.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct FilesState<'a> {
    pub(super) bands: usize,
    pub(super) coverage: Option<Cow<'a, Coverage>>,
    pub(super) picture: Option<Cow<'a, Panorama>>,
    pub(super) cog: Option<RasterState<'a>>,
    pub(super) dzi: Option<RasterState<'a>>,
    pub(super) maps: Option<MapsState<'a>>,
}

/// How far the maps have come.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct MapsState<'a> {
    pub(super) coverage: Option<RasterState<'a>>,
    pub(super) frames: Option<RasterState<'a>>,
    pub(super) preview: Option<Cow<'a, Preview>>,
}

/// Outputs that are kept in a checkpoint between two bands, when it is time.
pub struct Keeping<'a> {
    /// The outputs.
    pub outputs: &'a mut Outputs,
    /// Their checkpoint.
    pub checkpoint: &'a mut Checkpoint,
}

impl Target for Keeping<'_> {
    fn wants_sources(&self) -> bool {
        self.outputs.maps.is_some()
    }

    fn put(&mut self, canvas: &Canvas, band: &Band) -> Result<(), RenderError> {
        for target in self.outputs.targets() {
            target.put(canvas, band)?;
        }
        self.outputs.bands += 1;
        if self.checkpoint.is_due() {
            let state = self.outputs.state().map_err(RasterError::from)?;
            let kept = self.checkpoint.keep(STATE, &state);
            kept.map_err(RasterError::from)?;
        }
        Ok(())
    }
}

impl Outputs {
    /// Bands that are drawn already.
    pub fn bands(&self) -> usize {
        self.bands
    }

    /// How far they have come.
    fn state(&self) -> Result<FilesState<'_>, WriteError> {
        Ok(FilesState {
            bands: self.bands,
            coverage: Some(Cow::Borrowed(&self.coverage)),
            picture: self.picture.as_ref().map(|(drawn, _)| Cow::Borrowed(drawn)),
            cog: self.cog.as_ref().map(RasterTarget::state).transpose()?,
            dzi: self.dzi.as_ref().map(RasterTarget::state).transpose()?,
            maps: match &self.maps {
                Some(maps) => Some(MapsState {
                    coverage: Some(maps.coverage.state()?),
                    frames: Some(maps.frames.state()?),
                    preview: Some(Cow::Borrowed(&maps.preview)),
                }),
                None => None,
            },
        })
    }

    /// Everything that wants bands.
    fn targets(&mut self) -> Vec<&mut dyn Target> {
        let mut targets: Vec<&mut dyn Target> = vec![&mut self.coverage];
        if let Some((picture, _)) = &mut self.picture {
            targets.push(picture);
        }
        targets.extend(self.cog.as_mut().map(|cog| cog as &mut dyn Target));
        targets.extend(self.dzi.as_mut().map(|dzi| dzi as &mut dyn Target));
        if let Some(maps) = &mut self.maps {
            targets.push(&mut maps.coverage);
            targets.push(&mut maps.frames);
            targets.push(&mut maps.preview);
        }
        targets
    }

    /// Share of the panorama that some frame sees, 0–1.
    pub fn share(&self) -> f64 {
        self.coverage.share()
    }

    /// What no frame sees.
    pub fn gaps(&self, surface: &dyn Surface) -> Vec<Gap> {
        self.coverage.gaps(surface)
    }

    /// Gives all files their names; the panorama last. `camera`: that of the frames as they are;
    /// `covariances`: those of their poses, if known.
    ///
    /// # Errors
    /// Whatever the system says.
    pub fn finish(
        self,
        plan: &Plan,
        gaps: &[Gap],
        camera: &Camera,
        covariances: Option<&[Matrix6<f64>]>,
    ) -> Result<(), Failure> {
        if let Some(maps) = self.maps {
            maps.finish(self.layout, plan, gaps, camera, covariances)?;
        }
        if let Some(dzi) = self.dzi {
            dzi.finish()?;
        }
        if let Some(cog) = self.cog {
            cog.finish()?;
        }
        if let Some((picture, format)) = self.picture {
            write_picture(&self.out, &picture.into_image(self.layout), format)?;
        }
        Ok(())
    }
}

impl Maps {
    fn finish(
        self,
        layout: Layout,
        plan: &Plan,
        gaps: &[Gap],
        camera: &Camera,
        covariances: Option<&[Matrix6<f64>]>,
    ) -> Result<(), Failure> {
        let (surface, placements) = (plan.surface(), plan.placements());
        self.coverage.finish()?;
        self.frames.finish()?;
        let grid = plan.grid();
        let labels = plan.seams().map(|seams| seams.labels());
        let resolution = Map::resolution(surface, camera, placements, &grid, labels);
        resolution.write(&self.folder.join(RESOLUTION), layout)?;
        if let Some(covariances) = covariances {
            let map = Map::uncertainty(surface, camera, placements, &grid, labels, covariances);
            map.write(&self.folder.join(UNCERTAINTY), layout)?;
        } else {
            // One from an earlier panorama would belong to other poses.
            atomic::remove_file(&self.folder.join(UNCERTAINTY))?;
        }
        let preview = DynamicImage::from(self.preview.picture(surface, layout, 0.0));
        write_picture(&self.folder.join(PREVIEW), &preview, PictureFormat::Png)?;
        atomic::write_text(&self.folder.join(GAPS), &gaps_csv(gaps))?;
        Ok(())
    }
}
