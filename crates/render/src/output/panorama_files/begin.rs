//! Begins the files of a panorama, or continues those of an interrupted run.

use super::files::PanoramaFiles;
use super::maps::{COVERAGE, FRAMES, MapFiles};
use super::options::PanoramaFileOptions;
use super::state::{FilesState, MapsState, PANORAMA, STATE};
use crate::error::RenderError;
use crate::layout::canvas::{Canvas, Layout};
use crate::output::gaps::Coverage;
use crate::output::panorama::Panorama;
use crate::output::preview::Preview;
use crate::output::raster_target::{Kept, RasterLayer, RasterState, RasterTarget};
use crate::sampling::pixel_format::PixelFormat;
use std::path::{Path, PathBuf};
use tunnelstitch_core::frames::PictureFormat;
use tunnelstitch_core::persist::checkpoint::Checkpoint;
use tunnelstitch_core::raster::{Compression, DziFormat, RasterError, files_folder};

/// Canvas, pixels and layout that all files of a panorama share.
struct FileBeginner<'a> {
    canvas: &'a Canvas,
    format: PixelFormat,
    layout: Layout,
    checkpoint: &'a Checkpoint,
}

impl FileBeginner<'_> {
    /// A GeoTIFF whose packed tiles the checkpoint keeps under `place`.
    fn cog(
        &self,
        path: &Path,
        layer: RasterLayer,
        compression: Compression,
        place: &str,
        state: Option<RasterState>,
    ) -> Result<RasterTarget, RasterError> {
        let place = self.checkpoint.file(place);
        let kept = Kept { place, state };
        let (canvas, format, layout) = (self.canvas, self.format, self.layout);
        RasterTarget::cog(path, canvas, format, layout, layer, compression, kept)
    }

    /// Maps in `folder`.
    fn maps(&self, folder: &Path, state: MapsState) -> Result<MapFiles, RasterError> {
        let cog = |name: &str, layer, state| {
            self.cog(&folder.join(name), layer, Compression::Deflate, name, state)
        };
        Ok(MapFiles {
            folder: folder.to_owned(),
            layout: self.layout,
            coverage: cog(COVERAGE, RasterLayer::Coverage, state.coverage)?,
            frames: cog(FRAMES, RasterLayer::Frames, state.frames)?,
            preview: match state.preview {
                Some(preview) => preview.into_owned(),
                None => Preview::new(self.canvas),
            },
        })
    }
}

impl PanoramaFileOptions {
    /// Begins all files, or continues them from the state that `checkpoint` keeps.
    ///
    /// # Errors
    /// Whatever the system says; a damaged checkpoint; 16-bit frames where a file holds 8 bits.
    pub fn begin(
        &self,
        canvas: &Canvas,
        format: PixelFormat,
        layout: Layout,
        checkpoint: &mut Checkpoint,
    ) -> Result<PanoramaFiles, RenderError> {
        let tiles = match &self.dzi {
            Some(path) => {
                let folder = checkpoint.folder_beside(&files_folder(path));
                Some((path, folder.map_err(RasterError::from)?))
            }
            None => None,
        };
        let state: FilesState = checkpoint.state(STATE)?.unwrap_or_default();
        let begin = FileBeginner {
            canvas,
            format,
            layout,
            checkpoint,
        };
        let maps = match &self.maps {
            Some(folder) => Some(begin.maps(folder, state.maps.unwrap_or_default())?),
            None => None,
        };
        let cog = if self.is_tiff() {
            let layer = RasterLayer::Panorama;
            let compression = self.compression;
            Some(begin.cog(&self.out, layer, compression, PANORAMA, state.cog)?)
        } else {
            None
        };
        let dzi = match tiles {
            Some((path, place)) => Some(self.begin_dzi(path, place, &begin, state.dzi)?),
            None => None,
        };
        Ok(PanoramaFiles {
            layout,
            out: self.out.clone(),
            bands: state.bands,
            picture: self.held_format().map(|picture| match state.picture {
                Some(drawn) => (drawn.into_owned(), picture),
                None => (Panorama::empty(*canvas, format), picture),
            }),
            cog,
            dzi,
            maps,
            coverage: match state.coverage {
                Some(coverage) => coverage.into_owned(),
                None => Coverage::new(canvas),
            },
        })
    }

    /// The Deep Zoom picture, its tiles in the folder `place` until they are complete.
    fn begin_dzi(
        &self,
        path: &Path,
        place: PathBuf,
        begin: &FileBeginner,
        state: Option<RasterState>,
    ) -> Result<RasterTarget, RasterError> {
        let kept = Kept { place, state };
        let jpeg = DziFormat::Jpeg {
            quality: self.quality,
        };
        RasterTarget::dzi(path, begin.canvas, begin.format, begin.layout, jpeg, kept)
    }

    /// Format of a panorama that is held in memory; none for a GeoTIFF.
    fn held_format(&self) -> Option<PictureFormat> {
        match PictureFormat::of(&self.out) {
            Ok(PictureFormat::Tiff) | Err(_) => None,
            Ok(PictureFormat::Jpeg { .. }) => Some(PictureFormat::Jpeg {
                quality: self.quality,
            }),
            Ok(png) => Some(png),
        }
    }
}
