//! Points of a tunnel's centreline; the first byte selects the shape.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tunnelstitch::survey::Shape;
use tunnelstitch::survey::Survey;
use tunnelstitch_fuzz::{file, small_survey};

const SHAPES: [Shape; 4] = [Shape::Circle, Shape::Ellipse, Shape::Box, Shape::Horseshoe];

fuzz_target!(|data: &[u8]| {
    let Some((first, content)) = data.split_first() else {
        return;
    };
    let (folder, path) = file("curve.txt", content);
    let mut tunnel = Survey::read_file(small_survey()).unwrap().tunnel;
    tunnel.centreline = Some(path.clone());
    tunnel.shape = SHAPES[usize::from(*first) % SHAPES.len()];
    if tunnel.shape != Shape::Circle {
        tunnel.radius_m = None;
        (tunnel.width_m, tunnel.height_m) = (Some(6.0), Some(6.0));
    }
    if let Ok(surface) = tunnel.surface(&path, folder.path()) {
        let _ = tunnelstitch::surface::viewing_distance(
            surface.as_ref(),
            &tunnelstitch::trajectory::Pose::identity(),
        );
    }
});
