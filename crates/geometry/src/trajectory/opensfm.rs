//! OpenSfM's `reconstruction.json`: `shots` by their names, each with a `rotation` (rotation
//! vector, radians) and a `translation`, **world-to-camera** in OpenCV's axes.
//!
//! Positions are metres where OpenSfM knew positions of GPS or of marks, else of an unknown scale.
//! Source: OpenSfM's documentation, "Geometric Models", "Reconstruction File Format".

use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::{json_form, so3};
use nalgebra::Vector3;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Deserialize)]
struct Reconstruction {
    shots: BTreeMap<String, Shot>,
}

#[derive(Deserialize)]
struct Shot {
    rotation: [f64; 3],
    translation: [f64; 3],
}

pub(super) fn parse(path: &Path, text: &str) -> Result<Vec<PoseEntry>, PoseError> {
    let fail = |what: String| PoseError::file(path, what);
    let parts: Vec<Reconstruction> =
        serde_json::from_str(text).map_err(|error| fail(json_form::mismatch(text, &error)))?;
    if parts.len() > 1 {
        let counts: Vec<String> = parts
            .iter()
            .map(|part| part.shots.len().to_string())
            .collect();
        return Err(fail(format!(
            "holds {} reconstructions (of {} shots), each in a world of its own; leave the one of \
             the survey",
            parts.len(),
            counts.join(", ")
        )));
    }
    let shots = parts.into_iter().flat_map(|part| part.shots);
    shots
        .map(|(name, shot)| {
            let rotation = so3::exp(&Vector3::from(shot.rotation));
            let pose = Pose::new(rotation, Vector3::from(shot.translation));
            if !pose.is_finite() {
                return Err(fail(format!(
                    "shot {name}: its rotation is no rotation vector in radians"
                )));
            }
            Ok(PoseEntry::named(name, pose))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use crate::trajectory::format_tests::read_named;
    use crate::trajectory::{Convention, PoseFile, PoseFormat};
    use nalgebra::Vector3;
    use std::f64::consts::FRAC_PI_2;

    fn read(text: &str) -> Result<PoseFile, String> {
        read_named("reconstruction.json", text)
    }

    /// A camera at (1, 2, 3) that looks along the world's x, x of the picture towards −z: a quarter
    /// of a turn about y from the world to the camera. A point 4 m ahead and 0.5 m below is at
    /// (0, 0.5, 4) in the camera.
    #[test]
    fn shots_map_the_world_to_the_camera() {
        let shot = |name: &str, translation: &str| {
            format!(
                r#""{name}": {{"rotation": [0, -{FRAC_PI_2}, 0], "translation": {translation},
                    "camera": "c", "gps_position": [0, 0, 0], "scale": 1.0}}"#
            )
        };
        let text = format!(
            r#"[{{"cameras": {{}}, "shots": {{{}, {}}}, "points": {{"1": {{"color": [1, 2, 3],
                "coordinates": [0.5, 1, 2]}}}}, "reference_lla": {{"latitude": 1}}}}]"#,
            shot("b.jpg", "[3, -2, -1]"),
            shot("a.jpg", "[0, 0, 0]")
        );
        let file = read(&text).unwrap();
        assert_eq!(file.format, PoseFormat::Opensfm);
        assert!(file.has_names() && !file.has_times());
        assert_eq!(file.entries[1].name.as_deref(), Some("b.jpg"));
        let pose = Convention::of(file.format).to_world(&file.entries[1].pose);
        assert!((pose.t_wc - Vector3::new(1.0, 2.0, 3.0)).norm() < 1e-12);
        let seen = pose.to_camera(&Vector3::new(5.0, 2.5, 3.0));
        assert!(
            (seen - Vector3::new(0.0, 0.5, 4.0)).norm() < 1e-12,
            "{seen}"
        );
    }

    #[test]
    fn broken_reconstructions_are_refused() {
        let two = r#"[{"shots": {"a": {"rotation": [0, 0, 0], "translation": [0, 0, 0]}}},
            {"shots": {}}]"#;
        for (text, expected) in [
            (two, "holds 2 reconstructions (of 1, 0 shots)"),
            ("[]", "holds no poses"),
            ("[{", "line 1 column 2"),
            (
                r#"[{"shots": {"a": {"rotation": [0, 0, 0]}}}]"#,
                "missing field `translation`",
            ),
            (
                r#"[{"shots": {"a": {"rotation": [1e300, 0, 1e300], "translation": [0, 0, 0]}}}]"#,
                "shot a: its rotation",
            ),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}
