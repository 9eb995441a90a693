//! Maps beside a panorama: coverage, frames, resolution, uncertainty, deformation, masked wall,
//! preview and gaps.

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
use std::path::{Path, PathBuf};
use tunnelstitch_core::frames::{PictureFormat, add_picture};
use tunnelstitch_core::persist::atomic::{OutputSet, WriteError};
use tunnelstitch_core::raster::{Quantity, RasterError};
use tunnelstitch_geometry::camera::Cameras;
use tunnelstitch_geometry::surface::WallPoint;

pub(super) const COVERAGE: &str = "coverage.tif";
pub(super) const FRAMES: &str = "frames.tif";
const RESOLUTION: &str = "resolution.tif";
const UNCERTAINTY: &str = "uncertainty.tif";
const DEFORMATION: &str = "deformation.tif";
const DEFORMATION_SIGMA: &str = "deformation_sigma.tif";
const MASKED: &str = "masked.tif";
const PREVIEW: &str = "preview.png";
const GAPS: &str = "gaps.csv";

/// Names of all maps.
pub(super) const MAP_FILES: [&str; 9] = [
    COVERAGE,
    FRAMES,
    RESOLUTION,
    UNCERTAINTY,
    DEFORMATION,
    DEFORMATION_SIGMA,
    MASKED,
    PREVIEW,
    GAPS,
];

/// Deformation of the wall at a point and its 1-σ, millimetres; NaN where they are not known.
pub type DeformationAt<'d> = dyn Fn(WallPoint) -> [f32; 2] + Sync + 'd;

/// Share of the frames that were left out at a point of the wall, 0 to 1; NaN where no two frames
/// see it.
pub type MaskedAt<'m> = dyn Fn(WallPoint) -> f32 + Sync + 'm;

/// Properties of the wall that `refine` has found, by its points.
#[derive(Clone, Copy, Default)]
pub struct WallProperties<'w> {
    /// The deformation, if the wall is deformed.
    pub deformation: Option<&'w DeformationAt<'w>>,
    /// The share of the frames that were left out, if it is known.
    pub masked: Option<&'w MaskedAt<'w>>,
}

/// Maps that are being written.
pub(super) struct MapFiles {
    pub(super) folder: PathBuf,
    pub(super) layout: Layout,
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

    /// Takes over the maps of another part of the panorama, whose tiles are in `folder`.
    ///
    /// # Errors
    /// As [`RasterTarget::absorb`].
    pub(super) fn absorb(&mut self, part: MapsState, folder: &Path) -> Result<(), RasterError> {
        for (target, state, name) in [
            (&mut self.coverage, part.coverage, COVERAGE),
            (&mut self.frames, part.frames, FRAMES),
        ] {
            if let Some(state) = state {
                target.absorb(state, &folder.join(name))?;
            }
        }
        if let Some(preview) = part.preview {
            self.preview.absorb(&preview);
        }
        Ok(())
    }

    /// Maps that receive bands.
    pub(super) fn targets(&mut self) -> [&mut dyn Target; 3] {
        [&mut self.coverage, &mut self.frames, &mut self.preview]
    }

    /// Adds all maps to a set of outputs, with what is computed at the end. Those that this
    /// panorama does not have are removed: they would belong to another.
    ///
    /// # Errors
    /// Whatever the system says.
    pub(super) fn finish(
        self,
        outputs: &mut OutputSet,
        plan: &Plan,
        gaps: &[Gap],
        cameras: &Cameras,
        covariances: Option<&[Matrix6<f64>]>,
        wall: WallProperties,
    ) -> Result<(), RenderError> {
        let (surface, placements) = (plan.surface(), plan.placements());
        self.coverage.finish(outputs)?;
        self.frames.finish(outputs)?;
        let grid = plan.grid();
        let labels = plan.seams().map(|seams| seams.labels());
        let resolution = Map::resolution(surface, cameras, placements, &grid, labels);
        let uncertainty = covariances.map(|covariances| {
            Map::uncertainty(surface, cameras, placements, &grid, labels, covariances)
        });
        let deformation = |which: usize| {
            let of_wall = |at: &DeformationAt| Map::of_wall(&grid, |wall| at(wall)[which]);
            wall.deformation.map(of_wall)
        };
        let masked = wall.masked.map(|at| Map::of_wall(&grid, at));
        for (file, map, name, unit) in [
            (
                RESOLUTION,
                Some(resolution),
                "wall per pixel of the frame",
                "mm",
            ),
            (UNCERTAINTY, uncertainty, "1-sigma on the wall", "mm"),
            (
                DEFORMATION,
                deformation(0),
                "deviation outwards from the best-fit circle",
                "mm",
            ),
            (
                DEFORMATION_SIGMA,
                deformation(1),
                "1-sigma of the deviation",
                "mm",
            ),
            (MASKED, masked, "share of the frames that were left out", ""),
        ] {
            let path = self.folder.join(file);
            let quantity = Quantity { name, unit };
            match map {
                Some(map) => map.add_to(outputs, &path, self.layout, quantity)?,
                None => outputs.remove(&path).map_err(RasterError::from)?,
            }
        }
        let preview = DynamicImage::from(self.preview.picture(surface, self.layout, 0.0));
        let path = self.folder.join(PREVIEW);
        add_picture(outputs, &path, &preview, PictureFormat::Png).map_err(RasterError::from)?;
        let gaps = gaps_csv(gaps);
        let added = outputs.write_text(&self.folder.join(GAPS), &gaps);
        Ok(added.map_err(RasterError::from)?)
    }
}
