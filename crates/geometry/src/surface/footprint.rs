//! Footprints of frames on the wall.

use super::error::SurfaceError;
use super::shape::Surface;
use super::sight::sighted_wall;
use super::wall::WallPoint;
use crate::camera::Camera;
use crate::trajectory::Pose;
use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// Rays along each edge of a frame. The bounding box of the curved outline is too small by the
/// sagitta of one step: about 0.01 px for a frame 640 px wide.
const SAMPLES_PER_EDGE: usize = 64;

/// Rays from the centre of a frame to its first corner, along which `s` is unwrapped.
const SAMPLES_TO_CORNER: usize = 16;

/// Wraps a difference of arc lengths to the shortest: `Δs − P round(Δs / P)`, in `[−P/2, P/2]`
/// metres.
pub fn shortest_arc(delta_s_m: f64, perimeter_m: f64) -> f64 {
    delta_s_m - perimeter_m * (delta_s_m / perimeter_m).round()
}

/// Bounding box of a frame on the unrolled wall, metres.
///
/// `s` is unwrapped: a frame across θ = 0 has a negative `s_min_m` or an `s_max_m` beyond the
/// perimeter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Footprint {
    /// Least arc length.
    pub s_min_m: f64,
    /// Greatest arc length.
    pub s_max_m: f64,
    /// Least chainage.
    pub h_min_m: f64,
    /// Greatest chainage.
    pub h_max_m: f64,
}

impl Footprint {
    /// Traces the part of the wall that a frame shows within the camera's range.
    ///
    /// A frame that contains the tunnel's vanishing point sees the full circumference without end:
    /// its box covers all of `s`, and goes from the nearest wall on its border to the range.
    ///
    /// # Errors
    /// A camera outside the tunnel; for a camera of unlimited range, the errors of
    /// [`Footprint::outline`].
    pub fn trace(
        surface: &dyn Surface,
        camera: &Camera,
        pose: &Pose,
    ) -> Result<Self, SurfaceError> {
        let outline = Self::outline(surface, camera, pose);
        if camera.max_range_m.is_infinite() {
            return outline;
        }
        let h_m = surface.chainage_m(&pose.t_wc);
        let clamp = |end_m: f64| end_m.clamp(h_m - camera.max_range_m, h_m + camera.max_range_m);
        match outline {
            Ok(footprint) => Ok(Self {
                h_min_m: clamp(footprint.h_min_m),
                h_max_m: clamp(footprint.h_max_m),
                ..footprint
            }),
            Err(SurfaceError::Parallel | SurfaceError::LooksAlongTheAxis) => {
                surface.check_inside(&pose.t_wc)?;
                Ok(Self::along_the_tunnel(surface, camera, pose))
            }
            Err(error) => Err(error),
        }
    }

    /// Traces the frame's border, through the outermost pixel centres, on the wall.
    ///
    /// The map from pixel to wall is smooth and injective, so `s` and `h` take their extremes on
    /// the frame's border.
    ///
    /// # Errors
    /// A camera outside the tunnel; [`SurfaceError::Parallel`] for a border pixel that looks along
    /// the axis; [`SurfaceError::LooksAlongTheAxis`] if the axis's vanishing point lies within the
    /// image.
    fn outline(surface: &dyn Surface, camera: &Camera, pose: &Pose) -> Result<Self, SurfaceError> {
        let perimeter_m = surface.perimeter_m();
        let wall = |pixel: &Vector2<f64>| {
            let ray = camera.ray(pixel.x, pixel.y).ok_or(SurfaceError::NotShown)?;
            let start = pose.to_world(&camera.origin(pixel.y));
            surface.hit(&start, &(pose.r_wc * ray)).map(|hit| hit.wall)
        };
        let border = camera.border(SAMPLES_PER_EDGE, 0.0);
        let middle = 0.5 * Vector2::new(f64::from(camera.width - 1), f64::from(camera.height - 1));
        // Unwraps `s` towards the previous point, so that no turn is lost.
        let follow = |s_m: f64, before_m: f64| before_m + shortest_arc(s_m - before_m, perimeter_m);
        let inward = |error| match error {
            SurfaceError::Parallel => SurfaceError::LooksAlongTheAxis,
            other => other,
        };
        let mut s_m = wall(&middle).map_err(inward)?.s_m;
        for step in 1..SAMPLES_TO_CORNER {
            let pixel = middle + (border[0] - middle) * (step as f64 / SAMPLES_TO_CORNER as f64);
            s_m = follow(wall(&pixel).map_err(inward)?.s_m, s_m);
        }
        s_m = follow(wall(&border[0])?.s_m, s_m);
        let s_first_m = s_m;
        let mut footprint = Self {
            s_min_m: f64::INFINITY,
            s_max_m: f64::NEG_INFINITY,
            h_min_m: f64::INFINITY,
            h_max_m: f64::NEG_INFINITY,
        };
        // Once around, back to the first point.
        for pixel in border.iter().chain(&border[..1]) {
            let point = wall(pixel)?;
            s_m = follow(point.s_m, s_m);
            footprint.s_min_m = footprint.s_min_m.min(s_m);
            footprint.s_max_m = footprint.s_max_m.max(s_m);
            footprint.h_min_m = footprint.h_min_m.min(point.h_m);
            footprint.h_max_m = footprint.h_max_m.max(point.h_m);
        }
        if (s_m - s_first_m).abs() > 0.5 * perimeter_m {
            return Err(SurfaceError::LooksAlongTheAxis);
        }
        Ok(footprint)
    }

    /// The box of a frame that looks along the tunnel: all around, from the nearest wall on its
    /// border to the camera's range.
    fn along_the_tunnel(surface: &dyn Surface, camera: &Camera, pose: &Pose) -> Self {
        let h_m = surface.chainage_m(&pose.t_wc);
        let straight = surface.straightened(pose);
        let end_m = |along: f64| h_m + along.signum() * camera.max_range_m;
        let rays = camera.border(SAMPLES_PER_EDGE, 0.0).into_iter();
        let border_m = rays
            .filter_map(|pixel| camera.ray(pixel.x, pixel.y))
            .map(|ray_c| match sighted_wall(surface, camera, pose, &ray_c) {
                Ok(hit) => hit.wall.h_m,
                Err(_) => end_m((straight.r_wc * ray_c).y),
            });
        let vanishing_m = [1.0, -1.0].into_iter().filter_map(|along| {
            let ray_c = straight
                .r_wc
                .inverse_transform_vector(&(Vector3::y() * along));
            let pixel = camera.project(&ray_c)?;
            camera.is_in_image(&pixel, 0.0).then(|| end_m(along))
        });
        let nothing = (f64::INFINITY, f64::NEG_INFINITY);
        let (h_min_m, h_max_m) = border_m
            .chain(vanishing_m)
            .fold(nothing, |(from, to), h_m| (from.min(h_m), to.max(h_m)));
        Self {
            s_min_m: 0.0,
            s_max_m: surface.perimeter_m(),
            h_min_m,
            h_max_m,
        }
    }

    /// True if the two boxes intersect, modulo turns around the tunnel.
    pub fn overlaps(&self, other: &Self, perimeter_m: f64) -> bool {
        if self.h_min_m > other.h_max_m || other.h_min_m > self.h_max_m {
            return false;
        }
        let behind = (other.s_min_m - self.s_min_m).rem_euclid(perimeter_m);
        behind <= self.s_max_m - self.s_min_m
            || behind + other.s_max_m - other.s_min_m >= perimeter_m
    }

    /// The box enlarged so that it certainly contains the frame's footprint and `pixel_m` (metres)
    /// around it: the box is traced by single rays, and 2 % of its size cover the outline between
    /// them.
    pub fn widened_conservatively(&self, pixel_m: f64) -> Self {
        let span_m = (self.s_max_m - self.s_min_m).max(self.h_max_m - self.h_min_m);
        self.widened(pixel_m + 0.02 * span_m)
    }

    /// The point in the middle of the box; its arc length may be beyond the perimeter, as theirs.
    pub fn middle(&self) -> WallPoint {
        WallPoint {
            s_m: 0.5 * (self.s_min_m + self.s_max_m),
            h_m: 0.5 * (self.h_min_m + self.h_max_m),
        }
    }

    /// True if a point lies in the box, modulo turns around the tunnel.
    pub fn contains(&self, point: &WallPoint, perimeter_m: f64) -> bool {
        let behind = (point.s_m - self.s_min_m).rem_euclid(perimeter_m);
        (self.h_min_m..=self.h_max_m).contains(&point.h_m) && behind <= self.s_max_m - self.s_min_m
    }

    /// The box enlarged by `margin_m` on every side, metres.
    pub fn widened(&self, margin_m: f64) -> Self {
        Self {
            s_min_m: self.s_min_m - margin_m,
            s_max_m: self.s_max_m + margin_m,
            h_min_m: self.h_min_m - margin_m,
            h_max_m: self.h_max_m + margin_m,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::circle::Circle;
    use crate::trajectory::{so3, spiral};
    use std::f64::consts::TAU;

    fn camera() -> Camera {
        Camera::from_vertical_fov(640, 480, 60f64.to_radians())
    }

    fn facing(turn: Vector3<f64>) -> Pose {
        Pose::new(so3::exp(&turn), Vector3::zeros())
    }

    #[test]
    fn a_centred_frame_spans_its_field_of_view() {
        let circle = Circle::new(3.0).unwrap();
        let camera = camera();
        let footprint = Footprint::trace(&circle, &camera, &facing(Vector3::zeros())).unwrap();
        let half_angle = (camera.cx / camera.fx).atan();
        assert!((footprint.s_max_m - 3.0 * half_angle).abs() < 1e-9);
        assert!((footprint.s_min_m + 3.0 * half_angle).abs() < 1e-9);
        // The middle of the upper edge has the smallest h = −r cy/f, reached within the sagitta.
        let h_m = 3.0 * camera.cy / camera.fy;
        assert!((footprint.h_max_m - h_m).abs() < 1e-9 && (footprint.h_min_m + h_m).abs() < 1e-9);
    }

    #[test]
    fn neighbours_overlap_across_the_seam_and_opposites_do_not() {
        let circle = Circle::new(3.0).unwrap();
        let poses = spiral(13, 0.1, 30f64.to_radians());
        let at = |k: usize| Footprint::trace(&circle, &camera(), &poses[k]).unwrap();
        let perimeter = circle.perimeter_m();
        for (a, b, expected) in [(0, 11, true), (11, 0, true), (0, 12, true), (0, 6, false)] {
            assert_eq!(at(a).overlaps(&at(b), perimeter), expected, "{a} and {b}");
        }
    }

    #[test]
    fn meeting_a_box_minds_the_wrap() {
        let at = |s_m: f64, h_m: f64, size_m: f64| Footprint {
            s_min_m: s_m,
            s_max_m: s_m + size_m,
            h_min_m: h_m,
            h_max_m: h_m + size_m,
        };
        let footprint = Footprint {
            s_min_m: -1.0,
            s_max_m: 2.0,
            h_min_m: 0.0,
            h_max_m: 1.0,
        };
        let meets = |s_m, h_m| footprint.overlaps(&at(s_m, h_m, 0.5), TAU);
        assert!(meets(0.0, 0.5) && meets(TAU - 0.9, 0.5) && meets(TAU - 1.4, 0.5));
        assert!(!meets(2.1, 0.5) && !meets(TAU - 1.6, 0.5) && !meets(0.0, 1.1));
        assert!(!meets(0.0, -0.6) && meets(0.0, -0.4));
        assert!(footprint.widened(0.2).overlaps(&at(2.1, 0.5, 0.5), TAU));
    }

    #[test]
    fn a_view_along_the_tunnel_ends_at_the_range() {
        let circle = Circle::new(3.0).unwrap();
        let near = Camera {
            max_range_m: 5.0,
            ..camera()
        };
        // Looking along +y; the corners meet the wall at h = r f/hypot(u, v).
        let along = facing(Vector3::x() * (-TAU / 4.0));
        let box_m = Footprint::trace(&circle, &near, &along).unwrap();
        let corner_m = 3.0 * near.fx / near.cx.hypot(near.cy);
        let narrow = Camera {
            max_range_m: 20.0,
            ..near
        };
        assert!(
            (Footprint::trace(&circle, &narrow, &along).unwrap().h_min_m - corner_m).abs() < 1e-9
        );
        assert_eq!(box_m.h_max_m, 5.0);
        assert_eq!(box_m.s_max_m - box_m.s_min_m, circle.perimeter_m());
        let across = facing(Vector3::zeros());
        assert_eq!(
            Footprint::trace(&circle, &near, &across),
            Footprint::trace(&circle, &camera(), &across)
        );
    }

    #[test]
    fn frames_without_an_end_and_cameras_outside_are_refused() {
        let circle = Circle::new(3.0).unwrap();
        let camera = camera();
        let trace = |camera: &Camera, pose: &Pose| Footprint::trace(&circle, camera, pose);
        let along = facing(Vector3::x() * (-TAU / 4.0));
        assert_eq!(trace(&camera, &along), Err(SurfaceError::LooksAlongTheAxis));
        // The vanishing point is within the image, but on no traced ray.
        let nearly = facing(Vector3::x() * (0.13 - TAU / 4.0));
        assert_eq!(
            trace(&camera, &nearly),
            Err(SurfaceError::LooksAlongTheAxis)
        );
        // The middle of the upper edge lies exactly along the axis.
        let mut odd = camera;
        (odd.width, odd.cx) = (641, 320.0);
        let tilt = facing(Vector3::x() * (TAU / 4.0 - (camera.cy / camera.fy).atan()));
        assert_eq!(trace(&odd, &tilt), Err(SurfaceError::Parallel));
        let outside = Pose::new(so3::exp(&Vector3::zeros()), Vector3::x() * 4.0);
        assert!(matches!(
            trace(&camera, &outside),
            Err(SurfaceError::CameraOutside { .. })
        ));
    }
}
