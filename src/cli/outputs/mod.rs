//! Where a panorama goes: one picture in memory, or files that are written as it is drawn, and maps
//! beside it.

mod files;

pub use files::{Keeping, Outputs};

use super::stitch::picture_output;
use super::{Failure, record};
use crate::frames::{JPEG_LIMIT_PX, JPEG_QUALITY, PictureFormat};
use crate::persist::atomic;
use crate::persist::checkpoint::Checkpoint;
use crate::raster::{Compression, DziFormat, files_folder};
use crate::render::{
    Canvas, Coverage, Kept, Layout, Panorama, PixelFormat, Preview, RasterLayer, RasterTarget,
};
use crate::survey::Survey;
use files::{FilesState, Maps, STATE};
use std::path::{Path, PathBuf};

/// Files of a panorama.
#[derive(Debug, clap::Args)]
pub struct OutputArguments {
    /// The panorama: .tif (any length: Cloud-Optimised GeoTIFF, metric), .png or .jpg (held in
    /// memory; a .jpg is black where no frame sees the wall).
    #[arg(long, short, value_name = "FILE")]
    pub out: PathBuf,
    /// Also write it as Deep Zoom, for viewers in a browser: FILE must end in .dzi, its tiles lie
    /// beside it.
    #[arg(long, value_name = "FILE")]
    dzi: Option<PathBuf>,
    /// Also write maps into DIR: coverage.tif, frames.tif (the index of the frame that each pixel
    /// shows), resolution.tif (mm of wall per pixel of that frame), uncertainty.tif (1-σ on the
    /// wall, mm; needs --covariance), preview.png with chainage and clock positions, gaps.csv.
    #[arg(long, value_name = "DIR")]
    maps: Option<PathBuf>,
    /// The covariance.csv that refine wrote beside the poses
    /// [default: the one in the folder of the file of --poses].
    #[arg(long, value_name = "FILE", requires = "maps")]
    pub covariance: Option<PathBuf>,
    /// How .tif is packed.
    #[arg(long, value_enum, default_value_t)]
    compression: CompressionArgument,
    /// Quality of JPEG (.jpg, --compression jpeg, --dzi), 1 to 100.
    #[arg(long, value_name = "N", default_value_t = JPEG_QUALITY, value_parser = clap::value_parser!(u8).range(1..=100))]
    quality: u8,
}

/// Compressions by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
enum CompressionArgument {
    /// Without loss.
    #[default]
    Deflate,
    /// With loss, 8 bits: a tenth of the size, and faster.
    Jpeg,
}

const COVERAGE: &str = "coverage.tif";
const FRAMES: &str = "frames.tif";
const RESOLUTION: &str = "resolution.tif";
const UNCERTAINTY: &str = "uncertainty.tif";
const PREVIEW: &str = "preview.png";
const GAPS: &str = "gaps.csv";

/// Names of all maps.
const MAPS: [&str; 6] = [COVERAGE, FRAMES, RESOLUTION, UNCERTAINTY, PREVIEW, GAPS];

impl OutputArguments {
    /// Checks the names, before any work is done; folders are made if missing.
    ///
    /// # Errors
    /// A name that says no format or belongs to a folder; a folder that cannot be made.
    pub fn check(&self) -> Result<(), Failure> {
        picture_output(&self.out)?;
        if let Some(dzi) = &self.dzi {
            if dzi.extension().is_none_or(|extension| extension != "dzi") {
                return Err(Failure::usage(format!(
                    "--dzi {}: the name must end in .dzi",
                    dzi.display()
                )));
            }
            super::stitch::parent_folder(dzi)?;
        }
        if let Some(folder) = &self.maps {
            atomic::create_folder(folder)?;
        }
        Ok(())
    }

    /// Refuses outputs that would replace one another, or what the survey is made of.
    ///
    /// # Errors
    /// The two names.
    pub fn check_apart(&self, survey: &Survey) -> Result<(), Failure> {
        let mut inputs: Vec<PathBuf> = {
            let frames = survey.frames.iter();
            frames.map(|frame| frame.file().to_owned()).collect()
        };
        inputs.extend_from_slice(survey.own_files());
        inputs.extend(self.covariance.clone());
        let mut taken: Vec<PathBuf> = inputs.iter().map(|path| full(path)).collect();
        for output in self.paths() {
            let place = full(&output);
            // A folder of tiles replaces all that is in it.
            let other = taken.iter().find(|other| other.starts_with(&place));
            if let Some(other) = other {
                return Err(Failure::usage(format!(
                    "{}: would replace {}; choose another name",
                    output.display(),
                    other.display()
                )));
            }
            taken.push(place);
        }
        Ok(())
    }

    /// The record of how the panorama was made.
    pub fn run_file(&self) -> PathBuf {
        record::beside(&self.out)
    }

    /// Everything that is written.
    fn paths(&self) -> Vec<PathBuf> {
        let mut paths = vec![self.out.clone(), self.run_file()];
        if let Some(dzi) = &self.dzi {
            paths.extend([dzi.clone(), files_folder(dzi)]);
        }
        if let Some(folder) = &self.maps {
            paths.extend(MAPS.map(|name| folder.join(name)));
        }
        paths
    }

    /// Whether there are to be maps.
    pub fn wants_maps(&self) -> bool {
        self.maps.is_some()
    }

    /// Memory that the outputs hold until they are finished, bytes.
    pub fn bytes(&self, canvas: &Canvas, format: PixelFormat, layout: Layout) -> u64 {
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

    fn is_tiff(&self) -> bool {
        matches!(PictureFormat::of(&self.out), Ok(PictureFormat::Tiff))
    }

    /// Begins all files, or goes on with them as `checkpoint` has them.
    ///
    /// # Errors
    /// Whatever the system says; frames of 16 bits where only 8 can be written.
    pub fn begin(
        &self,
        canvas: &Canvas,
        format: PixelFormat,
        layout: Layout,
        checkpoint: &mut Checkpoint,
    ) -> Result<Outputs, Failure> {
        let compression = match self.compression {
            CompressionArgument::Deflate => Compression::Deflate,
            CompressionArgument::Jpeg => Compression::Jpeg {
                quality: self.quality,
            },
        };
        let picture_format = PictureFormat::of(&self.out);
        let jpg = matches!(picture_format, Ok(PictureFormat::Jpeg { .. }));
        let packed = self.is_tiff() && self.compression == CompressionArgument::Jpeg;
        let narrow = [
            (jpg, "a .jpg", "write .png or .tif"),
            (packed, "--compression jpeg", "use --compression deflate"),
            (self.dzi.is_some(), "--dzi", "leave it out"),
        ];
        if let Some((_, what, remedy)) = narrow.iter().find(|(wanted, ..)| *wanted && format.deep) {
            return Err(Failure::usage(format!(
                "the frames have 16 bits, and {what} holds 8: {remedy}"
            )));
        }
        let [width, height] = layout.size(canvas);
        if jpg && width.max(height) > JPEG_LIMIT_PX {
            return Err(Failure::usage(format!(
                "{}: {width} × {height} px are more than a JPEG file holds; write .tif, or lower --px-per-metre",
                self.out.display()
            )));
        }
        let picture = match picture_format {
            Ok(PictureFormat::Tiff) | Err(_) => None,
            Ok(PictureFormat::Jpeg { .. }) => Some(PictureFormat::Jpeg {
                quality: self.quality,
            }),
            Ok(png) => Some(png),
        };
        let tiles = match &self.dzi {
            Some(path) => Some(checkpoint.folder_beside(&files_folder(path))?),
            None => None,
        };
        let kept: FilesState = checkpoint.state(STATE)?.unwrap_or_default();
        let cog = |path: &Path, layer, compression, place: &str, state| {
            let place = checkpoint.file(place);
            let kept = Kept { place, state };
            RasterTarget::cog(path, canvas, format, layout, layer, compression, kept)
        };
        let maps = match &self.maps {
            Some(folder) => {
                let path = |name: &str| folder.join(name);
                let maps = kept.maps.unwrap_or_default();
                let (coverage, frames) = (RasterLayer::Coverage, RasterLayer::Frames);
                let deflate = Compression::Deflate;
                Some(Maps {
                    folder: folder.clone(),
                    coverage: cog(&path(COVERAGE), coverage, deflate, COVERAGE, maps.coverage)?,
                    frames: cog(&path(FRAMES), frames, deflate, FRAMES, maps.frames)?,
                    preview: match maps.preview {
                        Some(preview) => preview.into_owned(),
                        None => Preview::new(canvas),
                    },
                })
            }
            None => None,
        };
        let dzi_format = DziFormat::Jpeg {
            quality: self.quality,
        };
        let panorama = RasterLayer::Panorama;
        Ok(Outputs {
            layout,
            out: self.out.clone(),
            bands: kept.bands,
            cog: if self.is_tiff() {
                Some(cog(&self.out, panorama, compression, "panorama", kept.cog)?)
            } else {
                None
            },
            picture: picture.map(|picture| match kept.picture {
                Some(drawn) => (drawn.into_owned(), picture),
                None => (Panorama::empty(*canvas, format), picture),
            }),
            dzi: match (&self.dzi, tiles) {
                (Some(path), Some(place)) => {
                    let state = kept.dzi;
                    let kept = Kept { place, state };
                    let dzi = RasterTarget::dzi(path, canvas, format, layout, dzi_format, kept)?;
                    Some(dzi)
                }
                _ => None,
            },
            maps,
            coverage: match kept.coverage {
                Some(coverage) => coverage.into_owned(),
                None => Coverage::new(canvas),
            },
        })
    }
}

/// A name in full, of a file that may not be there yet.
fn full(path: &Path) -> PathBuf {
    if let Ok(full) = path.canonicalize() {
        return full;
    }
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.canonicalize(),
        _ => Path::new(".").canonicalize(),
    };
    match (folder, path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => path.to_owned(),
    }
}
