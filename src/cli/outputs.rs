//! Where a panorama goes: one picture in memory, or files that are written as it is drawn, and maps beside it.

use super::Failure;
use super::record::RUN_FILE;
use super::stitch::picture_output;
use crate::atomic;
use crate::camera::Camera;
use crate::frames::{JPEG_LIMIT_PX, JPEG_QUALITY, PictureFormat, write_picture};
use crate::raster::{Compression, DziFormat};
use crate::render::{
    Canvas, Coverage, Gap, Layout, Map, Panorama, PixelFormat, Plan, Preview, RasterLayer,
    RasterTarget, Target, gaps_csv,
};
use crate::survey::Survey;
use image::DynamicImage;
use nalgebra::Matrix6;
use std::path::{Path, PathBuf};

/// Files of a panorama.
#[derive(Debug, clap::Args)]
pub struct OutputArguments {
    /// The panorama: .tif (any length: Cloud-Optimised GeoTIFF, metric), .png or .jpg (held in memory; a .jpg is black where no
    /// frame sees the wall).
    #[arg(long, short, value_name = "FILE")]
    pub out: PathBuf,
    /// Also write it as Deep Zoom, for viewers in a browser: FILE must end in .dzi, its tiles lie beside it.
    #[arg(long, value_name = "FILE")]
    dzi: Option<PathBuf>,
    /// Also write maps into DIR: coverage.tif, frames.tif (the index of the frame that each pixel shows), resolution.tif (mm of
    /// wall per pixel of that frame), uncertainty.tif (1-σ on the wall, mm; needs --covariance), preview.png with
    /// chainage and clock positions, gaps.csv.
    #[arg(long, value_name = "DIR")]
    maps: Option<PathBuf>,
    /// The covariance.csv that refine wrote beside the poses [default: the one in the folder of the file of --poses].
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

/// The outputs of one panorama, begun.
pub struct Outputs {
    layout: Layout,
    out: PathBuf,
    picture: Option<(Panorama, PictureFormat)>,
    cog: Option<RasterTarget>,
    dzi: Option<RasterTarget>,
    maps: Option<Maps>,
    coverage: Coverage,
}

/// The maps beside it.
struct Maps {
    folder: PathBuf,
    coverage: RasterTarget,
    frames: RasterTarget,
    preview: Preview,
}

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

    /// The record of how the panorama was made: its name with `.run.toml` added.
    pub fn run_file(&self) -> PathBuf {
        let mut name = self.out.clone().into_os_string();
        name.push(".");
        name.push(RUN_FILE);
        name.into()
    }

    /// Everything that is written.
    fn paths(&self) -> Vec<PathBuf> {
        let mut paths = vec![self.out.clone(), self.run_file()];
        if let Some(dzi) = &self.dzi {
            let mut tiles = dzi.with_extension("").into_os_string();
            tiles.push("_files");
            paths.extend([dzi.clone(), tiles.into()]);
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
        let mut bytes = match self.is_tiff() {
            true => pending(RasterLayer::Panorama),
            // The picture, and what turning or encoding makes of it.
            false => 2 * canvas.pixels() as u64 * format.pixel_bytes(true) as u64,
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

    /// Begins all files.
    ///
    /// # Errors
    /// Whatever the system says; frames of 16 bits where only 8 can be written.
    pub fn begin(
        &self,
        canvas: &Canvas,
        format: PixelFormat,
        layout: Layout,
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
        let cog = |path: &Path, layer, compression| {
            RasterTarget::cog(path, canvas, format, layout, layer, compression)
        };
        let picture = match picture_format {
            Ok(PictureFormat::Tiff) | Err(_) => None,
            Ok(PictureFormat::Jpeg { .. }) => Some(PictureFormat::Jpeg {
                quality: self.quality,
            }),
            Ok(png) => Some(png),
        };
        let maps = match &self.maps {
            Some(folder) => Some(Maps {
                folder: folder.clone(),
                coverage: cog(
                    &folder.join(COVERAGE),
                    RasterLayer::Coverage,
                    Compression::Deflate,
                )?,
                frames: cog(
                    &folder.join(FRAMES),
                    RasterLayer::Frames,
                    Compression::Deflate,
                )?,
                preview: Preview::new(canvas),
            }),
            None => None,
        };
        let dzi = DziFormat::Jpeg {
            quality: self.quality,
        };
        Ok(Outputs {
            layout,
            out: self.out.clone(),
            cog: match self.is_tiff() {
                true => Some(cog(&self.out, RasterLayer::Panorama, compression)?),
                false => None,
            },
            picture: picture.map(|picture| (Panorama::empty(*canvas, format), picture)),
            dzi: match &self.dzi {
                Some(path) => Some(RasterTarget::dzi(path, canvas, format, layout, dzi)?),
                None => None,
            },
            maps,
            coverage: Coverage::new(canvas),
        })
    }
}

impl Outputs {
    /// Everything that wants bands.
    pub fn targets(&mut self) -> Vec<&mut dyn Target> {
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
    pub fn gaps(&self) -> Vec<Gap> {
        self.coverage.gaps()
    }

    /// Gives all files their names; the panorama last. `camera`: that of the frames as they are; `covariances`: those of their
    /// poses, if known.
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
        let preview = DynamicImage::from(self.preview.picture(layout, 0.0));
        write_picture(&self.folder.join(PREVIEW), &preview, PictureFormat::Png)?;
        atomic::write_text(&self.folder.join(GAPS), &gaps_csv(gaps))?;
        Ok(())
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
