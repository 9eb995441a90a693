//! Points of a tunnel's centreline; the first byte selects the shape.

use super::super::{file, small_survey};
use tunnelstitch::camera::Camera;
use tunnelstitch::surface::viewing_distance;
use tunnelstitch::survey::{Shape, Survey};
use tunnelstitch::trajectory::Pose;

const SHAPES: [Shape; 4] = [Shape::Circle, Shape::Ellipse, Shape::Box, Shape::Horseshoe];

/// Reads the input.
pub fn run(data: &[u8]) {
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
        let camera = Camera::from_vertical_fov(32, 24, 1.0);
        let _ = viewing_distance(surface.as_ref(), &camera, &Pose::identity());
    }
}
