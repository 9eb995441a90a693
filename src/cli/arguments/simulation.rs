//! Arguments of simulated surveys: degradations, jitter and wall.

use crate::simulate::{BadFrames, BitDepth, SimulateOptions};
use crate::trajectory::JitterModel;
use clap::ValueEnum;

/// Degradations of a simulated survey; without any, light and sensor are ideal except for noise.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Degradations (none by default)")]
pub struct DegradationArguments {
    /// Auto-exposure: the gain of each frame is uniform in 1 ± P/100 [0 to less than 100].
    #[arg(long, value_name = "P", default_value_t = 0.0)]
    gain_percent: f64,
    /// The bias of each frame is uniform in ±B grey levels; grey level = gain × radiance + bias,
    /// before noise and saturation [0 to 255].
    #[arg(long, value_name = "B", default_value_t = 0.0)]
    bias_grey: f64,
    /// Shading by a lamp that moves with the camera, or by vignetting: brightest near the image
    /// centre, falling to this share of it in the darkest corner, as 0.4
    /// [above 0, up to 1: no shading]. Combine with --light even to have no other light.
    #[arg(long, value_name = "SHARE")]
    lamp_corner: Option<f64>,
    /// Damp patches of 5 to 30 cm on P percent of the wall: darker, with specular highlights of a
    /// lamp at the lens. The highlights move over the wall from frame to frame and may saturate
    /// [0 to 90].
    #[arg(long, value_name = "P", default_value_t = 0.0)]
    specular_percent: f64,
    /// Number of moving objects in each frame (drops, insects, shadows): dark or bright ellipses
    /// and lines of up to a tenth of the frame's height, at random positions.
    #[arg(long, value_name = "N", default_value_t = 0)]
    moving: u32,
    /// The carrier's dark shaft in front of the wall, fixed in the image, P percent of its width;
    /// the survey gets a mask that hides it [0 to 50].
    #[arg(long, value_name = "P", default_value_t = 0.0)]
    shaft_percent: f64,
    /// Bits per grey value. 16 bits store grey level × 257; --noise stays in 8-bit grey levels.
    #[arg(long, value_enum, default_value_t)]
    bits: BitsArgument,
    /// Faulty frames by index from 0: `frame:fault` or `from-to:fault`, separated by commas, as
    /// 5:black,9:blurred,12:occluded,15:repeated,18-20:missing. black: only noise; blurred: motion
    /// blur of 15 to 30 px; occluded: a dark object covers the left half; repeated: the picture of
    /// the previous frame, while the pose advances; missing: neither frame nor pose, the others
    /// keep their names and times.
    #[arg(long, value_name = "SPEC")]
    bad_frames: Option<BadFrames>,
}

/// Names of bit depths.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum BitsArgument {
    #[default]
    #[value(name = "8")]
    Eight,
    #[value(name = "16")]
    Sixteen,
}

impl DegradationArguments {
    /// Adds the degradations to the options of a simulation.
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

/// Names of noise models.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum JitterArgument {
    /// Errors add up from frame to frame.
    RandomWalk,
    /// The errors of different frames are independent.
    Independent,
}

impl From<JitterArgument> for JitterModel {
    fn from(jitter: JitterArgument) -> Self {
        match jitter {
            JitterArgument::RandomWalk => Self::RandomWalk,
            JitterArgument::Independent => Self::Independent,
        }
    }
}

/// Names of walls.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum WallArgument {
    /// Bricks of different brightness.
    #[default]
    Brick,
    /// Smooth stains of low contrast.
    Concrete,
    /// A repeated tile of 8 × 6 bricks: perceptual aliasing.
    TiledBrick,
    /// Dark and bright squares on mid grey, rotated by 5°: slanted edges for measuring sharpness
    /// after ISO 12233.
    Target,
}
