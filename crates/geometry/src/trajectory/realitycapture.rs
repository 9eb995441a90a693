//! RealityCapture's CSV of cameras (RealityScan's, too): a comment names the columns, among them
//! `name`, `x`, `y`, `alt`, `heading`, `pitch` and `roll`, angles in degrees.
//!
//! In a world with x east, y north and z up, the camera of angles 0 looks down, the upper side of
//! its picture to the north. With OpenGL's axes of the camera its rotation to the world is
//! `R = R_z(−heading) R_x(pitch) R_y(roll)`; heading is clockwise as seen from above. Source:
//! Capturing Reality, "Registration export and camera orientations"; nerfstudio 1.1,
//! `realitycapture_utils.py`.

use super::csv::{separator, split};
use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::text;
use nalgebra::{UnitQuaternion, Vector3};
use std::path::Path;

/// The columns that a camera has; `heading` is called `yaw` in some files.
const COLUMNS: [&str; 7] = ["name", "x", "y", "alt", "heading", "pitch", "roll"];
const FORM: &str = "name,x,y,alt,heading,pitch,roll";

/// The comment with the names of the columns.
struct Header {
    separator: u8,
    /// Number of all columns.
    count: usize,
    /// Places of [`COLUMNS`].
    places: [usize; 7],
}

/// True for a text whose comments name the columns of a camera.
pub(super) fn is_table(text: &str) -> bool {
    find_header(text).is_some()
}

fn find_header(text: &str) -> Option<Header> {
    let lines = text.lines().map(str::trim);
    let mut comments = lines.take_while(|line| line.is_empty() || line.starts_with('#'));
    comments.find_map(|line| header(line.trim_start_matches('#')))
}

fn header(line: &str) -> Option<Header> {
    let separator = separator(line);
    let titles = split(line, separator).ok()?;
    let is = |title: &str, name: &str| {
        let title = title.to_lowercase();
        title == name || (name == "heading" && title == "yaw")
    };
    let mut places = [0; 7];
    for (place, name) in places.iter_mut().zip(COLUMNS) {
        *place = titles.iter().position(|title| is(title, name))?;
    }
    Some(Header {
        separator,
        count: titles.len(),
        places,
    })
}

pub(super) fn parse(path: &Path, text: &str) -> Result<Vec<PoseEntry>, PoseError> {
    let header = find_header(text).ok_or_else(|| {
        let what = format!("has no comment `#{FORM}` that names its columns");
        PoseError::file(path, what)
    })?;
    let mut names = text::Names::default();
    let mut entries = Vec::new();
    for (number, line) in text::lines(text) {
        let fail = |what: String| PoseError::line(path, number, what);
        let entry = camera(line, &header).map_err(fail)?;
        names
            .add(entry.name.as_deref().unwrap_or_default())
            .map_err(fail)?;
        entries.push(entry);
    }
    Ok(entries)
}

fn camera(line: &str, header: &Header) -> Result<PoseEntry, String> {
    let record = split(line, header.separator)?;
    if record.len() != header.count {
        return Err(format!(
            "{} columns where the comment names {}",
            record.len(),
            header.count
        ));
    }
    let [name, numbers @ ..] = header.places;
    let mut values = [0.0; 6];
    for (value, place) in values.iter_mut().zip(numbers) {
        *value = text::number(record.get(place).unwrap_or_default(), FORM)?;
    }
    let [x, y, alt, heading, pitch, roll] = values;
    let name = record.get(name).filter(|name| !name.is_empty());
    let name = name.ok_or("the camera has no name")?;
    Ok(PoseEntry::named(
        name,
        Pose::new(rotation([heading, pitch, roll]), Vector3::new(x, y, alt)),
    ))
}

/// The rotation from the camera, in OpenGL's axes, to the world; angles in degrees.
fn rotation(angles_deg: [f64; 3]) -> UnitQuaternion<f64> {
    let [heading, pitch, roll] = angles_deg.map(f64::to_radians);
    let about = UnitQuaternion::from_axis_angle;
    about(&Vector3::z_axis(), -heading)
        * about(&Vector3::x_axis(), pitch)
        * about(&Vector3::y_axis(), roll)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::format_tests::read_named;
    use crate::trajectory::{CameraAxes, Convention, PoseFile, PoseFormat};

    fn read(text: &str) -> Result<PoseFile, String> {
        read_named("cameras.csv", text)
    }

    /// The world-to-camera matrix that the makers of the program publish, row by row: OpenCV's
    /// axes, y, p and r in degrees.
    fn published([y, p, r]: [f64; 3]) -> [[f64; 3]; 3] {
        let [(sz, cz), (sy, cy), (sx, cx)] = [y, p, r].map(|angle| angle.to_radians().sin_cos());
        [
            [cx * cz + sx * sy * sz, -cx * sz + cz * sx * sy, -cy * sx],
            [-cy * sz, -cy * cz, -sy],
            [cx * sy * sz - cz * sx, cx * cz * sy + sx * sz, -cx * cy],
        ]
    }

    #[test]
    fn angles_are_those_of_the_published_matrix() {
        for angles in [
            [0.0, 0.0, 0.0],
            [90.0, 0.0, 0.0],
            [163.7, 83.4, 174.4],
            [-20.0, 100.0, -35.0],
        ] {
            let given = Pose::new(rotation(angles), Vector3::zeros());
            let pose = CameraAxes::OpenGl.turn(&given);
            let to_camera = pose.r_wc.inverse().to_rotation_matrix();
            for (k, row) in published(angles).iter().enumerate() {
                for (j, value) in row.iter().enumerate() {
                    assert!((to_camera[(k, j)] - value).abs() < 1e-12, "{angles:?}");
                }
            }
        }
    }

    /// A camera that looks north (pitch 90°), and one that looks east (heading 90°).
    #[test]
    fn cameras_look_where_their_heading_says() {
        let text = "#cameras 2\n#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n\
            a.jpg,1,2,3,0,90,0,35,0,0,0,0,0,0,0,0\nb.jpg,1,2,3,90,90,0,35,0,0,0,0,0,0,0,0\n";
        for text in [
            text.to_owned(),
            text.replace(',', ";").replace("heading", "Yaw"),
        ] {
            let file = read(&text).unwrap();
            assert_eq!(file.format, PoseFormat::Realitycapture);
            let convention = Convention::of(file.format);
            let poses = [0, 1].map(|k| convention.to_world(&file.entries[k].pose));
            assert_eq!(poses[0].t_wc, Vector3::new(1.0, 2.0, 3.0));
            assert_eq!(file.entries[1].name.as_deref(), Some("b.jpg"));
            for (pose, ahead) in poses.iter().zip([Vector3::y(), Vector3::x()]) {
                assert!((pose.r_wc * Vector3::z() - ahead).norm() < 1e-12);
                assert!((pose.r_wc * Vector3::y() + Vector3::z()).norm() < 1e-12);
            }
        }
    }

    #[test]
    fn broken_tables_say_where() {
        let header = "#name,x,y,alt,heading,pitch,roll\n";
        for (rows, expected) in [
            (
                "a,1,2,3,0,0\n",
                "csv:2: 6 columns where the comment names 7",
            ),
            ("a,1,2,3,0,0,x\n", "csv:2: `x` is not a number"),
            (
                "a,1,2,3,0,0,0\n\na,1,2,3,0,0,0\n",
                "csv:4: a second pose of a",
            ),
            (",1,2,3,0,0,0\n", "csv:2: the camera has no name"),
            ("", "holds no poses"),
        ] {
            let message = read(&format!("{header}{rows}")).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}
