//! marks.geojson.

use super::super::file;
use tunnelstitch::inspect::{MARKS_GEOJSON, Marks};

/// Reads the input.
pub fn run(data: &[u8]) {
    let (folder, _path) = file(MARKS_GEOJSON, data);
    if let Ok(mut marks) = Marks::open(folder.path()) {
        // Marks that were read can be written and read again.
        marks.remove("none").unwrap();
        let again = Marks::open(folder.path()).unwrap();
        assert_eq!(again.geojson().unwrap(), marks.geojson().unwrap());
    }
}
