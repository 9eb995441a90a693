//! COLMAP's text model: `images.txt` with two lines per image, **world-to-camera**.
//!
//! `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME`, then the points of the image, `X Y POINT3D_ID`
//! each; that line may be empty. Only the poses are read. Written files have no points.

use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::stamped_pose::StampedPose;
use super::text;
use nalgebra::Vector3;
use std::fmt::Write;
use std::path::Path;

/// Name of the pose file in the folder of a model.
pub const IMAGES_FILE: &str = "images.txt";
/// Name of the camera file.
pub const CAMERAS_FILE: &str = "cameras.txt";
/// Name of the point file.
pub const POINTS_FILE: &str = "points3D.txt";

const FORM: &str = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME";
/// Number of columns before the name.
const NUMBERS: usize = 9;

/// True for the first of the two lines of an image.
pub(super) fn is_line(line: &str) -> bool {
    let words: Vec<&str> = line.split_whitespace().collect();
    words.len() > NUMBERS
        && words[..NUMBERS]
            .iter()
            .all(|word| word.parse::<f64>().is_ok())
        && words[0].parse::<u64>().is_ok()
        && words[NUMBERS].parse::<f64>().is_err()
}

pub(super) fn parse(path: &Path, text: &str) -> Result<Vec<PoseEntry>, PoseError> {
    let mut entries = Vec::new();
    let mut names = text::Names::default();
    // The line of points directly follows the line of the image, even if it is empty.
    let mut points_next = false;
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        let fail = |what: String| PoseError::line(path, index + 1, what);
        if points_next {
            check_points(line).map_err(fail)?;
            points_next = false;
        } else if !line.is_empty() && !line.starts_with('#') {
            let entry = parse_line(line).map_err(fail)?;
            names
                .add(entry.name.as_deref().unwrap_or_default())
                .map_err(fail)?;
            entries.push(entry);
            points_next = true;
        }
    }
    Ok(entries)
}

fn parse_line(line: &str) -> Result<PoseEntry, String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [_, qw, qx, qy, qz, tx, ty, tz, camera, name @ ..] = words.as_slice() else {
        return Err(format!("{} columns where `{FORM}` has 10", words.len()));
    };
    if name.is_empty() {
        return Err(format!("9 columns where `{FORM}` has 10"));
    }
    let mut values = [0.0; 7];
    for (value, word) in values.iter_mut().zip([qw, qx, qy, qz, tx, ty, tz]) {
        *value = text::number(word, FORM)?;
    }
    let [qw, qx, qy, qz, tx, ty, tz] = values;
    let rotation = text::rotation([qw, qx, qy, qz], "QW QX QY QZ")?;
    let pose = Pose::new(rotation, Vector3::new(tx, ty, tz));
    Ok(PoseEntry {
        camera: camera.parse().ok(),
        ..PoseEntry::named(name.join(" "), pose)
    })
}

/// Checks that a line holds points or is empty.
fn check_points(line: &str) -> Result<(), String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let are_numbers = words.iter().all(|word| word.parse::<f64>().is_ok());
    if are_numbers && words.len().is_multiple_of(3) {
        Ok(())
    } else {
        Err(
        "should hold the points of the image above, `X Y POINT3D_ID` each, or be empty: an image \
         has two lines"
            .to_owned(),
    )
    }
}

/// A name that the format cannot hold: a line of an image is separated by blanks.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the frame {name:?} has a blank or a control character in its name, which COLMAP's text model \
     cannot hold; rename the file, or write csv"
)]
pub struct ImageNameError {
    /// The name.
    pub name: String,
}

/// Formats an `images.txt` for frames called `names`, all of camera 1; `trajectory` is
/// camera-to-world.
///
/// # Errors
/// [`ImageNameError`] for the first name with a blank or a control character, or without any
/// character.
pub fn format_images(
    names: &[String],
    trajectory: &[StampedPose],
) -> Result<String, ImageNameError> {
    let breaks = |c: char| c.is_whitespace() || c.is_control();
    let is_unfit = |name: &&String| name.is_empty() || name.contains(breaks);
    if let Some(name) = names.iter().find(is_unfit) {
        return Err(ImageNameError { name: name.clone() });
    }
    let mut text = format!(
        "# Image list with two lines of data per image:\n#   {}\n#   POINTS2D[] as (X, Y, \
         POINT3D_ID)\n\
         # Number of images: {}, mean observations per image: 0\n",
        FORM.replace(' ', ", "),
        trajectory.len()
    );
    for (index, (name, stamped)) in names.iter().zip(trajectory).enumerate() {
        let world_to_camera = stamped.pose.inverse();
        let (t, q) = (&world_to_camera.t_wc, &world_to_camera.r_wc);
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{} {} {} {} {} {} {} {} 1 {name}\n",
            index + 1,
            q.w,
            q.i,
            q.j,
            q.k,
            t.x,
            t.y,
            t.z
        );
    }
    Ok(text)
}

/// Formats a `points3D.txt` without points.
pub fn format_points() -> &'static str {
    "# 3D point list with one line of data per point:\n\
     #   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n\
     # Number of points: 0, mean track length: 0\n"
}
