//! Names and formats of a panorama's files.

use super::maps::MAP_FILES;
use crate::layout::canvas::{Canvas, Layout};
use crate::output::gaps::Coverage;
use crate::output::preview::Preview;
use crate::output::raster_target::{RasterLayer, RasterTarget};
use crate::sampling::pixel_format::PixelFormat;
use std::path::PathBuf;
use tunnelstitch_core::frames::PictureFormat;
use tunnelstitch_core::raster::{Compression, files_folder};

/// Names and formats of a panorama's files.
#[derive(Clone, Debug)]
pub struct PanoramaFileOptions {
    /// The panorama: .tif, .png or .jpg.
    pub out: PathBuf,
    /// The Deep Zoom picture, ending in .dzi, if it is wanted.
    pub dzi: Option<PathBuf>,
    /// Folder of the maps, if they are wanted.
    pub maps: Option<PathBuf>,
    /// Compression of a .tif.
    pub compression: Compression,
    /// Quality of JPEG, 1–100: of a .jpg and of the Deep Zoom picture.
    pub quality: u8,
}

impl PanoramaFileOptions {
    /// All files and folders that are written.
    pub fn paths(&self) -> Vec<PathBuf> {
        let mut paths = vec![self.out.clone()];
        if let Some(dzi) = &self.dzi {
            paths.extend([dzi.clone(), files_folder(dzi)]);
        }
        if let Some(folder) = &self.maps {
            paths.extend(MAP_FILES.map(|name| folder.join(name)));
        }
        paths
    }

    /// Memory that the files hold until they are finished, bytes.
    pub fn pending_bytes(&self, canvas: &Canvas, format: PixelFormat, layout: Layout) -> u64 {
        let pending = |layer| RasterTarget::pending_bytes(canvas, format, layout, layer);
        let mut bytes = if self.is_tiff() {
            pending(RasterLayer::Panorama)
        } else {
            2 * canvas.pixels() as u64 * format.pixel_bytes(true) as u64
        };
        if self.dzi.is_some() {
            bytes += pending(RasterLayer::Panorama);
        }
        if self.maps.is_some() {
            bytes += pending(RasterLayer::Coverage) + pending(RasterLayer::Frames);
            bytes += Preview::bytes(canvas);
        }
        bytes + Coverage::bytes(canvas)
    }

    /// True if the panorama is a GeoTIFF, which is written as it is drawn.
    pub fn is_tiff(&self) -> bool {
        matches!(PictureFormat::of(&self.out), Ok(PictureFormat::Tiff))
    }

    /// True if the panorama is a JPEG file.
    pub fn is_jpeg(&self) -> bool {
        matches!(PictureFormat::of(&self.out), Ok(PictureFormat::Jpeg { .. }))
    }
}
