//! Frames that are left out because their files cannot be read.

use super::error::SurveyError;
use super::frame_list::FrameList;
use crate::frames::{FrameError, FrameSet, load_colour};
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Most names of frames in a message.
const MAX_NAMED_FRAMES: usize = 5;

/// A frame that is left out because its file is missing, damaged or of another size.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SkippedFrame {
    /// Its index among all frames that `frames.images` matches.
    pub index: usize,
    /// Its file.
    pub file: String,
    /// The reason why it cannot be read.
    pub reason: String,
}

/// Decodes all frames and leaves out those that cannot be decoded or are not of `size`; the others
/// are renumbered.
///
/// # Errors
/// The error of the first frame, if no frame can be read.
pub(super) fn skip_unreadable(
    list: FrameList,
    (width, height): (u32, u32),
) -> Result<(FrameList, Vec<SkippedFrame>), SurveyError> {
    let decoded = list.frames.par_map(|file| {
        file.examine(width, height)?;
        load_colour(file, width, height).map(drop)
    });
    let errors: Vec<Option<FrameError>> = decoded.into_iter().map(Result::err).collect();
    let skipped = list.frames.iter().zip(&errors).filter_map(|(file, error)| {
        Some(SkippedFrame {
            index: file.index,
            file: printed(&file.path).to_string(),
            reason: error.as_ref()?.reason(),
        })
    });
    let skipped: Vec<SkippedFrame> = skipped.collect();
    let is_readable = |k: &usize| errors[*k].is_none();
    let kept: Vec<usize> = (0..errors.len()).filter(is_readable).collect();
    if kept.is_empty()
        && let Some(first) = errors.into_iter().flatten().next()
    {
        return Err(first.into());
    }
    let of_kept = |times_s: Vec<f64>| kept.iter().map(|k| times_s[*k]).collect();
    let list = FrameList {
        times_s: list.times_s.map(of_kept),
        frames: FrameSet::from(list.frames).only(&kept).to_vec(),
        video: list.video,
    };
    Ok((list, skipped))
}

/// A sentence that names frames that are left out, if there are any. `others`: the number of those
/// that are used.
pub(super) fn sentence(skipped: &[SkippedFrame], others: usize) -> Option<String> {
    if skipped.is_empty() {
        return None;
    }
    let named = skipped.iter().take(MAX_NAMED_FRAMES);
    let named: Vec<String> = named
        .map(|s| format!("{} ({})", s.file, s.reason))
        .collect();
    let more = match skipped.len() - named.len() {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    Some(format!(
        "{} of {} frames cannot be read and are left out: {}{more}",
        skipped.len(),
        skipped.len() + others,
        named.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::FrameFile;
    use image::GrayImage;

    fn list(dir: &std::path::Path, names: &[&str]) -> FrameList {
        let frame = |(k, name): (usize, &&str)| FrameFile::picture(k, dir.join(name));
        FrameList {
            frames: names.iter().enumerate().map(frame).collect(),
            times_s: Some((0..names.len()).map(|k| k as f64).collect()),
            video: None,
        }
    }

    #[test]
    fn damaged_missing_and_smaller_frames_are_left_out() {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        for name in ["0.png", "2.png", "4.png"] {
            GrayImage::new(32, 24).save(path(name)).unwrap();
        }
        GrayImage::new(16, 12).save(path("1.png")).unwrap();
        let mut damaged = std::fs::read(path("2.png")).unwrap();
        let middle = damaged.len() / 2;
        damaged[middle] ^= 0x55;
        std::fs::write(path("2.png"), damaged).unwrap();
        let names = ["0.png", "1.png", "2.png", "3.png", "4.png"];
        let (kept, skipped) = skip_unreadable(list(dir.path(), &names), (32, 24)).unwrap();
        let names: Vec<String> = kept.frames.iter().map(FrameFile::name).collect();
        assert_eq!(names, ["0.png", "4.png"]);
        assert_eq!(kept.frames[1].index, 1);
        assert_eq!(kept.times_s, Some(vec![0.0, 4.0]));
        let indices: Vec<usize> = skipped.iter().map(|frame| frame.index).collect();
        assert_eq!(indices, [1, 2, 3]);
        assert_eq!(skipped[0].reason, "16 × 12 px, not 32 × 24 px");
        let said = sentence(&skipped, 2).unwrap();
        assert!(said.starts_with("3 of 5 frames cannot be read"), "{said}");
        assert_eq!(sentence(&[], 2), None);
    }

    #[test]
    fn one_frame_must_be_readable() {
        let dir = tempfile::tempdir().unwrap();
        let Err(error) = skip_unreadable(list(dir.path(), &["0.png", "1.png"]), (32, 24)) else {
            panic!("no frame can be read");
        };
        assert!(error.to_string().contains("frame 0"), "{error}");
    }
}
