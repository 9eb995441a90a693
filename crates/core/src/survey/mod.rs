//! Surveys: data sets described by a `survey.toml`.
//!
//! ```toml
//! [tunnel]
//! shape = "circle"            # with radius_m; "ellipse", "box" or "horseshoe" with
//!                             # width_m and height_m
//! radius_m = 3.0
//! centreline = "curve.txt"    # optional, for curved tunnels: lines `x y z [radius]`
//! shape_file = "shape.json"   # optional: the wall as built, as `refine` writes it
//! points = "scan.laz"         # optional: measured points of the wall (`points::read_points`)
//! shape_sigma_mm = 10.0       # optional: deviation from the shape, 1-σ; 0 if it is exact
//! radius_sigma_percent = 0.33 # optional: 1-σ of its size; 0 if it is exact
//! ignore = [                  # optional: regions of the wall that refine excludes
//!     { theta_deg = [150, 210], chainage_m = [2.0, 5.5] }, # either is optional
//! ]
//!
//! [camera]
//! file = "camera.json"
//! readout_ms = 20.0           # optional: rolling shutter, from the first row to the last
//! max_range_m = 18.0          # optional: farther wall is not used; 6 radii by default
//!
//! # Or, of a rig, a table for each camera, with poses of its body:
//! # [[camera]]
//! # file = "left.json"
//! # frames = "left/*.png"     # its pictures, one a moment
//! # body_to_camera = "left.txt"
//! # mask = "left-mask.png"    # optional
//! # [rig]                     # optional: 1-σ of the mounts
//! # rotation_sigma_deg = 0.05
//! # translation_sigma_mm = 1.0
//!
//! [frames]
//! images = "frames/*.jpg"     # sorted by name; or
//! # video = "survey.mp4"      # pictures of a video, read by ffmpeg, with its times
//! # bag = "survey.mcap"       # images of a recording (MCAP, ROS 1 bag), times of their headers
//! # topic = "/camera/image"   # in a recording with several topics of images
//! # every = 5                 # sampling interval, pictures
//! # angle_step_deg = 15.0     # keyframes by rotation of the view; needs associate = "time"
//! times = "times.txt"         # optional: lines `time`, `time name` or `name time`
//! mask = "mask.png"           # optional: an image, black where the wall is hidden
//! skip_bad = true             # optional: leaves out files that cannot be read
//! overlay = "keep"            # optional: also uses what does not move with the wall
//!
//! [poses]
//! initial = "baseline.tum"    # TUM, KITTI, CSV, COLMAP, nerfstudio, EuRoC: see the content
//! truth = "groundtruth.tum"   # optional: for comparison; read like the initial poses
//! format = "tum"              # optional, like all below: overrides the detection
//! topic = "/odom"             # in a recording with several topics of poses
//! parent = "map"              # in a recording: the frames of reference of a transform
//! child = "camera"
//! columns = { tx = "px" }     # CSV: names of columns in the header that are not known
//! quaternion = "wxyz"         # TUM: or "xyzw"; by default as a comment names it, or "xyzw"
//! convention = "c2w"          # or "w2c"; the default depends on the format
//! camera_axes = "opencv"      # or "opengl", "ros", "unity"; the default depends on the format
//! body_to_camera = "cam.yaml" # for poses of a body (`trajectory::read_camera_in_body`)
//! tunnel_frame = "axis.json"  # for another axis than y (`trajectory::read_tunnel_frame`)
//! time_offset_s = 3600        # added to the times of the poses
//! associate = "time"          # or "name" (default if the file has names), or "order"
//! time_tolerance_s = 0.01     # largest difference of times; the default
//! interpolate = true          # by default the nearer pose is taken
//! reversed = true             # poses in the reverse order of the frames
//! shift_frames = 2            # the initial poses belong to the frames two places later
//! unit_m = 0.001              # length of the file's unit
//! as_built = true             # not to be carried along the bend of shape_file
//!
//! [prior]                     # optional: noise of the initial poses
//! model = "random-walk"       # or "independent"
//! rotation_sigma_deg = 2.0
//! translation_sigma_m = [0.02, 0.02, 0.03]
//!
//! [calibrate]                 # optional: self-calibration by refine
//! unknowns = ["focal", "centre", "distortion", "radius", "axis"]
//! focal_sigma_percent = 2.0   # 1-σ of the given values; these are the defaults
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
//! use tunnelstitch_core::survey::Survey;
//!
//! let survey = Survey::open(Path::new("../../fixtures/blender_free48"))?;
//! assert_eq!(survey.frames.len(), survey.initial.len());
//! assert!(survey.truth.is_some());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod associate;
mod calibrate;
mod calibrated;
mod calibrated_size;
mod camera_section;
mod camera_sections;
mod capture;
mod capture_times;
mod clock_slip;
mod discover;
mod error;
mod file;
mod found_calibration;
mod frame_list;
mod frame_paths;
mod frame_pixels;
mod frame_skipping;
mod frame_times;
mod ignore;
mod interpreted_poses;
mod joined_folders;
mod keyframe_poses;
mod keyframe_selection;
mod left_aside;
mod lens_readings;
mod lost_poses;
mod masked_wall;
mod matrix_folders;
mod missing_poses;
mod model_cameras;
mod numbering;
mod open;
mod overlay;
mod picture_group;
mod picture_motion;
mod pose_conflicts;
mod pose_reader;
mod pose_readings;
mod pose_shift;
mod pose_validation;
mod poses_section;
mod readout;
mod recorded_parts;
mod refusal;
mod rig_section;
mod shape_file;
mod skipped_frame;
mod straight_axis;
mod strangers;
mod taken_frames;
mod template;
mod tunnel;
mod unit_slip;
mod unposed_frames;
mod walked_folder;
mod wall_file;

pub use associate::{Associate, TIME_TOLERANCE_S};
pub use calibrate::{CalibrateSection, CalibrationGroup};
pub use calibrated::FoundFiles;
pub use camera_section::CameraSection;
pub use camera_sections::CameraSections;
pub use capture::{Capture, MissingFrames, SetAside};
pub use capture_times::FrameTimes;
pub use discover::{Discovery, VideoChoice};
pub use error::SurveyError;
pub use file::{FramesSection, OverlayUse, PriorSection, SURVEY_FILE, SurveyFile};
pub use found_calibration::{FoundCalibration, SelectedCamera};
pub use frame_pixels::{FramePixel, FramePixels};
pub use frame_times::read_frame_times;
pub use ignore::IgnoreSection;
pub use left_aside::LeftAside;
pub use lens_readings::CameraReading;
pub use masked_wall::{MASKED_FILE, MaskedTile, MaskedWall};
pub use missing_poses::PoseGap;
pub use model_cameras::{FoundRig, FoundRigCamera};
pub use open::Survey;
pub use open::toml_path;
pub use overlay::{Overlay, OverlayReport};
pub use picture_group::PictureGroup;
pub use pose_readings::PoseReading;
pub use poses_section::PosesSection;
pub use recorded_parts::{RecordedFrames, RecordedParts};
pub use rig_section::RigSection;
pub use shape_file::ShapeFile;
pub use skipped_frame::SkippedFrame;
pub use straight_axis::{AXIS_FILE, FoundAxis};
pub use tunnel::{DEFAULT_SHAPE_SIGMA_RADII, Shape, TunnelSection, read_centreline};
pub use unposed_frames::UnposedFrames;
