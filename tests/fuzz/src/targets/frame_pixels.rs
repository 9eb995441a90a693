//! Tables of pixels of frames, as `locate --points` reads them.

use super::super::{FRAMES, file, small_survey};
use tunnelstitch::survey::{FramePixels, Survey};

/// Reads the input.
pub fn run(data: &[u8]) {
    let survey = Survey::open(small_survey()).unwrap();
    let (_folder, path) = file("pixels.csv", data);
    let Ok(rows) = FramePixels::open(&survey, &path) else {
        return;
    };
    let columns = rows.headers().len();
    for row in rows.map_while(Result::ok) {
        assert!(row.frame < FRAMES && row.cells.len() == columns);
        assert!(row.pixel.iter().all(|v| v.is_finite()));
    }
}
