//! Responses with files of the folder and with frames.

use crate::files::read_regular;
use crate::frames::{FrameFile, load_colour};
use crate::inspect::server::response::Response;
use image::ImageFormat;
use std::io::Cursor;
use std::path::Path;

/// Largest file that is sent as it is, bytes.
const MAX_FILE_BYTES: u64 = 512 << 20;

/// Media type by a file's extension; other files are not served.
fn media_type(name: &str) -> Option<&'static str> {
    match name.rsplit_once('.')?.1 {
        "json" => Some("application/json"),
        "glb" => Some("model/gltf-binary"),
        "jpg" => Some("image/jpeg"),
        _ => None,
    }
}

/// True if a part of a path is a plain name: letters, digits, `-`, `_` and dots inside.
fn is_plain(part: &str) -> bool {
    let letters = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    !part.is_empty() && !part.starts_with('.') && part.chars().all(letters)
}

/// Reads a file below `folder`, which is a canonical path.
pub(super) fn read_file(folder: &Path, path: &str) -> Response {
    let Some(name) = path
        .strip_prefix('/')
        .filter(|name| name.split('/').all(is_plain))
    else {
        return Response::not_found();
    };
    let Some(kind) = media_type(name) else {
        return Response::not_found();
    };
    // A symbolic link may lead outside.
    let full = folder
        .join(name)
        .canonicalize()
        .ok()
        .filter(|full| full.starts_with(folder));
    match full.and_then(|full| read_regular(&full, MAX_FILE_BYTES).ok()) {
        Some(bytes) => Response::ok(kind, bytes),
        None => Response::not_found(),
    }
}

/// Reads a frame: the file itself if browsers can show it, else the decoded image as PNG.
pub(super) fn read_frame(frame: &FrameFile, size: [u32; 2]) -> Response {
    let bytes = read_regular(&frame.path, MAX_FILE_BYTES).unwrap_or_default();
    let kind = match image::guess_format(&bytes) {
        Ok(ImageFormat::Jpeg) => "image/jpeg",
        Ok(ImageFormat::Png) => "image/png",
        Ok(ImageFormat::WebP) => "image/webp",
        // Another format, or a frame of a video.
        _ => return decode_frame(frame, size),
    };
    Response::ok(kind, bytes)
}

/// Decodes a frame and encodes it as PNG.
fn decode_frame(frame: &FrameFile, size: [u32; 2]) -> Response {
    let mut png = Cursor::new(Vec::new());
    let [width, height] = size;
    let image = match load_colour(frame, width, height) {
        Ok(image) => image.into_rgb8(),
        Err(error) => return Response::refuse(404, &error.to_string()),
    };
    match image.write_to(&mut png, ImageFormat::Png) {
        Ok(()) => Response::ok("image/png", png.into_inner()),
        Err(error) => Response::refuse(500, &error.to_string()),
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
            read_file(&folder, "/refined/0/1_2.glb"),
            Response::ok("model/gltf-binary", b"tile".to_vec())
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
            assert_eq!(read_file(&folder, trick).status, 404, "{trick}");
        }
        let absolute = format!("/{}", outer.join("secret.json").display());
        assert_eq!(read_file(&folder, &absolute).status, 404);
    }
}
