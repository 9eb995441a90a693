//! Arguments that commands share, one group a file.
//!
//! | file | arguments |
//! | --- | --- |
//! | `numbers` | parsers of numbers, sizes and lists |
//! | `input_file` | parser of files to read |
//! | [`poses`] | which poses are used, and how they are read |
//! | [`tunnel`] | section and centreline |
//! | [`frame_times`] | number and times of the frames |
//! | [`motion`] | motion of the carrier, and how the camera is mounted on it |
//! | [`rendering`] | canvas, interpolation and blending of panoramas |
//! | [`panorama_files`] | files of a panorama and their formats |
//! | [`textures`] | textures and layers of the viewer |
//! | [`as_built`] | deviation of a simulated wall from its drawing, cables and lamps |
//! | [`simulation`] | degradations of a simulated survey, its wall and its jitter |
//! | [`imaging`] | lamp, lens, sensor and files of a simulated survey |
//! | [`follow`] | following frames while they are taken |
//! | [`resume`] | continuing an interrupted run |

mod as_built;
mod follow;
mod frame_times;
mod imaging;
mod input_file;
mod motion;
mod numbers;
mod output_folder;
mod panorama_files;
mod poses;
mod rendering;
pub mod resume;
mod simulation;
mod textures;
mod tunnel;

pub use as_built::{AsBuiltArguments, DeformationArguments};
pub use follow::FollowArguments;
pub use frame_times::{FrameTimesArguments, clock_times};
pub use imaging::ImagingArguments;
pub use input_file::input_file;
pub use motion::{MotionArguments, MountingArguments};
pub use numbers::{memory_size, numbers, picture_size, positive, rate, share, view_angle};
pub use output_folder::output_folder;
pub use panorama_files::OutputArguments;
pub use poses::{PoseReadingArguments, PosesArguments};
pub use rendering::{BlendArguments, CanvasArguments, InterpolationArgument, PictureArguments};
pub use resume::ResumeArguments;
pub use simulation::{DegradationArguments, JitterArgument, WallArgument};
pub use textures::{LayerArguments, LayerName, TextureArguments};
pub use tunnel::TunnelArguments;
