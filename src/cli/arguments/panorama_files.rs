//! Arguments of a panorama's files.

use super::input_file::input_file;
use crate::cli::output::{
    Failure, check_parent_folder, picture_format, record, refuse_overwriting, survey_files,
};
use crate::files::printed;
use crate::frames::{JPEG_LIMIT_PX, JPEG_QUALITY};
use crate::persist::atomic;
use crate::raster::Compression;
use crate::render::{Canvas, Layout, PanoramaFileOptions, PixelFormat};
use crate::survey::Survey;
use std::path::PathBuf;

/// Files of a panorama.
#[derive(Clone, Debug, clap::Args)]
pub struct OutputArguments {
    /// The panorama. The extension chooses the format: .tif is a Cloud-Optimised GeoTIFF of any
    /// length, in metres; .png and .jpg are held in memory. A .jpg is black where no frame sees the
    /// wall. - writes a PNG on standard output. With --seams and --shard, the folder of the parts.
    #[arg(long, short, value_name = "FILE")]
    pub out: PathBuf,
    /// Also write a Deep Zoom picture for viewers in a browser. FILE must end in .dzi; its tiles
    /// are written beside it.
    #[arg(long, value_name = "FILE")]
    dzi: Option<PathBuf>,
    /// Also write maps into DIR: coverage.tif, frames.tif (index of the frame that each pixel
    /// shows), resolution.tif (mm of wall per pixel of that frame), uncertainty.tif (1-σ of the
    /// position on the wall, mm; needs --covariance), deformation.tif and deformation_sigma.tif
    /// (deviation of the wall from the best-fit circle of its section, outwards, and 1-σ, mm; if
    /// refine has found that the wall is deformed), masked.tif (share of the frames that refine has
    /// left out because they show something else than the wall, 0 to 1; from masked.json beside the
    /// poses), preview.png with chainage and clock positions, gaps.csv.
    #[arg(long, value_name = "DIR")]
    maps: Option<PathBuf>,
    /// The covariance.csv that refine writes beside the poses
    /// [default: the one in the folder of the file of --poses].
    #[arg(long, value_name = "FILE", requires = "maps", value_parser = input_file())]
    pub covariance: Option<PathBuf>,
    /// Compression of a .tif.
    #[arg(long, value_enum, default_value_t)]
    compression: CompressionArgument,
    /// Quality of JPEG (.jpg, --compression jpeg, --dzi), 1 to 100.
    #[arg(
        long,
        value_name = "N",
        default_value_t = JPEG_QUALITY,
        value_parser = clap::value_parser!(u8).range(1..=100)
    )]
    quality: u8,
}

/// Names of compressions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
enum CompressionArgument {
    /// Lossless.
    #[default]
    Deflate,
    /// Lossy, 8 bits: a tenth of the size, and faster.
    Jpeg,
}

impl OutputArguments {
    /// Checks names and folders before any work is done.
    ///
    /// # Errors
    /// An extension of no supported format; a path that is a folder; a folder that cannot be
    /// created.
    pub fn check_names(&self) -> Result<(), Failure> {
        picture_format(&self.out)?;
        if let Some(dzi) = &self.dzi {
            if dzi.extension().is_none_or(|extension| extension != "dzi") {
                return Err(Failure::usage(format!(
                    "--dzi {}: the name must end in .dzi",
                    printed(dzi)
                )));
            }
            check_parent_folder(dzi)?;
        }
        if let Some(folder) = &self.maps {
            atomic::check_folder(folder)?;
        }
        Ok(())
    }

    /// Checks the folder into which parts of a panorama are written.
    ///
    /// # Errors
    /// A file of that name; a folder that cannot be created.
    pub fn check_folder_of_parts(&self) -> Result<(), Failure> {
        Ok(atomic::check_folder(&self.out)?)
    }

    /// Checks names as [`OutputArguments::check_names`] does, of a panorama that is put together
    /// from parts: a GeoTIFF.
    ///
    /// # Errors
    /// Those of [`OutputArguments::check_names`]; another format.
    pub fn check_name_of_tiff(&self) -> Result<(), Failure> {
        self.check_names()?;
        if self.options().is_tiff() {
            return Ok(());
        }
        Err(Failure::usage(format!(
            "--out {}: with --join the name must end in .tif; a picture of another format is drawn \
             as a whole",
            printed(&self.out)
        )))
    }

    /// Refuses outputs that would replace one another or a file of the survey.
    ///
    /// # Errors
    /// The two names.
    pub fn check_overwriting(&self, survey: &Survey) -> Result<(), Failure> {
        let mut inputs = survey_files(survey);
        inputs.extend(self.covariance.clone());
        refuse_overwriting(&self.paths(), inputs)
    }

    /// Checks that the formats can hold the frames' bits and the size of the canvas.
    ///
    /// # Errors
    /// 16-bit frames where only 8 bits can be written; a JPEG file that is too large.
    pub fn check_formats(
        &self,
        canvas: &Canvas,
        format: PixelFormat,
        layout: Layout,
    ) -> Result<(), Failure> {
        let options = self.options();
        let lossy_tiff = options.is_tiff() && self.compression == CompressionArgument::Jpeg;
        let eight_bit_outputs = [
            (options.is_jpeg(), "a .jpg", "write .png or .tif"),
            (
                lossy_tiff,
                "--compression jpeg",
                "use --compression deflate",
            ),
            (self.dzi.is_some(), "--dzi", "leave it out"),
        ];
        let wanted = eight_bit_outputs.iter().find(|(wanted, ..)| *wanted);
        if let Some((_, output, remedy)) = wanted.filter(|_| format.deep) {
            return Err(Failure::usage(format!(
                "the frames have 16 bits, and {output} holds 8: {remedy}"
            )));
        }
        let [width, height] = layout.size(canvas);
        if options.is_jpeg() && width.max(height) > JPEG_LIMIT_PX {
            return Err(Failure::usage(format!(
                "{}: {width} × {height} px are more than a JPEG file holds; write .tif, or lower \
                 --px-per-metre",
                printed(&self.out)
            )));
        }
        Ok(())
    }

    /// All files and folders that are written.
    pub fn paths(&self) -> Vec<PathBuf> {
        let mut paths = self.options().paths();
        paths.insert(1, self.run_file());
        paths
    }

    /// The files with the panorama in another one.
    pub fn with_panorama(&self, out: PathBuf) -> Self {
        Self {
            out,
            ..self.clone()
        }
    }

    /// Path of the record of the run.
    pub fn run_file(&self) -> PathBuf {
        record::path_beside(&self.out)
    }

    /// True if maps are written.
    pub fn has_maps(&self) -> bool {
        self.maps.is_some()
    }

    /// Names and formats for the library.
    pub fn options(&self) -> PanoramaFileOptions {
        PanoramaFileOptions {
            out: self.out.clone(),
            dzi: self.dzi.clone(),
            maps: self.maps.clone(),
            compression: match self.compression {
                CompressionArgument::Deflate => Compression::Deflate,
                CompressionArgument::Jpeg => Compression::Jpeg {
                    quality: self.quality,
                },
            },
            quality: self.quality,
        }
    }
}
