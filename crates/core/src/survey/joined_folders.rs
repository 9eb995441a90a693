//! Pictures of one sequence in several folders, as cameras and dates divide them.

use super::picture_group::PictureGroup;
use std::path::{Path, PathBuf};

/// The groups as one, if they are all pictures of their kind in folders side by side, of one size
/// and `count` together: as many as there are poses.
pub(super) fn joined(groups: &[PictureGroup], count: usize) -> Option<PictureGroup> {
    let first = groups.first().filter(|_| groups.len() > 1)?;
    let file_pattern = Path::new(&first.pattern).file_name()?;
    let above = |group: &PictureGroup| -> Option<PathBuf> {
        Some(group.first.parent()?.parent()?.to_owned())
    };
    let folder = above(first)?;
    let is_beside = |group: &PictureGroup| {
        above(group).as_ref() == Some(&folder)
            && Path::new(&group.pattern).file_name() == Some(file_pattern)
    };
    // The pattern takes all of them.
    let members: Vec<&PictureGroup> = groups.iter().filter(|group| is_beside(group)).collect();
    let is_whole = members.iter().map(|group| group.count).sum::<usize>() == count;
    let is_alike = members.iter().all(|group| group.size == first.size);
    let earliest = members.iter().min_by_key(|group| &group.first)?;
    let inner = glob::Pattern::escape(&folder.to_string_lossy());
    let pattern = Path::new(&inner).join("*").join(file_pattern);
    let is_joined = members.len() > 1 && is_whole && is_alike && first.size.is_some();
    is_joined.then(|| PictureGroup {
        pattern: pattern.to_string_lossy().replace('\\', "/"),
        count,
        ..(*earliest).clone()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn group(folder: &str, count: usize, width: u32) -> PictureGroup {
        PictureGroup {
            pattern: format!("{folder}/*.png"),
            first: Path::new(folder).join("1.png"),
            count,
            has_time: false,
            size: Some((width, 48)),
            turned_size: None,
            fault: None,
        }
    }

    #[test]
    fn folders_with_as_many_pictures_as_poses_are_one() {
        let days = [group("d/25", 8, 64), group("d/24", 7, 64), group("e", 3, 8)];
        let all = joined(&days, 15).unwrap();
        assert_eq!((all.pattern.as_str(), all.count), ("d/*/*.png", 15));
        assert_eq!(all.first, Path::new("d/24/1.png"));
        assert_eq!(joined(&days, 8), None);
        // Thumbnails would be matched, too.
        let with_small = [days.as_slice(), &[group("d/small", 15, 8)]].concat();
        assert_eq!(joined(&with_small, 15), None);
        assert_eq!(joined(&with_small, 30), None);
        assert_eq!(joined(&days[..1], 8), None);
    }
}
