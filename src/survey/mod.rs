//! `survey.toml`: what a data set is.
//!
//! ```toml
//! [tunnel]
//! shape = "circle"            # with radius_m; or "ellipse", "box", "horseshoe" with width_m and height_m
//! radius_m = 3.0
//! centreline = "curve.txt"    # optional: of a tunnel that is not straight, `x y z [radius]` a line
//! ignore = [                  # optional: parts of the wall by which refine does not compare frames
//!     { theta_deg = [150, 210], chainage_m = [2.0, 5.5] },   # either may be left out: all around, all along
//! ]
//!
//! [camera]
//! file = "camera.json"
//! readout_ms = 20.0           # optional: rolling shutter, from the first row to the last
//!
//! [frames]
//! images = "frames/*.jpg"     # sorted by name; or
//! # video = "survey.mp4"      # pictures of a video, read by ffmpeg, with the times it says
//! # every = 5                 # every fifth picture of it
//! # angle_step_deg = 15.0     # of these, those between which the view turns by so much; needs `associate = "time"`
//! times = "times.txt"         # optional: `time`, `time name` or `name time` a line; else from the names
//! mask = "mask.png"           # optional: a picture of their size, black where they never show the wall
//!
//! [poses]
//! initial = "baseline.tum"    # TUM, KITTI, CSV, COLMAP, nerfstudio or EuRoC, told by the content
//! truth = "groundtruth.tum"   # optional: only for comparison; all below holds for both
//! format = "tum"              # optional, as all below: the format, where the content does not tell
//! convention = "c2w"          # or "w2c"; each format has its own
//! camera_axes = "opencv"      # or "opengl"; each format has its own
//! body_to_camera = "cam.yaml" # where the poses are a body's; see `trajectory::read_camera_in_body`
//! tunnel_frame = "axis.json"  # where the axis is not their world's y; see `trajectory::read_tunnel_frame`
//! associate = "time"          # or "name", the default where the file has names, or "order"
//! time_tolerance_s = 0.01     # the nearest pose may be this far off; the default
//! interpolate = true          # between two poses; the default is the nearer one
//!
//! [prior]                     # optional: how far off the initial poses may be
//! model = "random-walk"       # or "independent"
//! rotation_sigma_deg = 2.0
//! translation_sigma_m = [0.02, 0.02, 0.03]
//!
//! [calibrate]                 # optional: what refine estimates besides the poses, around the values given
//! unknowns = ["focal", "centre", "distortion", "radius", "axis"]
//! focal_sigma_percent = 2.0   # 1-σ of the values given; these are the defaults
//! centre_sigma_percent = 1.0  # of the frames' width
//! k1_sigma = 0.05
//! k2_sigma = 0.05
//! radius_sigma_percent = 1.0
//! axis_tilt_sigma_deg = 1.0
//! axis_offset_sigma_m = 0.05
//! ```
//!
//! Relative paths are relative to `survey.toml`. Unknown keys are errors with line and column.
//!
//! # Example
//!
//! ```
//! use std::path::Path;
//! use tunnelstitch::check::check;
//! use tunnelstitch::survey::Survey;
//!
//! let survey = Survey::open(Path::new("fixtures/blender_free48"))?;
//! let found = check(&survey)?;
//! assert_eq!(found.frames, survey.frames.len());
//! assert!(found.faults.is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod associate;
mod calibrate;
mod calibrated;
mod discover;
mod error;
mod file;
mod footage;
mod frame_paths;
mod frame_times;
mod ignore;
mod listing;
mod open;
mod plausible;
mod poses;
mod reader;
mod template;
mod thinning;
mod times;
mod tunnel;

pub use associate::{Associate, TIME_TOLERANCE_S};
pub use calibrate::{CalibrateSection, CalibrationGroup};
pub use discover::{Discovery, PictureGroup, VideoChoice};
pub use error::SurveyError;
pub use file::{CameraSection, FramesSection, PriorSection, SURVEY_FILE, SurveyFile};
pub use footage::Footage;
pub use frame_times::FrameTimes;
pub use ignore::IgnoreSection;
pub use open::Survey;
pub(crate) use open::toml_path;
pub use poses::PosesSection;
pub use times::read_frame_times;
pub use tunnel::{Shape, TunnelSection, read_centreline};
