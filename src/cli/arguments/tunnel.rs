//! Arguments of a tunnel: section and centreline.

use super::input_file::input_file;
use super::numbers::positive;
use crate::survey::{Shape, TunnelSection};
use clap::ValueEnum;
use std::path::PathBuf;

/// Section and centreline of the tunnel.
#[derive(Debug, clap::Args)]
pub struct TunnelArguments {
    /// Cross-section of the tunnel.
    #[arg(long, value_enum, default_value_t)]
    shape: ShapeArgument,
    /// Radius of a circular section, metres [default: 3].
    #[arg(long, value_name = "M", value_parser = positive)]
    radius_m: Option<f64>,
    /// Width of any other section, metres.
    #[arg(long, value_name = "M", value_parser = positive)]
    width_m: Option<f64>,
    /// Height of any other section, metres.
    #[arg(long, value_name = "M", value_parser = positive)]
    height_m: Option<f64>,
    /// File with the centreline of a curved tunnel, one point a line: `x y z [radius]`, metres.
    #[arg(long, value_name = "FILE", value_parser = input_file())]
    centreline: Option<PathBuf>,
}

/// Names of sections.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum ShapeArgument {
    /// Circle.
    #[default]
    Circle,
    /// Ellipse with horizontal and vertical axes.
    Ellipse,
    /// A rectangle: an underpass, a culvert, a room.
    Box,
    /// A round arch on straight walls and a flat floor.
    Horseshoe,
}

/// Default radius of a circular section, metres: that of the paper.
const DEFAULT_RADIUS_M: f64 = 3.0;

impl TunnelArguments {
    /// The table `[tunnel]` of a survey.
    pub fn section(&self) -> TunnelSection {
        let shape = match self.shape {
            ShapeArgument::Circle => Shape::Circle,
            ShapeArgument::Ellipse => Shape::Ellipse,
            ShapeArgument::Box => Shape::Box,
            ShapeArgument::Horseshoe => Shape::Horseshoe,
        };
        let default_m = (shape == Shape::Circle).then_some(DEFAULT_RADIUS_M);
        TunnelSection {
            shape,
            radius_m: self.radius_m.or(default_m),
            width_m: self.width_m,
            height_m: self.height_m,
            centreline: self.centreline.clone(),
            shape_file: None,
            points: None,
            shape_sigma_mm: None,
            radius_sigma_percent: None,
            ignore: Vec::new(),
        }
    }
}
