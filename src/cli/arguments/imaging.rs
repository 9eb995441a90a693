//! Arguments of a simulated survey's lamp, lens, sensor and files.

use crate::cli::arguments::numbers::numbers;
use crate::simulate::{CameraLamp, Flicker, FrameEffects, OverlayParts, SimulateOptions};
use clap::ValueEnum;

/// Light, lens, sensor and files as those of real pictures; by default they are ideal.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Real pictures (ideal by default)")]
pub struct ImagingArguments {
    /// Lamp that is fixed to the camera at X,Y,Z (metres, in its frame: right, down, ahead). It
    /// multiplies the wall's radiance by cos(incidence)/distance², relative to that of the nearest
    /// wall ahead. Combine with --light even to have no other light.
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = numbers::<3>)]
    lamp_offset_m: Option<[f64; 3]>,
    /// Specular reflection of that lamp on the wall, percent of white at the nearest wall ahead
    /// (Blinn–Phong, exponent 30) [0 to 100].
    #[arg(
        long,
        value_name = "P",
        default_value_t = 0.0,
        requires = "lamp_offset_m"
    )]
    sheen_percent: f64,
    /// Interlaced frames: odd rows are taken half of the interval between frames after the even
    /// ones, whose poses are the true ones.
    #[arg(long)]
    interlaced: bool,
    /// Motion blur during the exposure, along the path of the frames: wall points move by PX pixels
    /// in the mean. If frames move by less than PX from one to the next, the camera shakes in a
    /// random direction instead [0 to 100].
    #[arg(long, value_name = "PX", default_value_t = 0.0)]
    motion_blur_px: f64,
    /// Lens out of focus: Gaussian blur of this sigma, pixels [0 to 50].
    #[arg(long, value_name = "PX", default_value_t = 0.0)]
    defocus_px: f64,
    /// Dust on the lens: dark soft specks, the same in all frames, on P percent of the picture
    /// [0 to 50].
    #[arg(long, value_name = "P", default_value_t = 0.0)]
    dust_percent: f64,
    /// Flicker of mains light under a rolling exposure: rows are brighter and darker by P percent,
    /// in bands, with a random phase in each frame [0 to 100].
    #[arg(long, value_name = "P")]
    flicker_percent: Option<f64>,
    /// Number of flicker bands over the height of a frame.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 2.5,
        requires = "flicker_percent"
    )]
    flicker_bands: f64,
    /// Exposure that changes at about every tenth frame by a random factor between 1/F and F, and
    /// stays; it remains between 1/F and F times that of the first frame [1 to 16].
    #[arg(long, value_name = "F")]
    exposure_step: Option<f64>,
    /// Little light: the mean grey level is about 12, with the noise of a bright picture.
    #[arg(long)]
    dark: bool,
    /// Tone curve of the sensor, after noise: 255 (x/255)^(1/G) [0.2 to 5].
    #[arg(long, value_name = "G")]
    gamma: Option<f64>,
    /// Overlay that is burnt into the frames. overlay.png is black where any frame has it; the
    /// survey does not mention it.
    #[arg(long, value_enum, value_name = "PARTS")]
    overlay: Option<OverlayArgument>,
    /// Write the frames as JPEG files of this quality instead of PNG [1 to 100].
    #[arg(long, value_name = "Q", value_parser = clap::value_parser!(u8).range(1..=100))]
    jpeg_quality: Option<u8>,
}

/// Names of the parts of an overlay.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum OverlayArgument {
    /// Lines of text; the last has date, time and a counter.
    Text,
    /// A logo in the upper right corner.
    Logo,
    /// Text and logo.
    Both,
}

impl From<OverlayArgument> for OverlayParts {
    fn from(parts: OverlayArgument) -> Self {
        match parts {
            OverlayArgument::Text => Self::Text,
            OverlayArgument::Logo => Self::Logo,
            OverlayArgument::Both => Self::Both,
        }
    }
}

impl ImagingArguments {
    /// Adds lamp, lens, sensor and files to the options of a simulation.
    pub fn add_to(&self, options: SimulateOptions) -> SimulateOptions {
        let lamp = |offset_m| CameraLamp {
            offset_m,
            sheen_percent: self.sheen_percent,
        };
        let flicker = |percent| Flicker {
            percent,
            bands: self.flicker_bands,
        };
        SimulateOptions {
            camera_lamp: self.lamp_offset_m.map(lamp),
            interlaced: self.interlaced,
            effects: FrameEffects {
                overlay: self.overlay.map(OverlayParts::from),
                flicker: self.flicker_percent.map(flicker),
                gamma: self.gamma,
                exposure_step: self.exposure_step,
                motion_blur_px: self.motion_blur_px,
                defocus_px: self.defocus_px,
                jpeg_quality: self.jpeg_quality,
                dust_percent: self.dust_percent,
                dark: self.dark,
            },
            ..options
        }
    }
}
