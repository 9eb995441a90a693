//! Validation of poses against the tunnel, and a search for the convention that was meant.
//!
//! A wrong convention places cameras outside, makes them look along the axis while they revolve, or
//! makes them move and rotate along another direction. (A camera that does not revolve may look
//! along the axis: the usual one of a sewer robot does.) In these cases other conventions are
//! tried, the simplest first, and the plausible one is named with its flag. A wrong convention that
//! leaves all cameras inside and looking at the wall can only be detected from the images
//! ([`Survey::pose_readings`](crate::survey::Survey::pose_readings)); and so can one by which a
//! camera looks along the axis and rolls about it, which some do.

use super::error::SurveyError;
use super::interpreted_poses::InterpretedPoses;
use super::lost_poses::LostPoses;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use std::path::Path;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::surface::{Surface, mean_radius_m};
use tunnelstitch_geometry::trajectory::{CameraAxes, Convention, Pose, TunnelAxis, so3};

/// Smallest number of frames from which a convention is judged.
const MIN_FRAMES: usize = 4;
/// Fraction of frames outside or looking along the axis from which on another convention is
/// searched; fewer are outliers.
const MAX_WRONG_FRACTION: f64 = 0.34;
/// Largest fraction of frames that look along the axis in a plausible convention, because poses are
/// noisy.
const MAX_AXIAL_FRACTION: f64 = 0.05;
/// Angle from the axis at which motion and rotation are along another direction: twice the 30° of a
/// carrier that sways by 6° per frame and steers back
/// ([`Jitter`](tunnelstitch_geometry::trajectory::Jitter)). Other axes of the world are 90° off.
const MIN_ASKEW_ANGLE_RAD: f64 = std::f64::consts::FRAC_PI_3;
/// Angle from the axis within which motion and rotation are along it.
const MAX_ALIGNED_ANGLE_RAD: f64 = std::f64::consts::FRAC_PI_6;
/// Longest piece of a tunnel without a camera between two, in radii: 3 km of a road tunnel. Wall
/// that nothing sees costs memory, too, and a pose far from all others is a slip.
const MAX_GAP_RADII: f64 = 1000.0;

/// Statistics of poses in the tunnel.
struct PoseSummary {
    frames: usize,
    outside: usize,
    axial: usize,
    /// Computes the statistics of poses in the tunnel's frame.
    course: MotionDirections,
}

impl PoseSummary {
    fn of(surface: &dyn Surface, camera: &Camera, poses: &[Pose]) -> Self {
        let outside = |pose: &&Pose| surface.check_inside(&pose.t_wc).is_err();
        let straight: Vec<Pose> = poses
            .iter()
            .map(|pose| surface.straightened(pose))
            .collect();
        Self {
            frames: poses.len(),
            outside: poses.iter().filter(outside).count(),
            axial: straight
                .iter()
                .filter(|pose| looks_along_the_axis(camera, pose))
                .count(),
            course: MotionDirections::of(&straight),
        }
    }

    fn share(&self, count: usize) -> f64 {
        count as f64 / self.frames.max(1) as f64
    }

    /// True if the cameras look along the axis and turn about it: they roll.
    fn rolls(&self) -> bool {
        let turning = self.course.turning;
        self.course.revolves
            && self.share(self.axial) > MAX_WRONG_FRACTION
            && turning.is_some_and(|turning| turning.y.abs() > MAX_ALIGNED_ANGLE_RAD.cos())
    }

    fn is_wrong(&self) -> bool {
        let axial = if self.course.revolves { self.axial } else { 0 };
        self.frames >= MIN_FRAMES && self.share(self.outside.max(axial)) > MAX_WRONG_FRACTION
    }

    fn is_right(&self) -> bool {
        let along = |direction: &Option<Vector3<f64>>| {
            direction.is_none_or(|d| d.y.abs() > MAX_ALIGNED_ANGLE_RAD.cos())
        };
        self.outside == 0
            && (!self.course.revolves || self.share(self.axial) <= MAX_AXIAL_FRACTION)
            && along(&self.course.motion)
            && along(&self.course.turning)
    }

    /// True if no pose is impossible, but the camera moves and rotates across the tunnel.
    fn is_suspicious(&self) -> bool {
        let askew = |direction: &Option<Vector3<f64>>| direction.is_some_and(|d| is_askew(&d));
        let (motion, turning) = (askew(&self.course.motion), askew(&self.course.turning));
        let some_axial = self.course.revolves && self.share(self.axial) > MAX_AXIAL_FRACTION;
        self.frames >= MIN_FRAMES
            && ((turning && (motion || some_axial)) || (motion && !self.course.turns))
    }
}

fn is_askew(direction: &Vector3<f64>) -> bool {
    direction.y.abs() < MIN_ASKEW_ANGLE_RAD.cos()
}

/// True if the image contains a vanishing point of the axis.
fn looks_along_the_axis(camera: &Camera, pose: &Pose) -> bool {
    [Vector3::y(), -Vector3::y()].iter().any(|along| {
        let direction = pose.r_wc.inverse_transform_vector(along);
        camera
            .project(&direction)
            .is_some_and(|pixel| camera.is_in_image(&pixel, 0.0))
    })
}

/// The principal directions of a trajectory, as far as they are defined; unit vectors.
struct MotionDirections {
    /// Direction of the line through the cameras, towards the last.
    motion: Option<Vector3<f64>>,
    /// True if the cameras rotate.
    turns: bool,
    /// True if they go on rotating the same way: rolling, or looking around in full turns.
    revolves: bool,
    /// Axis of the rotation.
    turning: Option<Vector3<f64>>,
    /// Mean of the camera centres, metres.
    middle: Vector3<f64>,
}

/// Smallest fraction of the variance along the line of motion: five times as long as wide.
const MIN_LINE_FRACTION: f64 = 25.0 / 26.0;
/// Smallest fraction of the rotation about a single axis.
const MIN_AXIS_FRACTION: f64 = 0.75;
/// Smallest root-mean-square rotation from frame to frame; less is swaying of the carrier.
const MIN_ROTATION_RAD: f64 = 0.05;
/// Least length of the mean of unit vectors that sway by up to a right angle: `√2/2`, less what
/// noise takes.
const MIN_MEAN_DIRECTION: f64 = 0.6;
/// Smallest total motion, metres; any tunnel has a larger radius.
const MIN_MOTION_M: f64 = 1e-6;

impl MotionDirections {
    fn of(poses: &[Pose]) -> Self {
        let count = poses.len().max(1) as f64;
        let middle = poses.iter().map(|pose| pose.t_wc).sum::<Vector3<f64>>() / count;
        let spread: Matrix3<f64> = poses
            .iter()
            .map(|pose| pose.t_wc - middle)
            .map(|off| off * off.transpose())
            .sum();
        let turns = poses
            .windows(2)
            .filter_map(|pair| match pair {
                [before, after] => Some(so3::log(&(after.r_wc * before.r_wc.inverse()))),
                _ => None,
            })
            .map(|omega| omega * omega.transpose())
            .sum::<Matrix3<f64>>();
        let does_turn = (turns.trace() / count).sqrt() > MIN_ROTATION_RAD;
        let motion = main_direction(&spread, MIN_LINE_FRACTION)
            .filter(|_| (spread.trace() / count).sqrt() > MIN_MOTION_M)
            .map(|line| match (poses.first(), poses.last()) {
                (Some(first), Some(last)) if line.dot(&(last.t_wc - first.t_wc)) < 0.0 => -line,
                _ => line,
            });
        let views = poses.iter().map(|pose| pose.r_wc * Vector3::z());
        let rights = poses.iter().map(|pose| pose.r_wc * Vector3::x());
        // A direction that goes around is 0 in the mean; one that sways is nearly a unit vector.
        let mean = |sum: Vector3<f64>| sum.norm() / count;
        let sways = mean(views.sum()).min(mean(rights.sum())) > MIN_MEAN_DIRECTION;
        Self {
            motion,
            turns: does_turn,
            revolves: does_turn && !sways,
            turning: main_direction(&turns, MIN_AXIS_FRACTION).filter(|_| does_turn),
            middle,
        }
    }
}

/// The line of motion of cameras that go on rotating about one axis, if they have one, towards the
/// last; a unit vector.
pub(super) fn line_of_revolving(poses: &[Pose]) -> Option<Vector3<f64>> {
    let course = MotionDirections::of(poses);
    let revolves = course.revolves && course.turning.is_some();
    course.motion.filter(|_| revolves)
}

/// True if camera centres extend along a direction, a unit vector, as along a line of motion.
pub(super) fn extend_along(centres: &[Vector3<f64>], direction: &Vector3<f64>) -> bool {
    let middle = centres.iter().sum::<Vector3<f64>>() / centres.len().max(1) as f64;
    let off = || centres.iter().map(|centre| centre - middle);
    let along: f64 = off().map(|off| off.dot(direction).powi(2)).sum();
    along > MIN_LINE_FRACTION * off().map(|off| off.norm_squared()).sum::<f64>()
}

/// The eigenvector of the largest eigenvalue, if that has at least `share` of the trace.
fn main_direction(moments: &Matrix3<f64>, share: f64) -> Option<Vector3<f64>> {
    if !moments.iter().all(|value| value.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::new(*moments);
    let largest = eigen.eigenvalues.imax();
    (eigen.eigenvalues[largest] > share * moments.trace())
        .then(|| eigen.eigenvectors.column(largest).into_owned())
}

/// Another convention for a file.
struct ConventionChange {
    convention: Convention,
    /// The flags that select it.
    flags: Vec<String>,
}

impl ConventionChange {
    fn remedy(&self) -> String {
        self.flags.join(" and ")
    }
}

/// All camera axes, the given ones first.
fn all_axes(given: CameraAxes) -> impl Iterator<Item = CameraAxes> {
    let others = CameraAxes::ALL.into_iter();
    std::iter::once(given).chain(others.filter(move |axes| *axes != given))
}

/// All other conventions of direction, camera axes and mount.
fn convention_changes(reading: &InterpretedPoses) -> Vec<ConventionChange> {
    let given = reading.convention;
    let mut found = Vec::new();
    for direction in [given.direction, given.direction.other()] {
        for axes in all_axes(given.axes) {
            for invert in [false, true] {
                if invert && given.camera_in_body.is_none() {
                    continue;
                }
                let mut flags = Vec::new();
                if direction != given.direction {
                    let name = direction.name();
                    flags.push(format!(
                        "--pose-convention {name} (poses.convention = \"{name}\" in survey.toml)"
                    ));
                }
                if axes != given.axes {
                    let name = axes.name();
                    flags.push(format!(
                        "--camera-axes {name} (poses.camera_axes = \"{name}\" in survey.toml)"
                    ));
                }
                if invert {
                    flags.push("the inverse of the matrix of --body-to-camera".to_owned());
                }
                let mount = given.camera_in_body;
                let convention = Convention {
                    direction,
                    axes,
                    camera_in_body: if invert {
                        mount.map(|m| m.inverse())
                    } else {
                        mount
                    },
                    ..given
                };
                found.extend(with_other_axes(reading, &convention, &flags));
                if !flags.is_empty() {
                    found.push(ConventionChange { convention, flags });
                }
            }
        }
    }
    found
}

/// Variants of a convention with the tunnel's axis in another direction.
fn with_other_axes(
    reading: &InterpretedPoses,
    convention: &Convention,
    flags: &[String],
) -> Vec<ConventionChange> {
    let along = |axis: TunnelAxis| {
        // The frame is computed from the printed numbers.
        let frame = axis.frame().ok()?;
        let json = serde_json::to_string(&axis).ok()?;
        let flag =
            format!("--tunnel-frame FILE (poses.tunnel_frame in survey.toml) with the FILE {json}");
        Some(ConventionChange {
            convention: Convention {
                tunnel_in_world: Some(frame),
                ..*convention
            },
            flags: [flags, &[flag]].concat(),
        })
    };
    axes_of(reading, convention)
        .into_iter()
        .filter_map(along)
        .collect()
}

/// The plausible convention with the fewest changes, and among several the one with the shortest
/// path, because a wrong convention amplifies the errors of the poses.
fn remedy(surface: &dyn Surface, camera: &Camera, reading: &InterpretedPoses) -> Option<String> {
    let mut best: Option<(usize, f64, ConventionChange)> = None;
    for other in convention_changes(reading) {
        let poses = reading.poses_in(&other.convention);
        if !PoseSummary::of(surface, camera, &poses).is_right() {
            continue;
        }
        let (changes, path_m) = (other.flags.len(), path_m(&poses));
        let is_better = best.as_ref().is_none_or(|(least, shortest_m, _)| {
            changes < *least || (changes == *least && path_m < *shortest_m * (1.0 - PATH_TIE_RATIO))
        });
        if is_better {
            best = Some((changes, path_m, other));
        }
    }
    best.map(|(.., other)| other.remedy())
}

/// Relative difference below which paths count as equally long.
const PATH_TIE_RATIO: f64 = 1e-3;

/// Length of the path through the camera centres, metres.
fn path_m(poses: &[Pose]) -> f64 {
    let ways = poses.iter().zip(poses.iter().skip(1));
    ways.map(|(before, after)| (after.t_wc - before.t_wc).norm())
        .sum()
}

/// Candidate tunnel axes: those of the world, then the line of motion, then the axis of rotation.
fn axes_of(reading: &InterpretedPoses, convention: &Convention) -> Vec<TunnelAxis> {
    let poses: Vec<Pose> = reading
        .given
        .iter()
        .map(|stamped| convention.to_world(&stamped.pose))
        .collect();
    let course = MotionDirections::of(&poses);
    let towards = course.motion.unwrap_or(Vector3::zeros());
    let axis = |point: Vector3<f64>, direction: Vector3<f64>| {
        let direction = if direction.dot(&towards) < 0.0 {
            -direction
        } else {
            direction
        };
        let rounded = |v: Vector3<f64>| {
            let digits = |value: f64| (value * 1e4).round() / 1e4 + 0.0;
            [digits(v.x), digits(v.y), digits(v.z)]
        };
        TunnelAxis {
            point_m: rounded(point),
            axis: rounded(direction),
            theta_zero: None,
        }
    };
    let worlds =
        [Vector3::x(), Vector3::z(), Vector3::y()].map(|along| axis(Vector3::zeros(), along));
    let own = [course.motion, course.turning].into_iter().flatten();
    worlds
        .into_iter()
        .chain(own.map(|along| axis(course.middle, along)))
        .collect()
}

/// The conventions with the given tunnel axis that leave all cameras inside; only images can
/// distinguish them.
pub(super) fn feasible_conventions(
    surface: &dyn Surface,
    reading: &InterpretedPoses,
) -> Vec<(Vec<String>, Convention)> {
    let tunnel = reading.convention.tunnel_in_world;
    let is_inside = |other: &ConventionChange| {
        let poses = reading.poses_in(&other.convention);
        other.convention.tunnel_in_world == tunnel
            && poses
                .iter()
                .all(|pose| surface.check_inside(&pose.t_wc).is_ok())
    };
    let mut feasible: Vec<ConventionChange> = convention_changes(reading)
        .into_iter()
        .filter(is_inside)
        .collect();
    feasible.sort_by_key(|other| other.flags.len());
    feasible
        .into_iter()
        .map(|other| (other.flags, other.convention))
        .collect()
}

/// Validates the poses of a file against the tunnel; returns warnings about suspicious poses. If
/// `has_own_axes`, the camera's axes are asked for, not those of the format.
///
/// # Errors
/// A camera outside; most cameras looking along the axis, if another convention is plausible,
/// unless they roll about it as mounted.
pub(super) fn validate_poses(
    surface: &dyn Surface,
    camera: &Camera,
    reading: &InterpretedPoses,
    poses: &[Pose],
    path: &Path,
    has_own_axes: bool,
) -> Result<Vec<String>, SurveyError> {
    let stand = PoseSummary::of(surface, camera, poses);
    let lost = LostPoses::find(reading);
    let remedy = || remedy(surface, camera, reading);
    let outside = poses.iter().enumerate().find_map(|(frame, pose)| {
        surface
            .check_inside(&pose.t_wc)
            .err()
            .map(|source| (frame, source))
    });
    if let Some((frame, source)) = outside {
        let other = stand.is_wrong().then(remedy).flatten();
        return Err(SurveyError::Placement {
            path: path.to_owned(),
            frame,
            source,
            remedy: match other {
                _ if lost.iter().any(|lost| lost.contains(frame)) => {
                    LostPoses::sentence(&lost, path).unwrap_or_default()
                }
                Some(other) => format!(
                    "{} of {} cameras are; they would all be inside and look at the wall with \
                     {other}",
                    stand.outside, stand.frames
                ),
                None if is_interpolated(reading, frame) => "the file has no pose of it, and its \
                     neighbours lead there; give it a pose, or leave it out of frames.images"
                    .to_owned(),
                None if stand.is_wrong() => format!(
                    "{} of {} cameras are, and they are in every other convention and about every \
                     other axis that was tried",
                    stand.outside, stand.frames
                ),
                None => format!("{} of {} cameras are", stand.outside, stand.frames),
            },
        });
    }
    check_gaps(surface, poses, path)?;
    let mut warnings: Vec<String> = LostPoses::sentence(&lost, path).into_iter().collect();
    let may_roll = stand.rolls() && reading.convention.camera_in_body.is_none();
    let is_confirmed = may_roll && has_own_axes;
    if stand.is_wrong()
        && !is_confirmed
        && let Some(other) = remedy()
    {
        let axial = format!(
            "{} of {} cameras look along the tunnel's axis",
            stand.axial, stand.frames
        );
        if !may_roll {
            return Err(SurveyError::Association {
                path: path.to_owned(),
                what: format!("{axial}; they would look at the wall with {other}"),
            });
        }
        let given = reading.convention.axes.name();
        warnings.push(format!(
            "{}: {axial} and turn about it; if that is so, camera_axes = \"{given}\" under [poses] \
             confirms it; they would look at the wall with {other}",
            printed(path)
        ));
    }
    if stand.is_suspicious() {
        let likely = remedy().map_or(String::new(), |other| {
            format!("; they would go along it with {other}")
        });
        warnings.push(format!(
            "{}: the cameras move or turn across the tunnel, not along its axis (the world's \
             y){likely}",
            printed(path)
        ));
    }
    Ok(warnings)
}

/// True if the file has no pose of a frame.
fn is_interpolated(reading: &InterpretedPoses, frame: usize) -> bool {
    let mut gaps = reading.gaps.iter();
    gaps.any(|gap| gap.frames.contains(&frame))
}

/// Refuses cameras far from all others along the tunnel.
fn check_gaps(surface: &dyn Surface, poses: &[Pose], path: &Path) -> Result<(), SurveyError> {
    let mut stations: Vec<(f64, usize)> = (poses.iter().enumerate())
        .map(|(frame, pose)| (surface.chainage_m(&pose.t_wc), frame))
        .collect();
    stations.sort_by(|a, b| a.0.total_cmp(&b.0));
    let max_m = MAX_GAP_RADII * mean_radius_m(surface);
    let gap = stations
        .windows(2)
        .find(|pair| pair[1].0 - pair[0].0 > max_m);
    let Some([(from_m, before), (to_m, after)]) = gap else {
        return Ok(());
    };
    Err(SurveyError::Association {
        path: path.to_owned(),
        what: format!(
            "frames {before} and {after} are {:.0} m apart along the tunnel (chainage {from_m:.1} \
             and {to_m:.1} m), and no camera is between them; make a survey of each part, or give \
             these frames other poses or other units",
            to_m - from_m
        ),
    })
}

#[cfg(test)]
mod tests;
