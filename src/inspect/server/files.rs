//! Files of the folder, and frames.

use super::reply::Reply;
use crate::camera::Camera;
use crate::frames::{FrameFile, load_colour};
use image::ImageFormat;
use std::io::Cursor;
use std::path::Path;

/// What a file is by the end of its name; others are not served.
fn kind(name: &str) -> Option<&'static str> {
    match name.rsplit_once('.')?.1 {
        "json" => Some("application/json"),
        "glb" => Some("model/gltf-binary"),
        "jpg" => Some("image/jpeg"),
        _ => None,
    }
}

/// Whether a part of a path is a plain name: letters, digits, `-`, `_` and dots inside.
fn is_plain(part: &str) -> bool {
    let letters = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    !part.is_empty() && !part.starts_with('.') && part.chars().all(letters)
}

/// A file below `folder`, which is given in full.
pub(super) fn read(folder: &Path, path: &str) -> Reply {
    let Some(name) = path
        .strip_prefix('/')
        .filter(|name| name.split('/').all(is_plain))
    else {
        return Reply::not_found();
    };
    let Some(kind) = kind(name) else {
        return Reply::not_found();
    };
    // A link may lead elsewhere.
    let full = folder
        .join(name)
        .canonicalize()
        .ok()
        .filter(|full| full.starts_with(folder));
    match full.and_then(|full| std::fs::read(full).ok()) {
        Some(bytes) => Reply::ok(kind, bytes),
        None => Reply::not_found(),
    }
}

/// A frame as every browser shows it: the file itself, or the decoded picture as PNG.
pub(super) fn picture(frame: &FrameFile, camera: &Camera) -> Reply {
    let bytes = std::fs::read(&frame.path).unwrap_or_default();
    let kind = match image::guess_format(&bytes) {
        Ok(ImageFormat::Jpeg) => "image/jpeg",
        Ok(ImageFormat::Png) => "image/png",
        Ok(ImageFormat::WebP) => "image/webp",
        // Another format, or a picture of a video.
        _ => return decoded(frame, camera),
    };
    Reply::ok(kind, bytes)
}

fn decoded(frame: &FrameFile, camera: &Camera) -> Reply {
    let mut png = Cursor::new(Vec::new());
    let picture = match load_colour(frame, camera.width, camera.height) {
        Ok(picture) => picture.into_rgb8(),
        Err(error) => return Reply::refuse(404, &error.to_string()),
    };
    match picture.write_to(&mut png, ImageFormat::Png) {
        Ok(()) => Reply::ok("image/png", png.into_inner()),
        Err(error) => Reply::refuse(500, &error.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_outside_the_folder_is_read() {
        let dir = tempfile::tempdir().unwrap();
        let outer = dir.path().canonicalize().unwrap();
        let folder = outer.join("site");
        std::fs::create_dir_all(folder.join("refined/0")).unwrap();
        std::fs::write(folder.join("refined/0/1_2.glb"), b"tile").unwrap();
        std::fs::write(folder.join("secret.txt"), b"no").unwrap();
        std::fs::write(outer.join("secret.json"), b"no").unwrap();
        assert_eq!(
            read(&folder, "/refined/0/1_2.glb"),
            Reply::ok("model/gltf-binary", b"tile".to_vec())
        );
        #[cfg(unix)]
        std::os::unix::fs::symlink(outer.join("secret.json"), folder.join("link.json")).unwrap();
        for trick in [
            "/../secret.json",
            "/refined/../../secret.json",
            "/%2e%2e/secret.json",
            "/..%2fsecret.json",
            "/..\\secret.json",
            "//secret.json",
            "/link.json",
            "/secret.txt",
            "/.hidden.json",
            "/refined",
            "",
            "secret.json",
            "/refined//0/1_2.glb",
            "/refined/0/1_2.glb\0.json",
        ] {
            assert_eq!(read(&folder, trick).status, 404, "{trick}");
        }
        let absolute = format!("/{}", outer.join("secret.json").display());
        assert_eq!(read(&folder, &absolute).status, 404);
    }
}
