//! Pix4D's `…_calibrated_external_camera_parameters.txt`: lines `imageName X Y Z Omega Phi Kappa`,
//! angles in degrees.
//!
//! `R = R_x(ω) R_y(φ) R_z(κ)` turns the camera's axes, x to the right, y up and z backwards in the
//! picture, to those of the world: `X' = Rᵀ (X − T)`. Positions are those of the output coordinate
//! system, less the offset in `…_offset.xyz`. Source: Pix4D, "How are the internal and external
//! camera parameters defined?"; "Yaw, Pitch, Roll and Omega, Phi, Kappa angles".

use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::text;
use nalgebra::{UnitQuaternion, Vector3};
use std::path::Path;

const FORM: &str = "imageName X Y Z Omega Phi Kappa";
/// Numbers behind the name.
const NUMBERS: usize = 6;

/// True for the first line of such a file.
pub(super) fn is_header(line: &str) -> bool {
    let words = line.split_whitespace();
    words
        .map(str::to_lowercase)
        .eq(FORM.split(' ').map(str::to_lowercase))
}

pub(super) fn parse(path: &Path, text: &str) -> Result<Vec<PoseEntry>, PoseError> {
    let mut names = text::Names::default();
    let mut entries = Vec::new();
    for (number, line) in text::lines(text).filter(|(_, line)| !is_header(line)) {
        let fail = |what: String| PoseError::line(path, number, what);
        let entry = camera(line).map_err(fail)?;
        names
            .add(entry.name.as_deref().unwrap_or_default())
            .map_err(fail)?;
        entries.push(entry);
    }
    Ok(entries)
}

fn camera(line: &str) -> Result<PoseEntry, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let Some((name, numbers)) = words
        .len()
        .checked_sub(NUMBERS)
        .filter(|before| *before > 0)
        .map(|before| words.split_at(before))
    else {
        return Err(format!("{} columns where `{FORM}` has 7", words.len()));
    };
    let mut values = [0.0; NUMBERS];
    for (value, word) in values.iter_mut().zip(numbers) {
        *value = text::number(word, FORM)?;
    }
    let [x, y, z, omega, phi, kappa] = values;
    Ok(PoseEntry::named(
        name.join(" "),
        Pose::new(rotation([omega, phi, kappa]), Vector3::new(x, y, z)),
    ))
}

/// The rotation from the camera, in OpenGL's axes, to the world; angles in degrees.
fn rotation(angles_deg: [f64; 3]) -> UnitQuaternion<f64> {
    let [omega, phi, kappa] = angles_deg.map(f64::to_radians);
    let about = UnitQuaternion::from_axis_angle;
    about(&Vector3::x_axis(), omega)
        * about(&Vector3::y_axis(), phi)
        * about(&Vector3::z_axis(), kappa)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::format_tests::read_named;
    use crate::trajectory::{Convention, PoseFile, PoseFormat};

    fn read(text: &str) -> Result<PoseFile, String> {
        read_named("external.txt", text)
    }

    /// The elements of R as textbooks write them out.
    #[test]
    fn the_matrix_is_that_of_photogrammetry() {
        let angles = [12.0, -34.0, 156.0];
        let [(so, co), (sp, cp), (sk, ck)] = angles.map(|angle: f64| angle.to_radians().sin_cos());
        let expected = [
            [cp * ck, -cp * sk, sp],
            [co * sk + so * sp * ck, co * ck - so * sp * sk, -so * cp],
            [so * sk - co * sp * ck, so * ck + co * sp * sk, co * cp],
        ];
        let matrix = rotation(angles).to_rotation_matrix();
        for (k, row) in expected.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                assert!((matrix[(k, j)] - value).abs() < 1e-12);
            }
        }
    }

    /// Angles 0: straight down, the picture's upper side north. ω = 90°: north, upright. With
    /// κ = 90° too, the camera is turned counter-clockwise about its axis: its right side is up.
    #[test]
    fn cameras_look_where_their_angles_say() {
        let text = "imageName X Y Z Omega Phi Kappa\na b.jpg 1 2 3 0 0 0\nb.jpg 0 0 0 90 0 0\n\
            c.jpg 0 0 0 90.0 0.0 90.0\n";
        let file = read(text).unwrap();
        assert_eq!(file.format, PoseFormat::Pix4d);
        assert_eq!(file.entries[0].name.as_deref(), Some("a b.jpg"));
        let convention = Convention::of(file.format);
        let poses = file
            .entries
            .iter()
            .map(|entry| convention.to_world(&entry.pose));
        let (right, up) = (Vector3::x(), Vector3::z());
        let expected = [(right, -up), (right, Vector3::y()), (up, Vector3::y())];
        for (pose, (right, ahead)) in poses.zip(expected) {
            assert!((pose.r_wc * Vector3::x() - right).norm() < 1e-12);
            assert!((pose.r_wc * Vector3::z() - ahead).norm() < 1e-12);
        }
        assert_eq!(file.entries[0].pose.t_wc, Vector3::new(1.0, 2.0, 3.0));
    }

    #[test]
    fn broken_files_say_where() {
        let header = "imageName X Y Z Omega Phi Kappa\n";
        for (rows, expected) in [
            ("1 2 3 4 5 6\n", "txt:2: 6 columns"),
            ("a.jpg 1 2 3 4 5 x\n", "txt:2: `x` is not a number"),
            (
                "a 1 2 3 4 5 6\na 1 2 3 4 5 6\n",
                "txt:3: a second pose of a",
            ),
            ("", "holds no poses"),
        ] {
            let message = read(&format!("{header}{rows}")).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}
