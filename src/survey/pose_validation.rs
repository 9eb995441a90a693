//! Whether poses make sense in the tunnel, and which other reading of them would.
//!
//! A wrong convention puts cameras outside, has them look along the axis, or has them move and turn
//! along another direction. Where that is so, the other readings are tried, the simplest first, and
//! the one that makes sense is named with its flag. A reading that leaves all cameras inside and
//! looking at the wall cannot be told from a right one here: only the pictures can
//! ([`Survey::pose_convention_variants`](crate::survey::Survey::pose_convention_variants)).

use super::error::SurveyError;
use super::pose_reader::InterpretedPoses;
use crate::camera::Camera;
use crate::surface::Surface;
use crate::trajectory::{Convention, Pose, TunnelAxis, so3};
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use std::path::Path;

/// Fewer frames show no convention.
const MIN_FRAMES: usize = 4;
/// Share of frames that must be outside or look along the axis before another reading is looked
/// for: single ones are wrong poses.
const MAX_WRONG_FRACTION: f64 = 0.34;
/// Share of frames that may look along the axis in a reading that makes sense: poses err.
const MAX_AXIAL_FRACTION: f64 = 0.05;
/// Motion and turning farther than this from the axis go another way: twice the 30° to which a
/// carrier that sways by 6° a frame and steers back ([`Jitter`](crate::trajectory::Jitter)) leans.
/// Another axis of the world is 90° off.
const MIN_ASKEW_ANGLE_RAD: f64 = std::f64::consts::FRAC_PI_3;
/// Motion and turning within this of the axis go along it.
const MAX_ALIGNED_ANGLE_RAD: f64 = std::f64::consts::FRAC_PI_6;

/// How poses stand in the tunnel.
struct PoseSummary {
    frames: usize,
    outside: usize,
    axial: usize,
    /// Of poses in the tunnel's frame.
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

    fn is_wrong(&self) -> bool {
        self.frames >= MIN_FRAMES && self.share(self.outside.max(self.axial)) > MAX_WRONG_FRACTION
    }

    fn is_right(&self) -> bool {
        let along = |direction: &Option<Vector3<f64>>| {
            direction.is_none_or(|d| d.y.abs() > MAX_ALIGNED_ANGLE_RAD.cos())
        };
        self.outside == 0
            && self.share(self.axial) <= MAX_AXIAL_FRACTION
            && along(&self.course.motion)
            && along(&self.course.turning)
    }

    /// Nothing is impossible, but the camera moves and turns across the tunnel.
    fn is_suspicious(&self) -> bool {
        let askew = |direction: &Option<Vector3<f64>>| direction.is_some_and(|d| is_askew(&d));
        let (motion, turning) = (askew(&self.course.motion), askew(&self.course.turning));
        let some_axial = self.share(self.axial) > MAX_AXIAL_FRACTION;
        self.frames >= MIN_FRAMES
            && ((turning && (motion || some_axial)) || (motion && !self.course.turns))
    }
}

fn is_askew(direction: &Vector3<f64>) -> bool {
    direction.y.abs() < MIN_ASKEW_ANGLE_RAD.cos()
}

/// Whether the picture holds a vanishing point of the axis.
fn looks_along_the_axis(camera: &Camera, pose: &Pose) -> bool {
    [Vector3::y(), -Vector3::y()].iter().any(|along| {
        let direction = pose.r_wc.inverse_transform_vector(along);
        camera
            .project(&direction)
            .is_some_and(|pixel| camera.is_in_image(&pixel, 0.0))
    })
}

/// The directions in which a trajectory goes, if it has any; unit vectors.
struct MotionDirections {
    /// The line along which the cameras lie, towards the last.
    motion: Option<Vector3<f64>>,
    /// Whether they turn at all.
    turns: bool,
    /// The axis about which they turn.
    turning: Option<Vector3<f64>>,
    /// Mean of the cameras' places, metres.
    middle: Vector3<f64>,
}

/// Share of the spread that the line of motion must hold: five times as long as wide.
const MIN_LINE_FRACTION: f64 = 25.0 / 26.0;
/// Share of all turning that must be about one axis.
const MIN_AXIS_FRACTION: f64 = 0.75;
/// Turning from frame to frame below this is the carrier's swaying, root mean square.
const MIN_ROTATION_RAD: f64 = 0.05;
/// Motion below this, in all, is none, metres. Cameras lie inside tunnels of a larger radius in any
/// case.
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
        Self {
            motion,
            turns: does_turn,
            turning: main_direction(&turns, MIN_AXIS_FRACTION).filter(|_| does_turn),
            middle,
        }
    }
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

/// Another reading of the same file.
struct ConventionChange {
    convention: Convention,
    /// What would have to be said for it, one after the other.
    flags: Vec<String>,
}

impl ConventionChange {
    fn remedy(&self) -> String {
        self.flags.join(" and ")
    }
}

/// All other readings.
fn convention_changes(reading: &InterpretedPoses) -> Vec<ConventionChange> {
    let given = reading.convention;
    let mut found = Vec::new();
    for direction in [given.direction, given.direction.other()] {
        for axes in [given.axes, given.axes.other()] {
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

/// A reading with the tunnel's axis elsewhere.
fn with_other_axes(
    reading: &InterpretedPoses,
    convention: &Convention,
    flags: &[String],
) -> Vec<ConventionChange> {
    let along = |axis: TunnelAxis| {
        // The frame is that of the numbers as they are printed.
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

/// The reading that makes sense with the fewest changes, and of several the one with the shortest
/// path: a wrong reading swings the cameras about with their errors.
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

/// Paths that differ by less than this share are equally long.
const PATH_TIE_RATIO: f64 = 1e-3;

/// Length of the way from camera to camera, metres.
fn path_m(poses: &[Pose]) -> f64 {
    let ways = poses.iter().zip(poses.iter().skip(1));
    ways.map(|(before, after)| (after.t_wc - before.t_wc).norm())
        .sum()
}

/// Axes that the poses of a reading might go along: those of their world, then the line of their
/// motion, then the axis of their turning.
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

/// The readings with the tunnel's axis where it is that leave all cameras inside: what only
/// pictures can tell apart.
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

/// Checks the poses of a file against the tunnel; returns warnings where they are possible but
/// suspicious.
///
/// # Errors
/// A camera outside; most cameras looking along the axis, where another reading makes sense of
/// them.
pub(super) fn validate_poses(
    surface: &dyn Surface,
    camera: &Camera,
    reading: &InterpretedPoses,
    poses: &[Pose],
    path: &Path,
) -> Result<Vec<String>, SurveyError> {
    let stand = PoseSummary::of(surface, camera, poses);
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
                Some(other) => format!(
                    "{} of {} cameras are; they would all be inside and look at the wall with {other}",
                    stand.outside, stand.frames
                ),
                None => "check radius_m and the poses' origin, units and convention (--pose-convention, --tunnel-frame)"
                    .to_owned(),
            },
        });
    }
    if stand.is_wrong()
        && let Some(other) = remedy()
    {
        return Err(SurveyError::Association {
            path: path.to_owned(),
            what: format!(
                "{} of {} cameras look along the tunnel's axis; they would look at the wall with {other}",
                stand.axial, stand.frames
            ),
        });
    }
    if stand.is_suspicious() {
        let likely = remedy().map_or(String::new(), |other| {
            format!("; they would go along it with {other}")
        });
        return Ok(vec![format!(
            "{}: the cameras move or turn across the tunnel, not along its axis (the world's y){likely}",
            path.display()
        )]);
    }
    Ok(Vec::new())
}

#[cfg(test)]
mod tests;
