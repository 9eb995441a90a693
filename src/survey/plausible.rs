//! Whether poses make sense in the tunnel, and which other reading of them would.
//!
//! A wrong convention puts cameras outside, has them look along the axis, or has them move and turn along another direction. Where
//! that is so, the other readings are tried, the simplest first, and the one that makes sense is named with its flag. A reading
//! that leaves all cameras inside and looking at the wall cannot be told from a right one here: only the pictures can.

use super::SurveyError;
use super::reader::Reading;
use crate::camera::Pinhole;
use crate::surface::Surface;
use crate::trajectory::{Convention, Pose, TunnelAxis, so3};
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use std::path::Path;

/// Fewer frames show no convention.
const LEAST_FRAMES: usize = 4;
/// Share of frames that must be outside or look along the axis before another reading is looked for: single ones are wrong poses.
const WRONG_SHARE: f64 = 0.34;
/// Share of frames that may look along the axis in a reading that makes sense: poses err.
const RIGHT_SHARE: f64 = 0.05;
/// Motion and turning farther than this from the axis go another way.
const ASKEW_RAD: f64 = std::f64::consts::FRAC_PI_4;

/// How poses stand in the tunnel.
struct Stand {
    frames: usize,
    outside: usize,
    axial: usize,
    /// Of poses in the tunnel's frame.
    course: Course,
}

impl Stand {
    fn of(surface: &dyn Surface, camera: &Pinhole, poses: &[Pose]) -> Self {
        let outside = |pose: &&Pose| surface.check_inside(&pose.t_wc).is_err();
        Self {
            frames: poses.len(),
            outside: poses.iter().filter(outside).count(),
            axial: poses
                .iter()
                .filter(|pose| looks_along_the_axis(camera, pose))
                .count(),
            course: Course::of(poses),
        }
    }

    fn share(&self, count: usize) -> f64 {
        count as f64 / self.frames.max(1) as f64
    }

    fn is_wrong(&self) -> bool {
        self.frames >= LEAST_FRAMES && self.share(self.outside.max(self.axial)) > WRONG_SHARE
    }

    fn is_right(&self) -> bool {
        let along = |direction: &Option<Vector3<f64>>| direction.is_none_or(|d| !is_askew(&d));
        self.outside == 0
            && self.share(self.axial) <= RIGHT_SHARE
            && along(&self.course.motion)
            && along(&self.course.turning)
    }

    /// Nothing is impossible, but the camera moves and turns across the tunnel.
    fn is_suspicious(&self) -> bool {
        let askew = |direction: &Option<Vector3<f64>>| direction.is_some_and(|d| is_askew(&d));
        let (motion, turning) = (askew(&self.course.motion), askew(&self.course.turning));
        let some_axial = self.share(self.axial) > RIGHT_SHARE;
        self.frames >= LEAST_FRAMES
            && ((motion && turning)
                || (turning && some_axial)
                || (motion && self.course.turning.is_none()))
    }
}

fn is_askew(direction: &Vector3<f64>) -> bool {
    direction.y.abs() < ASKEW_RAD.cos()
}

/// Whether the picture holds a vanishing point of the axis.
fn looks_along_the_axis(camera: &Pinhole, pose: &Pose) -> bool {
    [Vector3::y(), -Vector3::y()].iter().any(|along| {
        let direction = pose.r_wc.inverse_transform_vector(along);
        camera
            .project(&direction)
            .is_some_and(|pixel| camera.sees(&pixel, 0.0))
    })
}

/// The directions in which a trajectory goes, if it has any; unit vectors.
struct Course {
    /// The line along which the cameras lie, towards the last.
    motion: Option<Vector3<f64>>,
    /// The axis about which they turn.
    turning: Option<Vector3<f64>>,
    /// Mean of the cameras' places, metres.
    middle: Vector3<f64>,
}

/// Share of the spread that the line of motion must hold: five times as long as wide.
const LINE_SHARE: f64 = 25.0 / 26.0;
/// Share of all turning that must be about one axis.
const TURNING_SHARE: f64 = 0.75;
/// Turning from frame to frame below this is the carrier's swaying, root mean square.
const LEAST_TURN_RAD: f64 = 0.05;
/// Motion below this, in all, is none, metres. Cameras lie inside tunnels of a larger radius in any case.
const LEAST_MOTION_M: f64 = 1e-6;

impl Course {
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
        let turning_rms = (turns.trace() / count).sqrt();
        let motion = main_direction(&spread, LINE_SHARE)
            .filter(|_| (spread.trace() / count).sqrt() > LEAST_MOTION_M)
            .map(|line| match (poses.first(), poses.last()) {
                (Some(first), Some(last)) if line.dot(&(last.t_wc - first.t_wc)) < 0.0 => -line,
                _ => line,
            });
        Self {
            motion,
            turning: main_direction(&turns, TURNING_SHARE).filter(|_| turning_rms > LEAST_TURN_RAD),
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
struct Other {
    convention: Convention,
    /// What would have to be said for it.
    remedy: String,
}

/// All other readings, the simplest first.
fn others(reading: &Reading) -> Vec<Other> {
    let given = reading.convention;
    let mut found = Vec::new();
    for (direction, axes, mount) in [
        (true, false, false),
        (false, true, false),
        (false, false, true),
        (true, true, false),
        (true, false, true),
    ] {
        let mut other = given;
        let mut flags = Vec::new();
        if direction {
            other.direction = given.direction.other();
            let name = other.direction.name();
            flags.push(format!(
                "--pose-convention {name} (poses.convention = \"{name}\" in survey.toml)"
            ));
        }
        if axes {
            other.axes = given.axes.other();
            let name = other.axes.name();
            flags.push(format!(
                "--camera-axes {name} (poses.camera_axes = \"{name}\" in survey.toml)"
            ));
        }
        if mount {
            let Some(camera_in_body) = given.camera_in_body else {
                continue;
            };
            other.camera_in_body = Some(camera_in_body.inverse());
            flags.push("the inverse of the matrix of --body-to-camera".to_owned());
        }
        found.push(Other {
            convention: other,
            remedy: flags.join(" and "),
        });
    }
    let mut along_other_axes = Vec::new();
    let as_it_is = Other {
        convention: given,
        remedy: String::new(),
    };
    for other in std::iter::once(&as_it_is).chain(&found) {
        for axis in axes_of(reading, &other.convention) {
            // What a file says has few digits.
            let Ok(frame) = axis.frame() else { continue };
            let json = serde_json::to_string(&axis).unwrap_or_default();
            let flag = format!(
                "--tunnel-frame FILE (poses.tunnel_frame in survey.toml) with the FILE {json}"
            );
            along_other_axes.push(Other {
                convention: Convention {
                    tunnel_in_world: Some(frame),
                    ..other.convention
                },
                remedy: match other.remedy.as_str() {
                    "" => flag,
                    remedy => format!("{remedy} and {flag}"),
                },
            });
        }
    }
    // An axis elsewhere alone is simpler than one elsewhere and something else.
    let at = found.len().min(3);
    let rest = found.split_off(at);
    let mut all = found;
    all.extend(along_other_axes);
    all.extend(rest);
    all
}

/// Axes that the poses of a reading might go along: those of their world, then the line of their motion, then the axis of their
/// turning.
fn axes_of(reading: &Reading, convention: &Convention) -> Vec<TunnelAxis> {
    let poses: Vec<Pose> = reading
        .given
        .iter()
        .map(|stamped| convention.to_world(&stamped.pose))
        .collect();
    let course = Course::of(&poses);
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

/// Checks the poses of a file against the tunnel; returns warnings where they are possible but suspicious.
///
/// # Errors
/// A camera outside; most cameras looking along the axis, where another reading makes sense of them.
pub(super) fn check(
    surface: &dyn Surface,
    camera: &Pinhole,
    reading: &Reading,
    poses: &[Pose],
    path: &Path,
) -> Result<Vec<String>, SurveyError> {
    let stand = Stand::of(surface, camera, poses);
    let remedy = || {
        let sound = others(reading).into_iter().find(|other| {
            let all: Vec<Pose> = reading
                .given
                .iter()
                .map(|stamped| other.convention.to_tunnel(&stamped.pose))
                .collect();
            Stand::of(surface, camera, &all).is_right()
        });
        sound.map(|other| other.remedy)
    };
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
