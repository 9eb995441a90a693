//! Arguments of panoramas: canvas, interpolation, and how frames are combined.

use super::numbers::positive;
use crate::render::{Interpolation, Layout, Mode, RenderOptions};
use clap::ValueEnum;

/// Canvas of panoramas.
#[derive(Debug, Default, clap::Args)]
pub struct CanvasArguments {
    /// Pixels per metre of wall [default: the frames' own resolution at the wall].
    #[arg(long, value_name = "N", value_parser = positive)]
    pub px_per_metre: Option<f64>,
    /// Orientation of the panorama in its file.
    #[arg(long, value_enum, default_value_t)]
    pub layout: LayoutArgument,
}

/// Canvas and interpolation of panoramas.
#[derive(Debug, Default, clap::Args)]
pub struct PictureArguments {
    /// The canvas.
    #[command(flatten)]
    pub canvas: CanvasArguments,
    /// Interpolation between the pixels of a frame.
    #[arg(long, value_enum, default_value_t)]
    pub interpolation: InterpolationArgument,
}

/// Combination of overlapping frames.
#[derive(Debug, clap::Args)]
pub struct BlendArguments {
    /// Which of the frames that see a point of the wall give its pixel.
    #[arg(long, value_enum, default_value_t)]
    mode: ModeArgument,
    /// Keep the frames' grey values: no exposure correction, no blending across seams. With
    /// --interpolation nearest, every pixel is an unchanged pixel of a frame.
    #[arg(long)]
    no_blend: bool,
    /// Multi-frame super-resolution: estimate the wall from all frames that see it, at twice their
    /// resolution. Needs poses accurate to some hundredths of a pixel, as refine gives them, and
    /// takes microseconds per pixel and frame.
    #[arg(
        long,
        value_name = "2",
        value_parser = clap::value_parser!(u8).range(2..=2),
        conflicts_with_all = ["no_blend", "mode"]
    )]
    super_resolve: Option<u8>,
}

impl BlendArguments {
    /// Options of the renderer.
    pub fn render_options(&self, interpolation: Interpolation) -> RenderOptions {
        RenderOptions {
            interpolation,
            mode: self.mode.into(),
            blend: !self.no_blend,
            super_resolve: self.super_resolve.is_some(),
        }
    }
}

/// Names of modes.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
enum ModeArgument {
    /// The frame with the best view of the wall; seams run where frames agree.
    #[default]
    BestView,
    /// The mean of all frames, weighted towards their centres: least noise.
    Average,
    /// The median of all frames: removes what only a few of them show.
    Median,
}

impl From<ModeArgument> for Mode {
    fn from(mode: ModeArgument) -> Self {
        match mode {
            ModeArgument::BestView => Self::BestView,
            ModeArgument::Average => Self::Average,
            ModeArgument::Median => Self::Median,
        }
    }
}

/// Names of layouts.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum LayoutArgument {
    /// Angle θ to the right, chainage down: the wall as seen from inside.
    #[default]
    ThetaRight,
    /// Turned by 90° counter-clockwise: chainage to the right, angle θ up.
    ChainageRight,
}

impl From<LayoutArgument> for Layout {
    fn from(layout: LayoutArgument) -> Self {
        match layout {
            LayoutArgument::ThetaRight => Self::ThetaRight,
            LayoutArgument::ChainageRight => Self::ChainageRight,
        }
    }
}

/// Names of interpolations.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub enum InterpolationArgument {
    /// Catmull–Rom: sharp.
    #[default]
    Bicubic,
    /// Softer and faster.
    Bilinear,
    /// Three lobes: sharpest and slowest, with slight ringing at edges.
    #[value(name = "lanczos3")]
    Lanczos3,
    /// The nearest pixel, unchanged.
    Nearest,
}

impl From<InterpolationArgument> for Interpolation {
    fn from(interpolation: InterpolationArgument) -> Self {
        match interpolation {
            InterpolationArgument::Bicubic => Self::Bicubic,
            InterpolationArgument::Bilinear => Self::Bilinear,
            InterpolationArgument::Lanczos3 => Self::Lanczos3,
            InterpolationArgument::Nearest => Self::Nearest,
        }
    }
}
