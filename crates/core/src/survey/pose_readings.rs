//! Readings of a survey's poses, pictures and camera that people get wrong, to be told by the
//! pictures.

use super::error::SurveyError;
use super::interpreted_poses::InterpretedPoses;
use super::lens_readings::CameraReading;
use super::open::Survey;
use super::pose_reader::PoseReader;
use super::pose_shift::shifted;
use super::pose_validation::feasible_conventions;
use super::poses_section::PosesSection;
use crate::frames::PictureOrientation;
use nalgebra::{Quaternion, UnitQuaternion};
use std::ops::RangeInclusive;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::Surface;
use tunnelstitch_geometry::trajectory::{
    AngleUnit, CameraAxes, Convention, EulerSequence, LengthUnit, Pose, PoseFormat, StampedPose,
    Trajectory,
};

/// Radii of a round tunnel over the given one that people confuse, and what they gave.
const RADIUS_SLIPS: [(f64, &str); 4] = [
    (0.5, "of which twice the radius is given"),
    (2.0, "of which half the radius is given"),
    (0.3048, "of which the radius is given in feet"),
    (
        0.5 / std::f64::consts::PI,
        "of which the circumference is given for the radius",
    ),
];
/// Radii beside half and twice the given one, by tenths of a decade, since frames agree with a
/// radius near the right one, too. Nearer ones than that are for `refine` to find.
const OTHER_RADIUS_FACTORS: [f64; 4] = [0.4, 0.63, 1.58, 2.5];
/// Prior of a radius that is off by a factor without a name, nats: one in twenty.
const OTHER_RADIUS_NATS: f64 = -3.0;

/// Units of poses without a scale, tenths of a decade from the one that is taken: `refine` finds
/// what lies between them.
const UNIT_TENTHS: RangeInclusive<i32> = -8..=8;

/// Places that poses may be off by, later or earlier.
const SHIFTS: [isize; 6] = [1, -1, 2, -2, 3, -3];

/// Pictures may be stored otherwise than the camera saw them.
const ORIENTATIONS: [(&str, PictureOrientation); 3] = [
    ("the pictures upside down", PictureOrientation::Turned180),
    ("the pictures mirrored", PictureOrientation::Mirrored),
    (
        "the pictures mirrored and upside down",
        PictureOrientation::Flipped,
    ),
];

/// A reading of the survey's poses and pictures.
#[derive(Clone, Debug)]
pub struct PoseReading {
    /// The reading, and what of the command line or `survey.toml` asks for it; empty for the
    /// reading given.
    pub remedy: String,
    /// Number of its changes to the reading given.
    pub changes: usize,
    /// True if the pictures' files ask for it themselves, in their EXIF data.
    pub is_stated: bool,
    /// Natural logarithm of its prior odds to a slip that people make often.
    pub prior_nats: f64,
    /// The initial poses.
    pub initial: Trajectory,
    /// The orientation of the pictures against the one given.
    pub orientation: PictureOrientation,
    /// The camera against the one given.
    pub camera: CameraReading,
    /// Places by which the poses belong to later frames than given; earlier if it is negative.
    pub shift_frames: isize,
}

impl PoseReading {
    /// A reading of other poses with the pictures as given.
    fn of_poses(remedy: String, changes: usize, initial: Trajectory) -> Self {
        Self {
            remedy,
            changes,
            is_stated: false,
            prior_nats: 0.0,
            initial,
            orientation: PictureOrientation::Stored,
            camera: CameraReading::AsGiven,
            shift_frames: 0,
        }
    }

    /// True if the reading has another camera than given.
    pub fn changes_camera(&self) -> bool {
        self.camera != CameraReading::AsGiven
    }

    /// True if the reading has a pose of the file for frame `k`.
    pub fn has_pose_of(&self, k: usize) -> bool {
        let own = k.checked_add_signed(-self.shift_frames);
        own.is_some_and(|own| own < self.initial.len())
    }
}

impl Survey {
    /// The initial poses as given, followed by every other reading that leaves all cameras inside:
    /// other conventions, the reverse order, quaternions that begin with w, other units, poses of
    /// other frames, a diameter for the radius, pictures that are turned or mirrored, other
    /// focal lengths and other lenses.
    ///
    /// # Errors
    /// The errors of [`Survey::open`], if the file has changed since.
    pub fn pose_readings(&self) -> Result<Vec<PoseReading>, SurveyError> {
        let section = &self.file.poses;
        let given = PoseReader::new(section, &self.folder, &self.frames_to_pose())?
            .read(&self.folder.join(&section.initial), section.missing_poses())?;
        let surface = self.surface.as_ref();
        let as_given = PoseReading::of_poses(String::new(), 0, self.initial.clone());
        // A body of ROS sees what a camera sees whose pictures are turned by a quarter.
        let is_ambiguous = |convention: &Convention| {
            convention.axes == CameraAxes::Ros && self.has_turned_pictures()
        };
        let conventions = feasible_conventions(surface, &given).into_iter();
        let conventions = conventions.filter(|(_, convention)| !is_ambiguous(convention));
        let conventions = conventions.map(|(flags, convention)| {
            let initial = given.trajectory_in(&convention);
            PoseReading::of_poses(flags.join(" and "), flags.len(), initial)
        });
        let exif = self.exif_orientation();
        let poses = conventions
            .chain(exif.and_then(|number| self.of_stored_pictures(&given, number)))
            .chain(other_texts(section, &given))
            .chain(self.other_angles())
            .chain(self.shifted_readings(&given))
            .filter(|reading| is_inside(surface, &reading.initial))
            .map(|reading| PoseReading {
                initial: self.carried(reading.initial),
                ..reading
            });
        // Pictures of videos are displayed as they should be.
        let has_files = self.frames.iter().all(|frame| frame.reading().is_some());
        let orientations = ORIENTATIONS.into_iter().filter(|_| has_files);
        let pictures = orientations.map(|(name, orientation)| {
            let is_stated =
                !self.has_turned_pictures() && exif.and_then(of_exif) == Some(orientation);
            let (name, asked) = match is_stated {
                true => ("the pictures turned as EXIF says", PictureOrientation::Exif),
                false => (name, orientation),
            };
            PoseReading {
                remedy: format!("{name} (orientation = \"{}\" under [frames])", asked.name()),
                changes: 1,
                is_stated,
                orientation,
                ..as_given.clone()
            }
        });
        let cameras = self.camera_readings().into_iter();
        let cameras = cameras.map(|(remedy, camera)| PoseReading {
            remedy,
            changes: 1,
            camera,
            ..as_given.clone()
        });
        let others = poses
            .chain(self.other_radii(given.format))
            .chain(self.other_scales(given.format))
            .chain(pictures)
            .chain(cameras);
        Ok(std::iter::once(as_given.clone()).chain(others).collect())
    }

    /// The EXIF orientation, if all frames have the same, and another than as stored.
    fn exif_orientation(&self) -> Option<u8> {
        let files = self
            .frames
            .iter()
            .all(|frame| frame.shared_file().is_none());
        let looked_at = if files { self.frames.len() } else { 1 };
        let frames = self.frames.get(..looked_at)?;
        let numbers = frames.par_map(|frame| frame.exif_orientation().ok().flatten());
        let first = numbers.first().copied().flatten();
        first.filter(|_| numbers.iter().all(|number| *number == first))
    }

    /// The reading of poses as those of the camera with its pictures as it stored them, where these
    /// are turned by a quarter as the EXIF orientation `number` asks.
    fn of_stored_pictures(&self, given: &InterpretedPoses, number: u8) -> Option<PoseReading> {
        let axes = CameraAxes::before_turning(number)?;
        let is_other = self.has_turned_pictures() && given.convention.axes == CameraAxes::OpenCv;
        let convention = Convention {
            axes,
            ..given.convention
        };
        is_other.then(|| {
            let name = axes.name();
            let remedy = format!(
                "poses of the camera that stored the pictures before they were turned \
                 (camera_axes = \"{name}\" under [poses])"
            );
            PoseReading {
                is_stated: true,
                ..PoseReading::of_poses(remedy, 1, given.trajectory_in(&convention))
            }
        })
    }

    /// True if pictures are turned as their EXIF data ask.
    fn has_turned_pictures(&self) -> bool {
        let mut readings = self.frames.iter().filter_map(|frame| frame.reading());
        readings.any(|reading| reading.orientation == PictureOrientation::Exif)
    }

    /// Readings of a straight round tunnel with another radius. Pictures of it are those of the
    /// given one, seen from positions that are scaled about its axis. Poses without a scale say
    /// nothing of it.
    fn other_radii(&self, format: PoseFormat) -> impl Iterator<Item = PoseReading> {
        let has_scale = self.file.poses.unit_m.is_some() || !format.has_no_scale();
        let radius_m = self.file.tunnel.radius_m.filter(|_| has_scale);
        let slips = RADIUS_SLIPS.map(|(factor, what)| (factor, what.to_owned(), 0.0));
        let others = OTHER_RADIUS_FACTORS.map(|factor| {
            let what = format!("of about {factor} times the given radius");
            (factor, what, OTHER_RADIUS_NATS)
        });
        let all = slips.into_iter().chain(others);
        all.filter_map(move |(factor, what, prior_nats)| {
            let radius_m = rounded(factor * radius_m?);
            let remedy = format!("a tunnel {what} (radius_m = {radius_m} under [tunnel])");
            let reading = self.scaled(1.0 / factor, remedy)?;
            Some(PoseReading {
                prior_nats,
                ..reading
            })
        })
    }

    /// Readings in other units of poses that have no scale of their own, whose unit nobody gave.
    fn other_scales(&self, format: PoseFormat) -> impl Iterator<Item = PoseReading> {
        let is_unknown = self.file.poses.unit_m.is_none() && format.has_no_scale();
        let radius_m = self.file.tunnel.radius_m.filter(|_| is_unknown);
        let tenths = UNIT_TENTHS.filter(|tenths| *tenths != 0);
        tenths.filter_map(move |tenths| {
            let radius_m = radius_m?;
            let unit_m = (10f64.powf(0.1 * f64::from(tenths)) * 100.0).round() / 100.0;
            let remedy = format!(
                "a unit of the poses of about {unit_m} m (tunnelstitch init --force --radius-m \
                 {radius_m} --unit-m {unit_m} writes it, with the axis)"
            );
            self.scaled(unit_m, remedy)
        })
    }

    /// The reading with positions scaled about the axis of a straight tunnel, if they are inside.
    fn scaled(&self, factor: f64, remedy: String) -> Option<PoseReading> {
        let is_straight = self.file.tunnel.centreline.is_none() && self.bend.is_none();
        let scaled = |stamped: &StampedPose| StampedPose {
            pose: Pose::new(stamped.pose.r_wc, stamped.pose.t_wc * factor),
            ..*stamped
        };
        let initial = self.initial.iter().map(scaled).collect();
        let reading = PoseReading::of_poses(remedy, 1, initial);
        let is_inside = is_inside(self.surface.as_ref(), &reading.initial);
        (is_straight && is_inside).then_some(reading)
    }

    /// Readings of angles in the other unit, where that is given, and in the reverse order.
    fn other_angles(&self) -> Vec<PoseReading> {
        let section = &self.file.poses;
        let Some(order) = section.euler.map(EulerSequence::reversed) else {
            return Vec::new();
        };
        let reading = |remedy: String, changed: PosesSection| {
            let reader = PoseReader::new(&changed, &self.folder, &self.frames_to_pose()).ok()?;
            let path = self.folder.join(&section.initial);
            let poses = reader.read(&path, section.missing_poses()).ok()?;
            Some(PoseReading::of_poses(remedy, 1, poses.trajectory()))
        };
        let in_order = || {
            let remedy =
                format!("rotations in the order {order} (euler = \"{order}\" under [poses])");
            let changed = PosesSection {
                euler: Some(order),
                ..section.clone()
            };
            reading(remedy, changed)
        };
        let in_unit = |unit: AngleUnit| {
            let name = unit.name();
            let remedy = format!("angles in {name} (angle_unit = \"{name}\" under [poses])");
            let changed = PosesSection {
                angle_unit: Some(unit),
                ..section.clone()
            };
            reading(remedy, changed)
        };
        let mut units = AngleUnit::ALL.into_iter();
        let other = units.find(|unit| section.angle_unit.is_some_and(|given| given != *unit));
        in_order()
            .into_iter()
            .chain(other.and_then(in_unit))
            .collect()
    }

    /// Readings whose poses belong to the frames a few places later or earlier.
    fn shifted_readings(&self, given: &InterpretedPoses) -> Vec<PoseReading> {
        let section = &self.file.poses;
        let wanted = SHIFTS
            .into_iter()
            .filter(|_| section.shift_frames.is_none());
        let reading = |shift_frames: isize| {
            let path = self.folder.join(&section.initial);
            // Too few frames, or no way on from the last pose: no such reading.
            let poses = shifted(given.clone(), shift_frames, &path, &self.frames).ok()?;
            let remedy = shift_remedy(shift_frames);
            Some(PoseReading {
                shift_frames,
                ..PoseReading::of_poses(remedy, 1, poses.trajectory())
            })
        };
        wanted.filter_map(reading).collect()
    }
}

/// The orientation that the EXIF orientation `number` asks for, if it leaves the size as it is.
fn of_exif(number: u8) -> Option<PictureOrientation> {
    match number {
        2 => Some(PictureOrientation::Mirrored),
        3 => Some(PictureOrientation::Turned180),
        4 => Some(PictureOrientation::Flipped),
        _ => None,
    }
}

/// Poses of other frames, and the line that reads them so.
fn shift_remedy(shift_frames: isize) -> String {
    let count = shift_frames.unsigned_abs();
    let frames = if count == 1 { "frame" } else { "frames" };
    let direction = if shift_frames > 0 { "later" } else { "earlier" };
    format!("the poses {count} {frames} {direction} (shift_frames = {shift_frames} under [poses])")
}

/// A length rounded to a tenth of a millimetre, without the digits of binary fractions.
fn rounded(length_m: f64) -> f64 {
    (length_m * 1e4).round() / 1e4
}

/// Readings of the file's text other than that of a section: the order of its quaternions and of
/// its poses, and its unit.
fn other_texts(section: &PosesSection, given: &InterpretedPoses) -> Vec<PoseReading> {
    let mut others = Vec::new();
    let mut add = |remedy: String, other: InterpretedPoses| {
        others.push(PoseReading::of_poses(remedy, 1, other.trajectory()));
    };
    if section.quaternion.is_none() && matches!(given.format, PoseFormat::Tum | PoseFormat::Json) {
        let remedy = "quaternions as w x y z (quaternion = \"wxyz\" under [poses])";
        add(remedy.to_owned(), given.changed(with_w_first));
    }
    if section.reversed.is_none() {
        let remedy = "the poses in reverse order (reversed = true under [poses])";
        add(remedy.to_owned(), given.reversed());
    }
    if section.unit_m.is_none() {
        for LengthUnit { name, length_m, .. } in LengthUnit::OTHERS {
            let remedy = format!("positions in {name} (unit_m = {length_m} under [poses])");
            add(remedy, given.in_unit(length_m));
        }
    }
    others
}

/// A pose whose quaternion `x y z w` was in truth `w x y z`.
fn with_w_first(pose: &Pose) -> Pose {
    let [w, x, y, z] = pose.r_wc.coords.into();
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Pose::new(rotation, pose.t_wc)
}

fn is_inside(surface: &dyn Surface, poses: &Trajectory) -> bool {
    let mut poses = poses.iter();
    poses.all(|stamped| surface.check_inside(&stamped.pose.t_wc).is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_quaternion_written_with_w_first_is_read_back() {
        let right = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -1.2, 0.7));
        let [x, y, z, w] = right.coords.into();
        // The file's w x y z, taken for x y z w.
        let wrong = UnitQuaternion::from_quaternion(Quaternion::new(z, w, x, y));
        let read = with_w_first(&Pose::new(wrong, Vector3::zeros()));
        assert!(read.r_wc.angle_to(&right) < 1e-12);
    }

    /// A model of structure from motion has any size, whatever the radius: its unit is in question.
    #[test]
    fn poses_without_a_scale_say_nothing_of_the_radius() {
        let fixture = std::path::Path::new("../../fixtures/blender_free48");
        let survey = Survey::open(fixture).unwrap();
        let radii = |format| survey.other_radii(format).count();
        let all = RADIUS_SLIPS.len() + OTHER_RADIUS_FACTORS.len();
        assert_eq!(radii(PoseFormat::Tum), all);
        assert_eq!(radii(PoseFormat::Colmap), 0);
        let units = |format| survey.other_scales(format).count();
        assert_eq!(units(PoseFormat::Tum), 0);
        assert!(units(PoseFormat::Colmap) > 8);
        let change = |file: &mut crate::survey::SurveyFile| file.poses.unit_m = Some(1.0);
        let with_unit = Survey::open_with(fixture, change).unwrap();
        let count = with_unit.other_radii(PoseFormat::Colmap).count();
        assert_eq!(count, all);
    }
}
