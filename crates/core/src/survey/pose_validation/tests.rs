//! Correct surveys cause no warnings, and wrong conventions are named.

use super::*;
use rand::SeedableRng;
use std::f64::consts::FRAC_PI_2;
use tunnelstitch_geometry::surface::Circle;
use tunnelstitch_geometry::trajectory::{
    CameraAxes, Direction, Jitter, JitterModel, PoseFormat, indexed, poses_of, spiral,
};

const RADIUS_M: f64 = 3.0;

/// Validates poses in the convention of `given`.
fn verdict(poses: &[Pose], given: Convention) -> Result<Vec<String>, String> {
    let reading = InterpretedPoses {
        of_pictures: false,
        given: indexed(poses.iter().copied()),
        convention: given,
        format: PoseFormat::Tum,
        gaps: Vec::new(),
        conflicts: Vec::new(),
    };
    let surface = Circle::new(RADIUS_M).unwrap();
    let camera = Camera::from_vertical_fov(640, 480, 60f64.to_radians());
    let all = poses_of(&reading.trajectory());
    let path = Path::new("poses.tum");
    let has_own_axes = given.axes != CameraAxes::OpenCv;
    validate_poses(&surface, &camera, &reading, &all, path, has_own_axes)
        .map_err(|error| error.to_string())
}

fn tum() -> Convention {
    Convention::of(PoseFormat::Tum)
}

/// A camera that revolves `offset_m` off the axis, with errors of `times` · (2°, (2, 2, 3) cm) per
/// step.
fn flight(
    frames: usize,
    advance_m: f64,
    offset_m: f64,
    model: JitterModel,
    times: f64,
    seed: u64,
) -> Vec<Pose> {
    let turn_rad = 30f64.to_radians();
    let plan: Vec<Pose> = spiral(frames, advance_m, turn_rad)
        .into_iter()
        .map(|pose| Pose::new(pose.r_wc, pose.t_wc + Vector3::x() * offset_m))
        .collect();
    let jitter = Jitter {
        model,
        rotation_sigma_rad: times * 2f64.to_radians(),
        translation_sigma_m: [0.02, 0.02, 0.03].map(|sigma| times * sigma),
    };
    jitter.apply(&plan, &mut rand_chacha::ChaCha8Rng::seed_from_u64(seed))
}

/// Rings with little advance, on and off the axis, with few and many frames and up to six times the
/// noise.
#[test]
fn sound_surveys_raise_no_alarm() {
    for seed in 0..40 {
        for model in [JitterModel::RandomWalk, JitterModel::Independent] {
            for frames in [2, 3, 5, 12, 120] {
                for advance_m in [0.0, 1e-3, 0.1] {
                    for offset_m in [0.0, 1.5] {
                        for times in [0.0, 1.0, 3.0] {
                            let poses = flight(frames, advance_m, offset_m, model, times, seed);
                            let said = verdict(&poses, tum());
                            assert_eq!(
                                said,
                                Ok(vec![]),
                                "{model:?} {frames} {advance_m} {offset_m} {times} {seed}"
                            );
                        }
                    }
                }
            }
        }
    }
    let ring: Vec<Pose> = spiral(12, 0.0, 30f64.to_radians())
        .iter()
        .map(|pose| Pose::new(pose.r_wc, pose.r_wc * Vector3::z() * 2.0))
        .collect();
    assert_eq!(verdict(&ring, tum()), Ok(vec![]));
}

/// A trajectory whose world has the tunnel along another direction.
fn elsewhere(axis: [f64; 3], point_m: [f64; 3]) -> (TunnelAxis, Vec<Pose>) {
    let axis = TunnelAxis {
        point_m,
        axis,
        theta_zero: None,
    };
    let frame = axis.frame().unwrap();
    let poses = flight(120, 0.1, 0.1, JitterModel::RandomWalk, 1.0, 5);
    (axis, poses.iter().map(|pose| frame.after(pose)).collect())
}

#[test]
fn an_axis_along_another_direction_is_named_and_mends_it() {
    for (axis, point_m) in [
        ([1.0, 0.0, 0.0], [0.0; 3]),
        ([0.0, 0.0, 1.0], [0.0; 3]),
        ([0.0, -1.0, 0.5], [0.0, 40.0, 0.0]),
        ([1.0, 2.0, -2.0], [7.0, -20.0, 3.0]),
    ] {
        let (_, poses) = elsewhere(axis, point_m);
        let message = verdict(&poses, tum()).unwrap_err();
        let json = message.split("with the FILE ").nth(1).expect(&message);
        let told: TunnelAxis = serde_json::from_str(json).unwrap();
        let mended = Convention {
            tunnel_in_world: Some(told.frame().unwrap()),
            ..tum()
        };
        assert_eq!(verdict(&poses, mended), Ok(vec![]), "{message}");
        let direction = Vector3::from(axis).normalize();
        assert!(Vector3::from(told.axis).dot(&direction) > 0.99, "{message}");
    }
}

/// Cameras inside that see no end of the tunnel, but move and turn across it: a warning.
#[test]
fn a_short_motion_across_the_tunnel_is_suspicious() {
    let axis = TunnelAxis {
        point_m: [0.0; 3],
        axis: [1.0, 0.0, 0.0],
        theta_zero: None,
    };
    let frame = axis.frame().unwrap();
    let poses: Vec<Pose> = spiral(12, 0.1, 5f64.to_radians())
        .iter()
        .map(|pose| frame.after(pose))
        .collect();
    let warnings = verdict(&poses, tum()).unwrap();
    let told =
        |text: &String| text.contains("across the tunnel") && text.contains("--tunnel-frame");
    assert!(warnings.iter().any(told), "{warnings:?}");
}

/// A world in which the first pose is far from the origin: the wrong direction puts cameras far
/// outside.
#[test]
fn the_wrong_direction_is_named() {
    let poses: Vec<Pose> = flight(120, 0.5, 0.5, JitterModel::RandomWalk, 1.0, 3)
        .iter()
        .map(Pose::inverse)
        .collect();
    let message = verdict(&poses, tum()).unwrap_err();
    assert!(
        message.contains("with --pose-convention w2c (poses.convention"),
        "{message}"
    );
    let right = Convention {
        direction: Direction::WorldToCamera,
        ..tum()
    };
    assert_eq!(verdict(&poses, right), Ok(vec![]));
    let colmap = Convention::of(PoseFormat::Colmap);
    let inverse: Vec<Pose> = poses.iter().map(Pose::inverse).collect();
    let message = verdict(&inverse, colmap).unwrap_err();
    assert!(message.contains("--pose-convention c2w"), "{message}");
}

/// The body's axes are not the camera's: with the mount the wrong way round the camera looks along
/// the tunnel.
#[test]
fn an_inverted_mount_is_named() {
    let camera_in_body = Pose::new(
        so3::exp(&(Vector3::x() * 45f64.to_radians())),
        Vector3::new(0.1, 0.0, 0.2),
    );
    let poses: Vec<Pose> = flight(60, 0.1, 0.0, JitterModel::RandomWalk, 1.0, 3)
        .iter()
        .map(|pose| pose.after(&camera_in_body.inverse()))
        .collect();
    let right = Convention {
        camera_in_body: Some(camera_in_body),
        ..tum()
    };
    assert_eq!(verdict(&poses, right), Ok(vec![]));
    let wrong = Convention {
        camera_in_body: Some(camera_in_body.inverse()),
        ..tum()
    };
    let message = verdict(&poses, wrong).unwrap_err();
    assert!(
        message.contains("inverse of the matrix of --body-to-camera"),
        "{message}"
    );
}

/// A few wrong poses do not indicate a wrong convention.
#[test]
fn one_camera_outside_is_no_convention() {
    let mut poses = flight(24, 0.1, 0.0, JitterModel::RandomWalk, 1.0, 3);
    poses[7].t_wc.x = 4.0;
    let message = verdict(&poses, tum()).unwrap_err();
    assert!(
        message.contains("frame 7") && message.contains("1 of 24 cameras are"),
        "{message}"
    );
}

/// On the axis of a short tunnel, a camera with OpenGL's axes looks at the opposite wall: the poses
/// are valid.
#[test]
fn what_only_pictures_can_tell_raises_no_alarm() {
    let poses: Vec<Pose> = spiral(48, 0.1, 30f64.to_radians())
        .iter()
        .map(|pose| CameraAxes::OpenGl.turn(pose))
        .collect();
    assert_eq!(verdict(&poses, tum()), Ok(vec![]));
}

/// A camera that looks ahead and rolls, or a body of ROS whose camera looks at the wall: only
/// pictures tell. Nothing is refused, and what is said of it can be confirmed.
#[test]
fn cameras_that_look_ahead_and_roll_are_not_refused() {
    let ahead: Vec<Pose> = flight(48, 0.1, 0.0, JitterModel::RandomWalk, 1.0, 3)
        .iter()
        .map(|pose| {
            Pose::new(
                pose.r_wc * so3::exp(&(-Vector3::x() * FRAC_PI_2)),
                pose.t_wc,
            )
        })
        .collect();
    let said = verdict(&ahead, tum()).unwrap();
    assert!(
        said.len() == 1
            && said[0].contains("48 of 48 cameras look along the tunnel's axis and turn about it")
            && said[0].contains("camera_axes = \"opencv\" under [poses] confirms it"),
        "{said:?}"
    );
    let gl: Vec<Pose> = (ahead.iter())
        .map(|pose| CameraAxes::OpenGl.turn(pose))
        .collect();
    let own = Convention {
        axes: CameraAxes::OpenGl,
        ..tum()
    };
    assert_eq!(verdict(&gl, own), Ok(vec![]));
}
