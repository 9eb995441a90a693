//! The part of the wall that a frame sees.

use crate::camera::Pinhole;
use crate::surface::{Surface, SurfaceError};
use crate::trajectory::Pose;

/// Steps along each edge of the frame when its outline is traced on the wall.
const STEPS_PER_EDGE: usize = 12;

/// Bounding box of a frame on the unrolled wall, metres. `s` is unrolled around the frame's middle and may
/// leave `[0, perimeter)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Range of s.
    pub s_m: (f64, f64),
    /// Range of h.
    pub h_m: (f64, f64),
}

impl Footprint {
    /// Traces the frame's border on the wall.
    ///
    /// # Errors
    /// A camera outside the tunnel, or a border pixel that looks along the axis.
    pub fn trace(
        surface: &dyn Surface,
        camera: &Pinhole,
        pose: &Pose,
    ) -> Result<Self, SurfaceError> {
        let hit = |u: f64, v: f64| surface.hit(&pose.t_wc, &(pose.r_wc * camera.ray(u, v)));
        let middle = hit(camera.cx, camera.cy)?.wall;
        let perimeter = surface.perimeter_m();
        let mut footprint = Self {
            s_m: (middle.s_m, middle.s_m),
            h_m: (middle.h_m, middle.h_m),
        };
        for pixel in camera.border(STEPS_PER_EDGE, 0.0) {
            let wall = hit(pixel.x, pixel.y)?.wall;
            let turns = ((wall.s_m - middle.s_m) / perimeter).round();
            footprint.include(wall.s_m - turns * perimeter, wall.h_m);
        }
        Ok(footprint)
    }

    fn include(&mut self, s_m: f64, h_m: f64) {
        self.s_m = (self.s_m.0.min(s_m), self.s_m.1.max(s_m));
        self.h_m = (self.h_m.0.min(h_m), self.h_m.1.max(h_m));
    }

    /// True if the boxes share some wall, around the section's `perimeter_m` too.
    pub fn overlaps(&self, other: &Self, perimeter_m: f64) -> bool {
        if self.h_m.0 >= other.h_m.1 || other.h_m.0 >= self.h_m.1 {
            return false;
        }
        let apart = 0.5 * (self.s_m.0 + self.s_m.1 - other.s_m.0 - other.s_m.1);
        let nearest = apart - (apart / perimeter_m).round() * perimeter_m;
        let reach = 0.5 * (self.s_m.1 - self.s_m.0 + other.s_m.1 - other.s_m.0);
        nearest.abs() < reach
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::Circle;
    use crate::trajectory::spiral;

    #[test]
    fn neighbours_overlap_across_the_seam_and_opposites_do_not() {
        let circle = Circle::new(3.0).unwrap();
        let camera = Pinhole::from_vertical_fov(640, 480, 60f64.to_radians());
        let poses = spiral(13, 0.1, 30f64.to_radians());
        let at = |k: usize| Footprint::trace(&circle, &camera, &poses[k]).unwrap();
        let perimeter = circle.perimeter_m();
        assert!(at(0).overlaps(&at(11), perimeter));
        assert!(at(0).overlaps(&at(12), perimeter));
        assert!(!at(0).overlaps(&at(6), perimeter));
        // 60° of height at 3 m is 3.46 m in the middle column; the corners see no farther up a cylinder.
        let height = at(0).h_m.1 - at(0).h_m.0;
        assert!(
            (height - 2.0 * 3.0 * 30f64.to_radians().tan()).abs() < 0.02,
            "{height}"
        );
    }
}
