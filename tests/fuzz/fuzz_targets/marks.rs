//! marks.geojson.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tunnelstitch::inspect::{MARKS_GEOJSON, Marks};
use tunnelstitch_fuzz::file;

fuzz_target!(|data: &[u8]| {
    let (folder, _path) = file(MARKS_GEOJSON, data);
    if let Ok(mut marks) = Marks::open(folder.path()) {
        // Marks that were read can be written and read again.
        marks.remove("none").unwrap();
        let again = Marks::open(folder.path()).unwrap();
        assert_eq!(again.geojson().unwrap(), marks.geojson().unwrap());
    }
});
