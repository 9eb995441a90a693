//! Files of measured points; the first byte selects the extension.

use super::super::file;
use tunnelstitch::points::read_points;

const ENDINGS: [&str; 5] = ["ply", "pcd", "xyz", "las", "laz"];

/// Reads the input.
pub fn run(data: &[u8]) {
    let Some((first, content)) = data.split_first() else {
        return;
    };
    let ending = ENDINGS[usize::from(*first) % ENDINGS.len()];
    let (_folder, path) = file(&format!("points.{ending}"), content);
    let mut count = 0;
    let read = read_points(&path, &mut |point| {
        assert!(point.iter().all(|v| v.is_finite()));
        count += 1;
    });
    if let Ok(read) = read {
        assert!(count > 0 && read.read >= count);
    }
}
