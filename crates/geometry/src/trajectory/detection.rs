//! Detection of a pose file's format from its content.

use super::error::PoseError;
use super::float::float;
use super::format::PoseFormat;
use super::pose_options::PoseFileOptions;
use super::quaternion_order::QuaternionOrder;
use super::{bundler, colmap, csv, euroc, json_form, kitti, pix4d, realitycapture, row, text, tum};
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::path::Path;

/// Detects the format of a pose file from its content.
///
/// # Errors
/// A text in none of the formats.
pub(super) fn detect_format(
    path: &Path,
    text: &str,
    options: &PoseFileOptions,
) -> Result<PoseFormat, PoseError> {
    if let Some(format) = by_beginning(text, options) {
        return Ok(format);
    }
    let Some((number, line)) = text::lines(text).next() else {
        // Only comments.
        return Err(PoseError::no_poses(path));
    };
    let order = options
        .quaternion
        .or_else(|| QuaternionOrder::of_comments(text));
    // EuRoC's own header is a comment.
    let is_euroc = euroc::is_line(line) && order != Some(QuaternionOrder::Xyzw);
    if is_euroc && options.columns.is_empty() {
        return Ok(PoseFormat::Euroc);
    }
    if csv::Header::find(text, &options.columns).is_some() {
        return Ok(PoseFormat::Csv);
    }
    if colmap::is_line(line) {
        return Ok(PoseFormat::Colmap);
    }
    if let Some(what) = json_form::explain(text) {
        return Err(PoseError::OtherKind {
            path: path.to_owned(),
            line: None,
            what,
        });
    }
    if let Some(titles) = csv::Header::unknown_titles(text) {
        return Err(unknown_titles(path, &titles));
    }
    let words = row::NamedRow::of(line)
        .map_err(|what| PoseError::line(path, number, what))?
        .words;
    let numbers = words.iter().filter(|word| float(word).is_some()).count();
    match (numbers, words.len()) {
        // A line of a wrong length is reported by the parser of the nearest format.
        (most, all)
            if most + 1 >= all
                && (kitti::is_matrix(all) || kitti::is_matrix(all.saturating_sub(1))) =>
        {
            Ok(PoseFormat::Kitti)
        }
        (most, all) if most >= 5 && all <= 9 => Ok(PoseFormat::Tum),
        _ => Err(PoseError::OtherKind {
            path: path.to_owned(),
            line: Some(number),
            what: format!(
                "in no known format: neither of TUM (`{}`), \
                 KITTI (`{}`), CSV (`{}` named in the first line) nor a \
                 file of COLMAP, nerfstudio, EuRoC, OpenSfM, Bundler, Meshroom, OpenMVG, \
                 Metashape, RealityCapture, Pix4D or Record3D; if it is one of them, name it with \
                 --pose-format (poses.format in survey.toml)",
                tum::FORM,
                kitti::FORM,
                csv::FORM
            ),
        }),
    }
}

/// The error of a table none of whose titles is known.
fn unknown_titles(path: &Path, titles: &[&str]) -> PoseError {
    PoseError::OtherKind {
        path: path.to_owned(),
        line: None,
        what: format!(
            "is a table whose columns (`{}`) are not known by their names, and `columns` under \
             [poses] tells which of them are those of poses, as columns = {{ frame = \"…\", tx = \
             \"…\", ty = \"…\", tz = \"…\", qx = \"…\", qy = \"…\", qz = \"…\", qw = \"…\" }}, \
             or rx, ry and rz with euler",
            titles.join("`, `")
        ),
    }
}

/// Detects a format whose files begin in a way of their own.
fn by_beginning(text: &str, options: &PoseFileOptions) -> Option<PoseFormat> {
    let trimmed = text.trim_start();
    let list = trimmed.strip_prefix('[').map(str::trim_start);
    let first_line = || text::lines(text).next().map(|(_, line)| line);
    if trimmed.starts_with('{') {
        detect_json(text)
    } else if list.is_some_and(|list| list.starts_with(['{', ']'])) {
        Some(PoseFormat::Opensfm)
    } else if trimmed.starts_with('<') {
        Some(PoseFormat::Metashape)
    } else if bundler::is_bundle(trimmed) {
        Some(PoseFormat::Bundler)
    } else if options.columns.is_empty() && realitycapture::is_table(text) {
        Some(PoseFormat::Realitycapture)
    } else if first_line().is_some_and(pix4d::is_header) {
        Some(PoseFormat::Pix4d)
    } else {
        None
    }
}

/// Keys at the top of JSON files, without their values.
#[derive(Default, Deserialize)]
struct TopKeys {
    frames: Option<IgnoredAny>,
    poses: Option<IgnoredAny>,
    extrinsics: Option<IgnoredAny>,
    /// Of Record3D.
    #[serde(rename = "K")]
    matrix: Option<IgnoredAny>,
}

/// Detects the format of a JSON object; None if it is valid and of none. What is not valid is left
/// to the parser of nerfstudio's.
fn detect_json(text: &str) -> Option<PoseFormat> {
    let Ok(keys) = serde_json::from_str::<TopKeys>(text) else {
        return Some(PoseFormat::Nerfstudio);
    };
    if keys.poses.is_some() && keys.matrix.is_some() {
        return Some(PoseFormat::Record3d);
    }
    match (keys.poses, keys.extrinsics, keys.frames) {
        (Some(_), None, None) => Some(PoseFormat::Meshroom),
        (None, Some(_), None) => Some(PoseFormat::Openmvg),
        (_, _, Some(_)) => Some(PoseFormat::Nerfstudio),
        (None, None, None) | (Some(_), Some(_), None) => None,
    }
}
