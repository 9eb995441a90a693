//! Bundler's `bundle.out` (v0.3) with the list of its pictures: R and t of every camera,
//! **world-to-camera** in OpenGL's axes (y up, z backwards).
//!
//! | line | content |
//! | --- | --- |
//! | `# Bundle file v0.3` | |
//! | `cameras points` | their numbers |
//! | `f k1 k2`, three rows of R, t | a camera, in the order of the list; all 0 if it has no pose |
//! | … | the points, which are not read |
//!
//! The names of the pictures are in another file, one a line, perhaps with `0 f` behind: `list.txt`
//! beside `bundle.out` or in the folder above (Bundler), or `NAME.list.txt` beside
//! `NAME.bundle.out` (COLMAP). Source: "Bundler v0.4 User's Manual", "Output format".

use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::{rigid, text};
use std::path::{Path, PathBuf};

/// Begin of the file's first line.
const TITLE: &str = "# Bundle file";
const FORM: &str = "f k1 k2, then the nine numbers of R, then t";
/// Numbers of a camera.
const CAMERA_NUMBERS: usize = 15;
/// End of the names of COLMAP's bundle files.
const COLMAP_ENDING: &str = ".bundle.out";

/// True for a text that begins as a bundle file does.
pub(super) fn is_bundle(text: &str) -> bool {
    text.starts_with(TITLE)
}

/// Parses a bundle file with the list of names beside it; pictures without a pose are left out.
pub(super) fn parse(path: &Path, text: &str) -> Result<Vec<PoseEntry>, PoseError> {
    let poses = parse_poses(path, text)?;
    let list = find_list(path).ok_or_else(|| {
        PoseError::file(
            path,
            "has no names of its pictures; put their list, list.txt, beside it",
        )
    })?;
    let names = parse_names(&text::read(&list)?);
    if names.len() != poses.len() {
        return Err(PoseError::file(
            &list,
            format!(
                "{} names for the {} cameras of the bundle file; take the list that belongs to it",
                names.len(),
                poses.len()
            ),
        ));
    }
    let mut seen = text::Names::default();
    let mut entries = Vec::new();
    for (name, pose) in names.into_iter().zip(poses) {
        let Some(pose) = pose else { continue };
        seen.add(&name)
            .map_err(|what| PoseError::file(&list, what))?;
        entries.push(PoseEntry::named(name, pose));
    }
    Ok(entries)
}

/// The poses of all cameras, world-to-camera; `None` for those without.
fn parse_poses(path: &Path, text: &str) -> Result<Vec<Option<Pose>>, PoseError> {
    let mut words = text::lines(text).flat_map(|(number, line)| {
        let words = line.split_whitespace();
        words.map(move |word| (number, word))
    });
    let ends = || PoseError::file(path, "ends before its last camera; it was cut off");
    let (number, word) = words.next().ok_or_else(ends)?;
    let count: usize = word.parse().map_err(|_| {
        let what = format!("`{word}` is not the number of cameras");
        PoseError::line(path, number, what)
    })?;
    // The number of points.
    words.next();
    let mut poses = Vec::new();
    for _ in 0..count {
        let (mut line, mut values) = (0, [0.0; CAMERA_NUMBERS]);
        for (k, value) in values.iter_mut().enumerate() {
            let (number, word) = words.next().ok_or_else(ends)?;
            line = if k == 0 { number } else { line };
            *value =
                text::number(word, FORM).map_err(|what| PoseError::line(path, number, what))?;
        }
        poses.push(camera(&values).map_err(|what| PoseError::line(path, line, what))?);
    }
    Ok(poses)
}

fn camera(values: &[f64; CAMERA_NUMBERS]) -> Result<Option<Pose>, String> {
    let [_, _, _, motion @ ..] = values;
    if motion.iter().all(|value| *value == 0.0) {
        return Ok(None);
    }
    let [a, b, c, d, e, f, g, h, i, x, y, z] = *motion;
    rigid::from_rows(&[[a, b, c, x], [d, e, f, y], [g, h, i, z]]).map(Some)
}

/// The file with the names of the pictures of a bundle file.
fn find_list(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_string_lossy().into_owned();
    let folder = path.parent()?;
    let stem = name.strip_suffix(COLMAP_ENDING);
    let of_colmap = stem.map(|stem| folder.join(format!("{stem}.list.txt")));
    let of_bundler = ["list.txt", "../list.txt"].map(|list| folder.join(list));
    let mut lists = of_colmap.into_iter().chain(of_bundler);
    lists.find(|list| list.is_file())
}

/// The names of a list, without the flag and the focal length behind them.
fn parse_names(text: &str) -> Vec<String> {
    let name = |line: &str| {
        let words: Vec<&str> = line.rsplitn(3, char::is_whitespace).collect();
        match words[..] {
            [focal, "0", name] if focal.parse::<f64>().is_ok() => name.trim_end().to_owned(),
            _ => line.to_owned(),
        }
    };
    text.lines()
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .map(name)
        .collect()
}

#[cfg(test)]
mod tests {
    use crate::trajectory::{Convention, PoseFile, PoseFormat, read_poses};
    use nalgebra::Vector3;

    /// Three pictures, of which the second has no pose. The others are cameras that look along the
    /// world's −z and along its −x.
    const BUNDLE: &str = "# Bundle file v0.3\n3 1\n\
        500 -0.1 0.01\n1 0 0\n0 1 0\n0 0 1\n-1 -2 -3\n\
        0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n\
        500 -0.1 0.01\n0 0 -1\n0 1 0\n1 0 0\n0 0 0\n\
        1.5 2.5 3.5\n255 0 0\n1 0 7 12.5 -3.25\n";

    fn read(files: &[(&str, &str)]) -> Result<PoseFile, String> {
        let dir = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = dir.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        read_poses(&dir.path().join(files[0].0), None).map_err(|error| error.to_string())
    }

    /// `P = R X + t`, and a point before the camera has a negative z there, x to the right, y up.
    #[test]
    fn cameras_look_along_their_negative_z() {
        let list = "./a b.jpg 0 660.8\n./b.jpg\n\n./c.jpg 0 660.8\n";
        for files in [
            [("bundle.out", BUNDLE), ("list.txt", list)],
            [("bundle/bundle.out", BUNDLE), ("list.txt", list)],
            [("x.bundle.out", BUNDLE), ("x.list.txt", list)],
        ] {
            let file = read(&files).unwrap();
            assert_eq!(file.format, PoseFormat::Bundler);
            let names: Vec<_> = file
                .entries
                .iter()
                .flat_map(|entry| entry.name.as_deref())
                .collect();
            assert_eq!(names, ["./a b.jpg", "./c.jpg"]);
            let convention = Convention::of(file.format);
            let [first, last] = [0, 1].map(|k| convention.to_world(&file.entries[k].pose));
            assert_eq!(first.t_wc, Vector3::new(1.0, 2.0, 3.0));
            // Two metres ahead (−z), one up: y is −1 in OpenCV's axes.
            let seen = first.to_camera(&Vector3::new(1.0, 3.0, 1.0));
            assert!(
                (seen - Vector3::new(0.0, -1.0, 2.0)).norm() < 1e-12,
                "{seen}"
            );
            let seen = last.to_camera(&Vector3::new(-2.0, 0.0, -1.0));
            assert!(
                (seen - Vector3::new(1.0, 0.0, 2.0)).norm() < 1e-12,
                "{seen}"
            );
        }
    }

    #[test]
    fn broken_bundles_say_where() {
        let list = ("list.txt", "a\nb\nc\n");
        let changed = |from: &str, to: &str| BUNDLE.replacen(from, to, 1);
        for (text, expected) in [
            (changed("3 1", "x 1"), "out:2: `x` is not the number"),
            (changed("3 1", "9 1"), "cut off"),
            (changed("0 1 0", "0 y 0"), "out:5: `y` is not a number"),
            (changed("1 0 0", "2 0 0"), "out:3: its first three columns"),
            ("# Bundle file v0.3\n2 0\n1 0 0\n".to_owned(), "cut off"),
            (
                "# Bundle file v0.3\n0 0\n".to_owned(),
                "list.txt: 3 names for the 0",
            ),
            (changed("3 1", "2 1"), "list.txt: 3 names for the 2 cameras"),
        ] {
            let message = read(&[("bundle.out", &text), list]).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
        let message = read(&[("bundle.out", BUNDLE)]).unwrap_err();
        assert!(
            message.contains("put their list, list.txt, beside it"),
            "{message}"
        );
        let message = read(&[("bundle.out", BUNDLE), ("list.txt", "a\nb\na\n")]).unwrap_err();
        assert!(
            message.contains("list.txt: a second pose of a"),
            "{message}"
        );
    }
}
