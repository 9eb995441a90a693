//! The shape of a tunnel as arguments.

use super::stitch::positive;
use crate::survey::{Shape, TunnelSection};
use clap::ValueEnum;
use std::path::PathBuf;

/// The shape of the tunnel.
#[derive(Debug, clap::Args)]
pub struct TunnelArguments {
    /// Section of the tunnel.
    #[arg(long, value_enum, default_value_t)]
    shape: ShapeArgument,
    /// Radius of a circle, metres [default: 3].
    #[arg(long, value_name = "M", value_parser = positive)]
    radius_m: Option<f64>,
    /// Width of any other section, metres.
    #[arg(long, value_name = "M", value_parser = positive)]
    width_m: Option<f64>,
    /// Height of any other section, metres.
    #[arg(long, value_name = "M", value_parser = positive)]
    height_m: Option<f64>,
    /// File of the line along the middle of a tunnel that is not straight: `x y z [radius]` a line,
    /// metres.
    #[arg(long, value_name = "FILE")]
    centreline: Option<PathBuf>,
}

/// Sections by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum ShapeArgument {
    /// Round.
    #[default]
    Circle,
    /// Oval, its axes level and upright.
    Ellipse,
    /// A rectangle: an underpass, a culvert, a room.
    Box,
    /// A round arch on straight walls and a flat floor.
    Horseshoe,
}

/// Radius where none is given, metres: the paper's.
const RADIUS_M: f64 = 3.0;

impl TunnelArguments {
    /// The section `[tunnel]` of a survey.
    pub fn section(&self) -> TunnelSection {
        let shape = match self.shape {
            ShapeArgument::Circle => Shape::Circle,
            ShapeArgument::Ellipse => Shape::Ellipse,
            ShapeArgument::Box => Shape::Box,
            ShapeArgument::Horseshoe => Shape::Horseshoe,
        };
        let usual = (shape == Shape::Circle).then_some(RADIUS_M);
        TunnelSection {
            shape,
            radius_m: self.radius_m.or(usual),
            width_m: self.width_m,
            height_m: self.height_m,
            centreline: self.centreline.clone(),
            ignore: Vec::new(),
        }
    }
}
