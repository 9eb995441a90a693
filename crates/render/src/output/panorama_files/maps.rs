//! Maps beside a panorama: coverage, frames, resolution, uncertainty, deformation, preview and
//! gaps.

use super::state::MapsState;
use crate::compositing::band::Target;
use crate::error::RenderError;
use crate::layout::canvas::Layout;
use crate::output::gaps::{Gap, gaps_csv};
use crate::output::maps::Map;
use crate::output::plan::Plan;
use crate::output::preview::Preview;
use crate::output::raster_target::RasterTarget;
use image::DynamicImage;
use nalgebra::Matrix6;
use std::borrow::Cow;
use std::path::PathBuf;
use tunnelstitch_core::frames::{PictureFormat, write_picture};
use tunnelstitch_core::persist::atomic::{self, WriteError};
use tunnelstitch_core::raster::RasterError;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::surface::WallPoint;

pub(super) const COVERAGE: &str = "coverage.tif";
pub(super) const FRAMES: &str = "frames.tif";
const RESOLUTION: &str = "resolution.tif";
const UNCERTAINTY: &str = "uncertainty.tif";
const DEFORMATION: &str = "deformation.tif";
const DEFORMATION_SIGMA: &str = "deformation_sigma.tif";
const PREVIEW: &str = "preview.png";
const GAPS: &str = "gaps.csv";

/// Names of all maps.
pub(super) const MAP_FILES: [&str; 8] = [
    COVERAGE,
    FRAMES,
    RESOLUTION,
    UNCERTAINTY,
    DEFORMATION,
    DEFORMATION_SIGMA,
    PREVIEW,
    GAPS,
];

/// Deformation of the wall at a point and its 1-σ, millimetres; NaN where they are not known.
pub type DeformationAt<'d> = dyn Fn(WallPoint) -> [f32; 2] + Sync + 'd;

/// Maps that are being written.
pub(super) struct MapFiles {
    pub(super) folder: PathBuf,
    pub(super) coverage: RasterTarget,
    pub(super) frames: RasterTarget,
    pub(super) preview: Preview,
}

impl MapFiles {
    /// State for the checkpoint.
    ///
    /// # Errors
    /// Whatever the system says.
    pub(super) fn state(&self) -> Result<MapsState<'_>, WriteError> {
        Ok(MapsState {
            coverage: Some(self.coverage.state()?),
            frames: Some(self.frames.state()?),
            preview: Some(Cow::Borrowed(&self.preview)),
        })
    }

    /// Maps that receive bands.
    pub(super) fn targets(&mut self) -> [&mut dyn Target; 3] {
        [&mut self.coverage, &mut self.frames, &mut self.preview]
    }

    /// Writes what is computed at the end and gives all maps their names.
    ///
    /// # Errors
    /// Whatever the system says.
    pub(super) fn finish(
        self,
        layout: Layout,
        plan: &Plan,
        gaps: &[Gap],
        camera: &Camera,
        covariances: Option<&[Matrix6<f64>]>,
        deformation: Option<&DeformationAt>,
    ) -> Result<(), RenderError> {
        let (surface, placements) = (plan.surface(), plan.placements());
        self.coverage.finish()?;
        self.frames.finish()?;
        let grid = plan.grid();
        let labels = plan.seams().map(|seams| seams.labels());
        let resolution = Map::resolution(surface, camera, placements, &grid, labels);
        resolution.write(&self.folder.join(RESOLUTION), layout)?;
        let uncertainty = self.folder.join(UNCERTAINTY);
        if let Some(covariances) = covariances {
            let map = Map::uncertainty(surface, camera, placements, &grid, labels, covariances);
            map.write(&uncertainty, layout)?;
        } else {
            // A map of an earlier panorama would belong to other poses.
            atomic::remove_file(&uncertainty).map_err(RasterError::from)?;
        }
        for (which, name) in [DEFORMATION, DEFORMATION_SIGMA].into_iter().enumerate() {
            let path = self.folder.join(name);
            if let Some(deformation) = deformation {
                let map = Map::of_wall(&grid, |wall| deformation(wall)[which]);
                map.write(&path, layout)?;
            } else {
                atomic::remove_file(&path).map_err(RasterError::from)?;
            }
        }
        let preview = DynamicImage::from(self.preview.picture(surface, layout, 0.0));
        write_picture(&self.folder.join(PREVIEW), &preview, PictureFormat::Png)
            .map_err(RasterError::from)?;
        atomic::write_text(&self.folder.join(GAPS), &gaps_csv(gaps)).map_err(RasterError::from)?;
        Ok(())
    }
}
