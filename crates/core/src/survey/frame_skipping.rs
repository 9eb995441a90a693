//! Leaving out of frames whose files cannot be read.

use super::error::SurveyError;
use super::frame_list::FrameList;
use super::skipped_frame::SkippedFrame;
use crate::frames::{FrameError, FrameSet, load_colour};
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Decodes all frames and leaves out those that cannot be decoded or are not of `size`; the others
/// are renumbered.
///
/// # Errors
/// That of all frames, if none can be read.
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
        return Err(first.of_all(list.frames.len()).into());
    }
    let of_kept = |times_s: Vec<f64>| kept.iter().map(|k| times_s[*k]).collect();
    let list = FrameList {
        times_s: list.times_s.map(of_kept),
        frames: FrameSet::from(list.frames).only(&kept).to_vec(),
        video: list.video,
    };
    Ok((list, skipped))
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
    }

    #[test]
    fn one_frame_must_be_readable() {
        let dir = tempfile::tempdir().unwrap();
        let Err(error) = skip_unreadable(list(dir.path(), &["0.png", "1.png"]), (32, 24)) else {
            panic!("no frame can be read");
        };
        assert!(error.to_string().starts_with("all 2 frames ("), "{error}");
    }
}
