//! shape.json, the displacement of the wall, and masked.json, what hides it; the first byte
//! selects.

use super::super::file;
use tunnelstitch::surface::WallPoint;
use tunnelstitch::survey::{MaskedWall, ShapeFile};

/// Perimeter of the tunnel of the seeds, metres.
const PERIMETER_M: f64 = 18.849_555_921_538_76;

/// Reads the input.
pub fn run(data: &[u8]) {
    let Some((first, content)) = data.split_first() else {
        return;
    };
    let (_folder, path) = file("wall.json", content);
    if first % 2 == 0 {
        if let Ok(shape) = ShapeFile::read(&path, PERIMETER_M) {
            let _ = (shape.field(), shape.displacement());
        }
    } else if let Ok(masked) = MaskedWall::read(&path, PERIMETER_M) {
        let wall = WallPoint { s_m: 1.0, h_m: 0.1 };
        let _ = (masked.seen_m2(), masked.share_at(wall));
        let _ = masked.moved(wall, 1.5).is_hidden_at(wall);
    }
}
