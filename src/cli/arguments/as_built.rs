//! Arguments of a simulated wall as built, and of cables and lamps before it.

use super::input_file::input_file;
use crate::evaluate::converge::WallDeformation;
use crate::simulate::{AsBuilt, Fittings, Segments, SimulateOptions};
use std::path::PathBuf;

/// Random deformation of the lining.
#[derive(Debug, clap::Args)]
pub struct DeformationArguments {
    /// Oval lining: the radius varies by ± this around the section, twice once around, along all of
    /// the tunnel, which the survey does not know. Straight round tunnels only.
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    ovality_mm: f64,
    /// Undulating lining: the radius varies at random by this, root mean square. Straight round
    /// tunnels only.
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    undulation_mm: f64,
    /// Length of the undulation: the distance at which its correlation has fallen to 0.6.
    #[arg(long, value_name = "M", default_value_t = 0.5)]
    undulation_length_m: f64,
}

impl DeformationArguments {
    /// The deformation for the library.
    pub fn deformation(&self) -> WallDeformation {
        WallDeformation {
            ovality_mm: self.ovality_mm,
            undulation_mm: self.undulation_mm,
            undulation_length_m: self.undulation_length_m,
        }
    }
}

/// Deviation of the wall from the tunnel, and what is before it; the survey knows of neither.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "The wall as built (as drawn by default)")]
pub struct AsBuiltArguments {
    #[command(flatten)]
    deformation: DeformationArguments,
    /// Lining of rings of N segments, every other ring turned by half a segment. Straight round
    /// tunnels only.
    #[arg(long, value_name = "N")]
    segments: Option<u32>,
    /// Length of a ring of segments, metres.
    #[arg(long, value_name = "M", default_value_t = 1.5, requires = "segments")]
    ring_length_m: f64,
    /// Steps between segments: 1-σ of their radial positions, which are independent.
    #[arg(long, value_name = "MM", default_value_t = 3.0, requires = "segments")]
    step_mm: f64,
    /// Width of the dark joints between segments; 0 hides them.
    #[arg(long, value_name = "MM", default_value_t = 8.0, requires = "segments")]
    joint_mm: f64,
    /// A shape.json (of refine): the lining has its displacement. Straight round tunnels of its
    /// perimeter only.
    #[arg(long, value_name = "FILE", value_parser = input_file())]
    shape_file: Option<PathBuf>,
    /// Number of cables along the tunnel, 2 to 5 cm thick, on brackets 7 to 12 cm before the wall.
    /// Straight tunnels only.
    #[arg(long, value_name = "N", default_value_t = 0)]
    cables: u32,
    /// Number of rows of lamps along the tunnel: bright boxes of 60 × 14 × 8 cm before the wall.
    /// Straight tunnels only.
    #[arg(long, value_name = "N", default_value_t = 0)]
    lamps: u32,
    /// Distance between the lamps of a row, metres.
    #[arg(long, value_name = "M", default_value_t = 3.0, requires = "lamps")]
    lamp_spacing_m: f64,
}

impl AsBuiltArguments {
    /// Adds the wall as built to the options of a simulation.
    pub fn add_to(&self, options: SimulateOptions) -> SimulateOptions {
        SimulateOptions {
            as_built: AsBuilt {
                segments: self.segments.map(|count| Segments {
                    count,
                    ring_length_m: self.ring_length_m,
                    step_mm: self.step_mm,
                    joint_mm: self.joint_mm,
                }),
                shape_file: self.shape_file.clone(),
                ..self.deformation.deformation().as_built()
            },
            fittings: Fittings {
                cables: self.cables,
                lamps: self.lamps,
                lamp_spacing_m: self.lamp_spacing_m,
            },
            ..options
        }
    }
}
