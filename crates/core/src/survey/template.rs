//! A commented `survey.toml` for the files of a folder.

use super::discover::Discovery;
use super::model_cameras::FoundRig;
use super::straight_axis::AXIS_FILE;
use std::fmt::Write;
use std::path::Path;
use tunnelstitch_geometry::trajectory::PoseFormat;

/// Keys of `[poses]` that are only mentioned.
const CONVENTIONS: &str = "\
# convention = \"c2w\"       # or \"w2c\"; each format has its own
# camera_axes = \"opencv\"   # or \"opengl\", \"ros\", \"unity\"; each format has its own
";

/// The table `[prior]`.
const PRIOR: &str = "
[prior]                     # how far off the initial poses may be, 1-σ
model = \"random-walk\"       # errors add up from frame to frame; or \"independent\"
rotation_sigma_deg = 2.0    # about each axis
translation_sigma_m = [0.02, 0.02, 0.03]
";

/// Horizontal field of view of a camera of which nothing is known, degrees: between the 45° of
/// telephones and the 90° of inspection cameras.
const GUESSED_FOV_DEG: f64 = 65.0;

/// The table `[calibrate]` for a camera without calibration.
const GUESSED_CAMERA: &str = "
[calibrate]                 # of a guessed camera; take it away once there is a calibration
unknowns = [\"focal\", \"distortion\"]
focal_sigma_percent = 30.0  # of the guess, 1-σ
k1_sigma = 0.1
";

impl Discovery {
    /// The text of a `survey.toml` for what was found, with comments; without `radius_m` it has a
    /// line to be filled in.
    pub fn survey_toml(&self, radius_m: Option<f64>) -> String {
        let mut text = String::from(
            "# A survey for tunnelstitch. Paths are relative to this file.\n\n\
             [tunnel]\nshape = \"circle\"\n",
        );
        // Writing into a string cannot fail.
        let _ = match radius_m {
            Some(radius_m) => writeln!(text, "radius_m = {radius_m:?}"),
            None => writeln!(
                text,
                "# Measure the tunnel's radius in metres and take away the # of the next line.\n\
                 # radius_m = 3.0"
            ),
        };
        text += "# ignore = [{ theta_deg = [150, 210], chainage_m = [2.0, 5.5] }]    # water, \
                 plants: refine ignores this part of the wall\n";
        match &self.rig {
            Some(rig) => write_rig(rig, &mut text),
            None => self.write_camera(&mut text),
        }
        self.write_frames(&mut text);
        text += "\n[poses]\n";
        self.write_initial_poses(&mut text);
        if let Some((path, _)) = self.truth() {
            let path = quoted(path);
            let _ = writeln!(text, "truth = {path}      # only ever used to compare");
        }
        text += CONVENTIONS;
        self.write_world(&mut text);
        text += PRIOR;
        if self.calibrations.is_empty() {
            text += GUESSED_CAMERA;
        }
        text
    }

    /// Writes `[camera]`.
    fn write_camera(&self, text: &mut String) {
        *text += "\n[camera]\n";
        let _ = match self.calibrations.first() {
            Some(found) => {
                let parts = self.parts_of(&found.path);
                let topic = parts.and_then(|parts| parts.calibration.as_ref());
                let name = match (topic, &found.selected) {
                    (Some(topic), _) => format!("name = {}    # its topic\n", quoted(topic)),
                    (None, Some(selected)) => format!(
                        "name = {}    # of its {} cameras, which differ; take the one of the \
                         frames\n",
                        quoted(&selected.name),
                        selected.of
                    ),
                    (None, None) => String::new(),
                };
                write!(text, "file = {}\n{name}", quoted(&found.path))
            }
            None => writeln!(
                text,
                "# No calibration was found: OpenCV, ROS or Kalibr YAML, COLMAP's cameras.txt or \
                 cameras.bin, nerfstudio's transforms.json, the files of OpenSfM, OpenMVG, \
                 Meshroom, Metashape, Bundler, RealityCapture or Pix4D, a lens profile of \
                 Gyroflow, a recording with CameraInfo, or our camera.json.\n\
                 # file = \"camera.json\"\n\
                 # Without one, a pinhole; refine searches for its focal length.\n\
                 horizontal_fov_deg = {GUESSED_FOV_DEG:?}    # across the frames: a guess"
            ),
        };
        if let Some(readout_ms) = self.video.as_ref().and_then(|video| video.readout_ms) {
            let _ = writeln!(
                text,
                "readout_ms = {readout_ms}    # rolling shutter, as the video states it"
            );
        }
    }

    /// Writes `[frames]`.
    fn write_frames(&self, text: &mut String) {
        let pattern = self.pictures.first();
        let pattern = pattern.map_or("*.jpg", |group| &group.pattern);
        let _ = match (&self.video, &self.recorded) {
            (None, None) if self.rig.is_some() => {
                writeln!(text, "\n[frames]    # those of the cameras above")
            }
            (Some(video), _) => writeln!(
                text,
                "\n[frames]\nvideo = {}\nevery = {}    # of its pictures; their times are the \
                 video's",
                quoted(&video.path),
                video.every
            ),
            (None, Some((path, images))) => writeln!(
                text,
                "\n[frames]\nbag = {}\ntopic = {}    # times are those of the headers\n\
                 # every = 5    # takes every fifth",
                quoted(path),
                quoted(&images.topic)
            ),
            (None, None) => writeln!(
                text,
                "\n[frames]\nimages = {}    # in natural order of their names",
                quoted(pattern)
            ),
        };
        self.write_reading(text);
        let _ = match &self.mask {
            Some(mask) => writeln!(
                text,
                "mask = {}    # black where no frame shows the wall",
                quoted(mask)
            ),
            None => writeln!(
                text,
                "# mask = \"mask.png\"    # a picture of the frames' size, black where none of \
                 them shows the wall"
            ),
        };
    }

    /// Writes the reading of the pictures that they ask for.
    fn write_reading(&self, text: &mut String) {
        if let Some(bits) = self.bits {
            let _ = writeln!(
                text,
                "bits = {bits}    # no value of the 16-bit files has more; take this away if the \
                 camera delivers 16"
            );
        }
        let names_orientation = self
            .picture_frames()
            .is_some_and(|g| g.turned_size.is_some());
        let _ = match self.orientation() {
            Some(orientation) => writeln!(
                text,
                "orientation = \"{}\"    # EXIF data ask to turn the pictures; the calibration \
                 fits only this",
                orientation.name()
            ),
            None if names_orientation => writeln!(
                text,
                "# orientation = \"exif\"    # EXIF data ask to turn the pictures: if the camera \
                 was calibrated with turned ones; otherwise \"stored\""
            ),
            None => Ok(()),
        };
    }

    /// Writes the axis and the unit of the world of the poses.
    fn write_world(&self, text: &mut String) {
        let _ = match &self.axis {
            Some(_) => writeln!(
                text,
                "tunnel_frame = \"{AXIS_FILE}\"   # the tunnel's axis: the line of the cameras"
            ),
            None => writeln!(
                text,
                "# tunnel_frame = \"axis.json\"   # where the tunnel's axis lies, if it is not the \
                 poses' y axis"
            ),
        };
        let _ = match self.unit_m {
            Some(unit_m) => writeln!(
                text,
                "unit_m = {unit_m:?}    # metres of a unit of the poses"
            ),
            None if self.lacks_scale() => writeln!(
                text,
                "# unit_m = 1.0    # metres of a unit of the poses, which have no known scale: \
                 tunnelstitch init --force --unit-m M writes it, and the axis with it"
            ),
            None => Ok(()),
        };
    }

    /// Writes the initial poses of `[poses]` and how they are associated with the frames.
    fn write_initial_poses(&self, text: &mut String) {
        let (count, _) = self.frames();
        if let Some(faulty) = self.faulty_poses() {
            let _ = writeln!(
                text,
                "initial = {}    # not read as yet: tunnelstitch check says what it lacks",
                quoted(&faulty.pattern)
            );
            return;
        }
        let Some((path, poses)) = self.initial() else {
            *text += "# No poses were found: TUM, KITTI, CSV, COLMAP, nerfstudio, EuRoC, OpenSfM, \
                      Bundler, Meshroom, OpenMVG, Metashape, RealityCapture, Pix4D or a \
                      recording.\n\
                      initial = \"baseline.tum\"\n";
            return;
        };
        let _ = writeln!(
            text,
            "initial = {}    # {} poses for {count} frames",
            quoted(path),
            poses.entries.len()
        );
        if let Some(topic) = self.parts_of(path).and_then(|parts| parts.poses.as_ref()) {
            let _ = writeln!(text, "topic = {}", quoted(topic));
        }
        let is_by_time = poses.entries.len() != count || !poses.conflicts.is_empty();
        let frames_have_times = self.picture_frames().is_none_or(|group| group.has_time);
        if is_by_time && frames_have_times && poses.has_times() && !poses.has_names() {
            *text += if self.video.is_some() {
                "associate = \"time\"       # by the video's times, or by [frames] times = FILE\n\
                 interpolate = true\n"
            } else if self.recorded.is_some() {
                "associate = \"time\"       # by the times of the recording\n\
                 interpolate = true\n"
            } else {
                "associate = \"time\"       # by names or EXIF data, or [frames] times = FILE\n\
                 # interpolate = true\n"
            };
        }
        if poses.format == PoseFormat::Recording {
            *text += "# If these are the robot's poses, and not the camera's: how the camera is \
                      mounted (a 4 × 4 matrix).\n\
                      # body_to_camera = \"mount.txt\"\n";
        }
        if poses.format == PoseFormat::Euroc {
            *text += "# These are a body's poses: how the camera is mounted (its sensor.yaml, or a \
                      4 × 4 matrix).\n\
                      # body_to_camera = \"sensor.yaml\"\n";
        }
    }
}

/// Writes the tables `[[camera]]` of a rig.
fn write_rig(rig: &FoundRig, text: &mut String) {
    *text += "\n# A rig: its cameras take one picture each at every moment.\n";
    for camera in &rig.cameras {
        // Writing into a string cannot fail.
        let _ = writeln!(
            text,
            "[[camera]]\nfile = {}\nname = {}\nframes = {}\nbody_to_camera = {}\n",
            quoted(&rig.calibrations),
            quoted(&camera.name),
            quoted(&camera.pattern),
            quoted(&rig.path)
        );
    }
}

/// A text as TOML string.
fn quoted(text: impl AsRef<Path>) -> String {
    toml::Value::String(text.as_ref().to_string_lossy().into_owned()).to_string()
}
