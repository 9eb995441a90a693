//! Files among the frames that are none: no pictures, of another size, or copies of others.

use crate::frames::FrameFile;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Says which files are no pictures, are of another size than most, or copies of others, and that
/// they are to be moved away; None if there are none.
pub(super) fn strangers_among(frames: &[FrameFile]) -> Option<String> {
    let mut said = Vec::new();
    let sizes = frames.par_map(|frame| frame.size().ok());
    let mut counts: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    for size in sizes.iter().flatten() {
        *counts.entry(*size).or_default() += 1;
    }
    // Of as many, the larger ones are the frames.
    let usual = counts.iter().max_by_key(|(size, count)| (**count, **size));
    let usual = usual.map(|(size, _)| *size);
    let is_other = |size: &Option<(u32, u32)>| size.is_some() && *size != usual;
    let others: Vec<usize> = (0..frames.len()).filter(|k| is_other(&sizes[*k])).collect();
    if let Some(first) = others.first()
        && let Some((width, height)) = sizes[*first]
    {
        said.push(format!(
            "{} of the frames are of another size than the others ({}: {width} × {height} px)",
            others.len(),
            printed(frames[*first].path.as_ref())
        ));
    }
    let unread: Vec<usize> = (0..frames.len()).filter(|k| sizes[*k].is_none()).collect();
    if let Some(first) = unread.first()
        && unread.len() < frames.len()
    {
        said.push(format!(
            "{} of the frames are no pictures that can be read ({})",
            unread.len(),
            printed(frames[*first].path.as_ref())
        ));
    }
    let copies = copies_among(frames);
    if let Some((copy, original)) = copies.first() {
        said.push(format!(
            "{} of the frames are copies of others ({} of {})",
            copies.len(),
            printed(frames[*copy].path.as_ref()),
            frames[*original].name()
        ));
    }
    let said = said.join(", and ");
    (!said.is_empty()).then(|| format!("{said}: move them into another folder"))
}

/// The frames whose files are copies of others, each with its original: of two the one with the
/// shorter name.
fn copies_among(frames: &[FrameFile]) -> Vec<(usize, usize)> {
    let is_file = |frame: &FrameFile| frame.shared_file().is_none();
    let content = |frame: &FrameFile| {
        let hashed = is_file(frame).then(|| crate::persist::provenance::input(&frame.path));
        hashed?.ok().map(|input| input.blake3)
    };
    let hashes = frames.par_map(content);
    let mut originals: BTreeMap<&String, usize> = BTreeMap::new();
    let mut copies = Vec::new();
    for (k, hash) in hashes.iter().enumerate() {
        let Some(hash) = hash else { continue };
        match originals.entry(hash) {
            Entry::Vacant(vacant) => drop(vacant.insert(k)),
            Entry::Occupied(mut original) => {
                let other = *original.get();
                let is_shorter = frames[k].name().len() < frames[other].name().len();
                let (copy, kept) = if is_shorter { (other, k) } else { (k, other) };
                original.insert(kept);
                copies.push((copy, kept));
            }
        }
    }
    copies
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, Luma};

    #[test]
    fn thumbnails_and_copies_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let save = |name: &str, size: u32, grey: u8| {
            let path = dir.path().join(name);
            let picture = GrayImage::from_pixel(size, size, Luma([grey]));
            picture.save(&path).unwrap();
            path
        };
        let paths = [save("1.png", 16, 1), save("2.png", 16, 2)];
        let frames = |paths: &[std::path::PathBuf]| -> Vec<FrameFile> {
            let files = paths.iter().cloned().enumerate();
            files.map(|(k, path)| FrameFile::picture(k, path)).collect()
        };
        assert_eq!(strangers_among(&frames(&paths)), None);
        let [first, second] = paths;
        let all = [
            save("1 (1).png", 16, 1),
            first,
            save("1_thumb.png", 4, 1),
            second,
        ];
        let said = strangers_among(&frames(&all)).unwrap();
        assert!(
            said.contains("1 of the frames are of another size"),
            "{said}"
        );
        assert!(said.contains("1_thumb.png: 4 × 4 px"), "{said}");
        assert!(said.contains("1 (1).png of 1.png"), "{said}");
        let notes = dir.path().join("notes.txt");
        std::fs::write(&notes, "lamp 2 off").unwrap();
        let said = strangers_among(&frames(&[&all[..], &[notes]].concat())).unwrap();
        assert!(said.contains("1 of the frames are no pictures"), "{said}");
        assert!(said.contains("notes.txt"), "{said}");
    }
}
