//! COLMAP's `images.bin`: the poses of its binary model, **world-to-camera**.
//!
//! | bytes | content |
//! | --- | --- |
//! | 8 | number of images |
//! | 4 | id of an image |
//! | 4 × 8 | rotation: qw, qx, qy, qz |
//! | 3 × 8 | translation |
//! | 4 | id of its camera |
//! | … 0 | its name, which ends with a byte of zero |
//! | 8 | number of its points |
//! | 24 each | x, y and the id of the point; skipped |
//!
//! All numbers are little-endian; all rows but the first repeat. Models with `rigs.bin` and
//! `frames.bin` (COLMAP 3.12 and later) hold the pose of every image here, too. Source: COLMAP's
//! documentation, "Output Format".

use super::error::PoseError;
use super::pose::Pose;
use super::pose_entry::PoseEntry;
use super::text;
use crate::files::BinaryFile;
use nalgebra::Vector3;
use std::io;
use std::path::Path;

/// Name of the pose file in the folder of a model.
pub const IMAGES_FILE: &str = "images.bin";
/// Bytes of an image with an empty name and without points.
const MIN_IMAGE_BYTES: u64 = 73;
/// Bytes of a point of an image.
const POINT_BYTES: u64 = 24;

/// True for a file of a binary model, by its name.
pub fn is_binary(path: &Path) -> bool {
    let extension = path.extension().unwrap_or_default();
    extension.eq_ignore_ascii_case("bin")
}

/// Reads the poses of a file.
///
/// # Errors
/// An unreadable file; one that is cut off or longer than its counts; a rotation that is none; two
/// poses of one name.
pub fn read(path: &Path) -> Result<Vec<PoseEntry>, PoseError> {
    let mut file = BinaryFile::open(path).map_err(|source| PoseError::Read {
        path: path.to_owned(),
        source,
    })?;
    let damaged = |error: io::Error| {
        PoseError::file(
            path,
            format!(
                "{error}; images.bin of a COLMAP model is read, or its text model (colmap \
                 model_converter --output_type TXT)"
            ),
        )
    };
    let count = file.count(MIN_IMAGE_BYTES).map_err(damaged)?;
    let mut names = text::Names::default();
    let mut entries = Vec::with_capacity(count);
    for _ in 0..count {
        let at = file.at();
        let image = ImageRecord::read(&mut file).map_err(damaged)?;
        let invalid = |what: String| {
            let (id, name) = (image.id, &image.name);
            PoseError::file(path, format!("byte {at}: image {id} ({name:?}): {what}"))
        };
        names.add(&image.name).map_err(invalid)?;
        entries.push(image.entry().map_err(invalid)?);
    }
    file.end().map_err(damaged)?;
    Ok(entries)
}

/// An image as the file has it.
struct ImageRecord {
    id: u32,
    camera: u32,
    name: String,
    quaternion: [f64; 4],
    translation: [f64; 3],
}

impl ImageRecord {
    fn read(file: &mut BinaryFile) -> io::Result<Self> {
        let id = file.u32()?;
        let (quaternion, translation) = (file.f64s()?, file.f64s()?);
        let camera = file.u32()?;
        let name = file.name()?;
        let points = file.count(POINT_BYTES)?;
        file.skip(points as u64 * POINT_BYTES)?;
        Ok(Self {
            id,
            camera,
            name,
            quaternion,
            translation,
        })
    }

    fn entry(&self) -> Result<PoseEntry, String> {
        let numbers = self.quaternion.iter().chain(&self.translation);
        if let Some(number) = numbers.into_iter().find(|number| !number.is_finite()) {
            return Err(format!(
                "{number} is not finite; remove the image or give it a pose"
            ));
        }
        if self.name.is_empty() {
            return Err("there is no name, and so no frame for the pose".to_owned());
        }
        let rotation = text::rotation(self.quaternion, "qw qx qy qz")?;
        let pose = Pose::new(rotation, Vector3::from(self.translation));
        Ok(PoseEntry {
            camera: Some(self.camera),
            ..PoseEntry::named(self.name.clone(), pose)
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::trajectory::{PoseFormat, read_poses};

    /// The bytes of an image with its points.
    fn image(id: u32, name: &[u8], rotation: [f64; 4], t: [f64; 3], points: usize) -> Vec<u8> {
        let mut bytes = id.to_le_bytes().to_vec();
        bytes.extend(rotation.iter().chain(&t).flat_map(|v| v.to_le_bytes()));
        bytes.extend(1u32.to_le_bytes());
        bytes.extend([name, &[0]].concat());
        bytes.extend((points as u64).to_le_bytes());
        bytes.extend(vec![0x5a; 24 * points]);
        bytes
    }

    fn model(images: &[Vec<u8>]) -> Vec<u8> {
        [
            &(images.len() as u64).to_le_bytes()[..],
            &images.concat()[..],
        ]
        .concat()
    }

    const TURN: [f64; 4] = [0.6, 0.0, 0.8, 0.0];

    fn two() -> Vec<u8> {
        let first = image(1, b"a b.png", [1.0, 0.0, 0.0, 0.0], [0.0; 3], 2);
        model(&[first, image(7, b"x/c.png", TURN, [0.5, -1.0, 2.25], 0)])
    }

    /// A file or the folder of the model is read as the text model is.
    #[test]
    fn text_and_binary_are_the_same_poses() {
        let dir = tempfile::tempdir().unwrap();
        let text =
            "1 1 0 0 0 0 0 0 1 a b.png\n1 2 -1 3 4 -1\n7 0.6 0 0.8 0 0.5 -1 2.25 1 x/c.png\n";
        let path = dir.path().join("images.bin");
        std::fs::write(&path, two()).unwrap();
        let file = read_poses(&path, Some(PoseFormat::Colmap)).unwrap();
        assert_eq!((file.format, &file.path), (PoseFormat::Colmap, &path));
        let of_folder = read_poses(dir.path(), None).unwrap();
        assert_eq!((of_folder.path, &of_folder.entries), (path, &file.entries));
        std::fs::write(dir.path().join("images.txt"), text).unwrap();
        let of_text = read_poses(dir.path(), None).unwrap();
        assert!(of_text.path.ends_with("images.txt"));
        assert_eq!(of_text.entries, file.entries);
    }

    #[test]
    fn damaged_files_are_refused_at_their_byte() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("images.bin");
        let message = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            read_poses(&path, None).unwrap_err().to_string()
        };
        let whole = two();
        for length in 0..whole.len() {
            let said = message(&whole[..length]);
            assert!(said.contains("images.bin: byte "), "{length}: {said}");
        }
        let same = image(1, b"a", TURN, [0.0; 3], 0);
        let mut points = same.clone();
        let end = points.len() - 8;
        points[end..].copy_from_slice(&(u64::MAX / 24 + 2).to_le_bytes());
        let cases = [
            ([&whole[..], &[0]].concat(), "1 bytes follow"),
            (
                [&u64::MAX.to_le_bytes()[..], &whole[8..]].concat(),
                "byte 0",
            ),
            (model(&[points]), "byte 74: 768614336404564652 entries"),
            (
                model(&[same.clone(), same]),
                "byte 82: image 1 (\"a\"): a second",
            ),
            (model(&[image(1, b"a", [0.0; 4], [0.0; 3], 0)]), "is zero"),
            (model(&[image(1, b"a", TURN, [f64::NAN; 3], 0)]), "NaN"),
            (model(&[image(1, b"", TURN, [0.0; 3], 0)]), "no name"),
            (model(&[]), "holds no poses"),
        ];
        for (bytes, expected) in cases {
            let said = message(&bytes);
            assert!(said.contains(expected), "{expected}: {said}");
        }
    }
}
