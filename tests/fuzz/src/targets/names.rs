//! Names of frames: a CSV of poses and a COLMAP model give them back, or refuse them.

use super::super::file;
use nalgebra::{UnitQuaternion, Vector3};
use tunnelstitch::trajectory::{Pose, PoseFormat, StampedPose, colmap, csv, read_poses};

/// Writes poses of two frames and reads them.
pub fn run(data: &[u8]) {
    let Ok(name) = std::str::from_utf8(data) else {
        return;
    };
    let names = [name.to_owned(), "next.png".to_owned()];
    if name.is_empty() || name.contains('\0') {
        return;
    }
    let poses: Vec<StampedPose> = (0..2)
        .map(|k| StampedPose {
            time_s: f64::from(k),
            pose: Pose {
                r_wc: UnitQuaternion::identity(),
                t_wc: Vector3::new(f64::from(k), 0.0, 0.0),
            },
        })
        .collect();
    let texts = [
        (PoseFormat::Csv, Some(csv::format(&names, &poses))),
        (
            PoseFormat::Colmap,
            colmap::format_images(&names, &poses).ok(),
        ),
    ];
    for (format, text) in texts {
        let Some(text) = text else { continue };
        let (_folder, path) = file("poses.txt", text.as_bytes());
        let read = read_poses(&path, Some(format)).unwrap();
        let read: Vec<_> = read
            .entries
            .iter()
            .map(|entry| entry.name.clone())
            .collect();
        let names = names.each_ref().map(|name| Some(name.clone()));
        assert_eq!(read, names, "{text}");
    }
}
