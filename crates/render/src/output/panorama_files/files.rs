//! Files of a panorama while it is drawn.

use super::maps::{MapFiles, WallProperties};
use super::state::{FilesState, STATE};
use crate::compositing::band::{Band, Target};
use crate::error::RenderError;
use crate::layout::canvas::{Canvas, Layout};
use crate::output::gaps::{Coverage, Gap};
use crate::output::panorama::Panorama;
use crate::output::plan::Plan;
use crate::output::raster_target::RasterTarget;
use nalgebra::Matrix6;
use std::borrow::Cow;
use std::path::PathBuf;
use tunnelstitch_core::frames::{PictureFormat, add_picture};
use tunnelstitch_core::persist::atomic::{OutputSet, WriteError};
use tunnelstitch_core::persist::checkpoint::Checkpoint;
use tunnelstitch_core::raster::RasterError;
use tunnelstitch_geometry::camera::Cameras;
use tunnelstitch_geometry::surface::Surface;

/// Files of one panorama that is being drawn.
pub struct PanoramaFiles {
    pub(super) layout: Layout,
    pub(super) out: PathBuf,
    /// Bands that all files have received.
    pub(super) bands: usize,
    /// A PNG or JPEG, held in memory until the end.
    pub(super) picture: Option<(Panorama, PictureFormat)>,
    pub(super) cog: Option<RasterTarget>,
    pub(super) dzi: Option<RasterTarget>,
    pub(super) maps: Option<MapFiles>,
    pub(super) coverage: Coverage,
}

/// Files whose state is kept in a checkpoint between two bands when it is due.
pub struct CheckpointedFiles<'a> {
    /// The files.
    pub files: &'a mut PanoramaFiles,
    /// Their checkpoint.
    pub checkpoint: &'a mut Checkpoint,
}

impl Target for CheckpointedFiles<'_> {
    fn wants_sources(&self) -> bool {
        self.files.maps.is_some()
    }

    fn put(&mut self, canvas: &Canvas, band: &Band) -> Result<(), RenderError> {
        for target in self.files.targets() {
            target.put(canvas, band)?;
        }
        self.files.bands += 1;
        if self.checkpoint.is_due() {
            let state = self.files.state().map_err(RasterError::from)?;
            let kept = self.checkpoint.keep(STATE, &state);
            kept.map_err(RasterError::from)?;
        }
        Ok(())
    }
}

impl PanoramaFiles {
    /// Number of bands that are drawn already.
    pub fn bands(&self) -> usize {
        self.bands
    }

    /// State for the checkpoint.
    pub(super) fn state(&self) -> Result<FilesState<'_>, WriteError> {
        Ok(FilesState {
            bands: self.bands,
            coverage: Some(Cow::Borrowed(&self.coverage)),
            picture: self.picture.as_ref().map(|(drawn, _)| Cow::Borrowed(drawn)),
            cog: self.cog.as_ref().map(RasterTarget::state).transpose()?,
            dzi: self.dzi.as_ref().map(RasterTarget::state).transpose()?,
            maps: self.maps.as_ref().map(MapFiles::state).transpose()?,
        })
    }

    /// Everything that receives bands.
    fn targets(&mut self) -> Vec<&mut dyn Target> {
        let mut targets: Vec<&mut dyn Target> = vec![&mut self.coverage];
        if let Some((picture, _)) = &mut self.picture {
            targets.push(picture);
        }
        targets.extend(self.cog.as_mut().map(|cog| cog as &mut dyn Target));
        targets.extend(self.dzi.as_mut().map(|dzi| dzi as &mut dyn Target));
        if let Some(maps) = &mut self.maps {
            targets.extend(maps.targets());
        }
        targets
    }

    /// Share of the panorama that at least one frame sees, 0–1.
    pub fn coverage(&self) -> f64 {
        self.coverage.share()
    }

    /// Parts of the wall that no frame sees.
    pub fn gaps(&self, surface: &dyn Surface) -> Vec<Gap> {
        self.coverage.gaps(surface)
    }

    /// Adds all files to a set of outputs.
    ///
    /// `cameras` are those of the frames at full size, `covariances` those of their poses, if
    /// known.
    ///
    /// # Errors
    /// Whatever the system says.
    pub fn finish(
        self,
        outputs: &mut OutputSet,
        plan: &Plan,
        gaps: &[Gap],
        cameras: &Cameras,
        covariances: Option<&[Matrix6<f64>]>,
        wall: WallProperties,
    ) -> Result<(), RenderError> {
        if let Some(maps) = self.maps {
            maps.finish(outputs, plan, gaps, cameras, covariances, wall)?;
        }
        if let Some(cog) = self.cog {
            cog.finish(outputs)?;
        }
        if let Some((picture, format)) = self.picture {
            let image = picture.into_image(self.layout);
            add_picture(outputs, &self.out, &image, format).map_err(RasterError::from)?;
        }
        if let Some(dzi) = self.dzi {
            dzi.finish(outputs)?;
        }
        Ok(())
    }
}
