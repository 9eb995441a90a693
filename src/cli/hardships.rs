//! What makes a simulated survey harder: light, sensor and bad frames.

use crate::simulate::{BadFrames, BitDepth, SimulateOptions};
use clap::ValueEnum;

/// Options of `tunnelstitch simulate`; without any, light and sensor are ideal but for the noise.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Hardships (none unless asked for)")]
pub struct HardshipArguments {
    /// Auto-exposure: each frame's gain is drawn from 1 ± P/100, evenly [0 to less than 100].
    #[arg(long, value_name = "P", default_value_t = 0.0)]
    gain_percent: f64,
    /// Each frame's bias is drawn from ±B grey levels, evenly; grey level = gain × light + bias,
    /// before noise and saturation [0 to 255].
    #[arg(long, value_name = "B", default_value_t = 0.0)]
    bias_grey: f64,
    /// A lamp that moves with the camera, or vignetting: full light a little off the middle of the
    /// frame, falling to this share of it in the darkest corner, as 0.4
    /// [above 0, up to 1: no shading]. For this light alone, add --light even.
    #[arg(long, value_name = "SHARE")]
    lamp_corner: Option<f64>,
    /// Damp patches of 5 to 30 cm on P percent of the wall: darker, and with glints of a lamp at
    /// the lens, which lie where the rippled water faces the camera, so elsewhere on the wall in
    /// every frame, and may saturate [0 to 90].
    #[arg(long, value_name = "P", default_value_t = 0.0)]
    specular_percent: f64,
    /// Things in each frame that are not on the wall (drops, insects, shadows): dark or bright
    /// ellipses and lines up to a tenth of the frame's height, elsewhere in every frame.
    #[arg(long, value_name = "N", default_value_t = 0)]
    moving: u32,
    /// The carrier's shaft before the wall, dark, at the same place of every frame, P percent of it
    /// wide; the survey gets a mask that says so [0 to 50].
    #[arg(long, value_name = "P", default_value_t = 0.0)]
    shaft_percent: f64,
    /// Bits of the frames' grey values. 16 bits hold grey level × 257, so they keep 1/257 of a grey
    /// level; --noise stays in grey levels of 8 bits.
    #[arg(long, value_enum, default_value_t)]
    bits: BitsArgument,
    /// Frames that are no good, by number from 0: items `frame:fault` or `from-to:fault` with
    /// commas between, as 5:black,9:blurred,12:occluded,15:repeated,18-20:missing. black: zero but
    /// for the noise; blurred: motion blur of 15 to 30 px; occluded: a dark object covers the left
    /// half; repeated: the picture of the frame before once more, while the pose goes on; missing:
    /// neither frame nor poses, the others keep names and times.
    #[arg(long, value_name = "SPEC")]
    bad_frames: Option<BadFrames>,
}

#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum BitsArgument {
    #[default]
    #[value(name = "8")]
    Eight,
    #[value(name = "16")]
    Sixteen,
}

impl HardshipArguments {
    /// The same survey, made harder.
    pub fn add_to(&self, options: SimulateOptions) -> SimulateOptions {
        SimulateOptions {
            gain_percent: self.gain_percent,
            bias_grey: self.bias_grey,
            lamp_corner: self.lamp_corner,
            specular_percent: self.specular_percent,
            moving: self.moving,
            shaft_percent: self.shaft_percent,
            bits: match self.bits {
                BitsArgument::Eight => BitDepth::Eight,
                BitsArgument::Sixteen => BitDepth::Sixteen,
            },
            bad_frames: self.bad_frames.clone().unwrap_or_default(),
            ..options
        }
    }
}
