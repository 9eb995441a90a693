//! Marks that are put and removed while writing fails: two bytes for a change, the first says
//! which, and whether its files can be written, the second what the note is.

use std::path::Path;
use tunnelstitch::inspect::{MARKS_CSV, MARKS_GEOJSON, Mark, Marks};

/// Identifiers of the marks.
const IDS: [&str; 4] = ["a", "b", "c-1", "d"];

fn mark(id: &str, note: u8) -> Mark {
    let mut mark: Mark = serde_json::from_str(
        r#"{"type": "Feature", "id": "a", "geometry": {"type": "Point", "coordinates": [1.5, 2.0]},
        "properties": {"class": "BAB", "severity": 3, "note": "", "chainage_m": 2.0,
        "clock": "4:30",
        "theta_deg": 135.0, "x_m": 1.0, "y_m": 2.0, "z_m": 0.0, "layer": "truth", "created": ""}}"#,
    )
    .unwrap();
    mark.id = id.to_owned();
    mark.properties.note = char::from(note % 96 + 32).to_string();
    mark
}

/// Puts a folder in the place of a file, and the file back.
fn blocked(folder: &Path, name: &str, change: impl FnOnce()) {
    let (path, aside) = (folder.join(name), folder.join("aside"));
    let was_there = std::fs::rename(&path, &aside).is_ok();
    std::fs::create_dir(&path).unwrap();
    change();
    std::fs::remove_dir(&path).unwrap();
    if was_there {
        std::fs::rename(&aside, &path).unwrap();
    }
}

/// Changes marks. What was confirmed is in the file, and nothing else.
pub fn run(data: &[u8]) {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut marks = Marks::open(folder).unwrap();
    let mut confirmed = marks.geojson().unwrap();
    for change in data.chunks_exact(2).take(64) {
        let id = IDS[usize::from(change[0] % 4)];
        let mut done = false;
        let apply = || {
            let result = match change[0] & 4 {
                0 => marks.put(mark(id, change[1])),
                _ => marks.remove(id),
            };
            done = result.is_ok();
        };
        match change[0] & 24 {
            8 => blocked(folder, MARKS_CSV, apply),
            16 => blocked(folder, MARKS_GEOJSON, apply),
            _ => ({ apply })(),
        }
        if done {
            confirmed = marks.geojson().unwrap();
        }
        assert_eq!(marks.geojson().unwrap(), confirmed);
        assert_eq!(Marks::open(folder).unwrap().geojson().unwrap(), confirmed);
        let files = std::fs::read_dir(folder).unwrap().count();
        assert!(files <= 2, "temporary files are left");
    }
}
