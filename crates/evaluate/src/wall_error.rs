//! Displacement of the frames' pixels on the wall.

use crate::error::EvaluateError;
use crate::error::check_pairs;
use crate::error_statistics::{ErrorStatistics, root_mean_square};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use tunnelstitch_geometry::camera::{Camera, Cameras};
use tunnelstitch_geometry::surface::{
    Surface, SurfaceError, gauge_component, shortest_arc, sighted_wall, viewing_distance,
};
use tunnelstitch_geometry::trajectory::Pose;

/// Maximum iterations of the mean of arcs.
const MAX_MEAN_ITERATIONS: usize = 20;

/// Distances on the unrolled wall between a pixel's projections by the estimated and true poses.
///
/// They are computed for 9 × 7 pixels per frame ([`Camera::grid_rays`]). The mean `Δs` and the
/// mean `Δh` over all pixels of all frames are removed as far as the tunnel's
/// [gauge](tunnelstitch_geometry::surface::Gauge) leaves them free: they are unobservable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct WallError {
    /// Mean `Δs` that was removed, metres.
    pub shift_s_m: f64,
    /// Mean `Δh` that was removed, metres.
    pub shift_h_m: f64,
    /// Statistics over all pixels, millimetres.
    pub mm: ErrorStatistics,
    /// Statistics over all pixels, in pixels at the frame's centre: metres over `distance / f` of
    /// the true pose.
    pub px: ErrorStatistics,
    /// Root mean square of each frame, millimetres.
    pub frame_rms_mm: Vec<f64>,
    /// Root mean square of each frame, pixels.
    pub frame_rms_px: Vec<f64>,
    /// Index of the frame with the largest root mean square.
    pub worst_frame: usize,
    /// Root mean square of that frame, millimetres.
    pub worst_frame_rms_mm: f64,
    /// Root mean square of that frame, pixels.
    pub worst_frame_rms_px: f64,
}

/// Compares the projections of pixels onto the wall by estimated and true poses.
///
/// # Errors
/// [`EvaluateError::Count`], [`EvaluateError::Empty`]; [`EvaluateError::Frame`] if a ray meets no
/// wall.
pub fn wall_error(
    surface: &dyn Surface,
    cameras: impl Into<Cameras>,
    estimated: &[Pose],
    truth: &[Pose],
) -> Result<WallError, EvaluateError> {
    let cameras = cameras.into();
    check_pairs(estimated.len(), truth.len())?;
    let perimeter_m = surface.perimeter_m();
    let (mut delta_s, mut delta_h, mut pixel_m) = (Vec::new(), Vec::new(), Vec::new());
    let mut ends = Vec::new();
    for (frame, (estimate, truth)) in estimated.iter().zip(truth).enumerate() {
        let offsets = frame_offsets(surface, cameras.of(frame), frame, estimate, truth)?;
        delta_s.extend(offsets.delta_s_m);
        delta_h.extend(offsets.delta_h_m);
        pixel_m.resize(delta_s.len(), offsets.pixel_m);
        ends.push(delta_s.len());
    }
    let mean = Vector2::new(
        mean_arc(&delta_s, perimeter_m),
        delta_h.iter().sum::<f64>() / delta_h.len() as f64,
    );
    let (shift, _) = gauge_component(surface, &truth[0], &mean);
    let (shift_s_m, shift_h_m) = (shift.x, shift.y);
    let distances_mm: Vec<f64> = delta_s
        .iter()
        .zip(&delta_h)
        .map(|(s, h)| 1e3 * shortest_arc(s - shift_s_m, perimeter_m).hypot(h - shift_h_m))
        .collect();
    let distances_px: Vec<f64> = (distances_mm.iter().zip(&pixel_m))
        .map(|(mm, pixel_m)| 1e-3 * mm / pixel_m)
        .collect();
    let of_frames = |distances: &[f64]| -> Vec<f64> {
        let starts = std::iter::once(&0).chain(&ends);
        let frames = starts.zip(&ends);
        frames
            .map(|(start, end)| root_mean_square(&distances[*start..*end]))
            .collect()
    };
    let (frame_rms_mm, frame_rms_px) = (of_frames(&distances_mm), of_frames(&distances_px));
    let worst_frame = (0..frame_rms_px.len())
        .max_by(|a, b| frame_rms_px[*a].total_cmp(&frame_rms_px[*b]))
        .unwrap_or_default();
    Ok(WallError {
        shift_s_m,
        shift_h_m,
        mm: ErrorStatistics::of(&distances_mm),
        px: ErrorStatistics::of(&distances_px),
        worst_frame,
        worst_frame_rms_mm: frame_rms_mm[worst_frame],
        worst_frame_rms_px: frame_rms_px[worst_frame],
        frame_rms_mm,
        frame_rms_px,
    })
}

/// Displacements of one frame's pixels on the wall, including the gauge.
pub(super) struct FrameOffsets {
    /// `Δs` of each pixel of the grid, metres, modulo the perimeter.
    pub delta_s_m: Vec<f64>,
    /// `Δh` of each pixel, metres.
    pub delta_h_m: Vec<f64>,
    /// Size of a pixel on the wall at the frame's centre, metres.
    pub pixel_m: f64,
}

/// Projects a frame's grid of pixels onto the wall by its estimated and its true pose.
///
/// # Errors
/// [`EvaluateError::Frame`] if a ray meets no wall.
pub(super) fn frame_offsets(
    surface: &dyn Surface,
    camera: &Camera,
    frame: usize,
    estimate: &Pose,
    truth: &Pose,
) -> Result<FrameOffsets, EvaluateError> {
    let failed = |which| {
        move |source| EvaluateError::Frame {
            frame,
            which,
            source,
        }
    };
    let (mut delta_s_m, mut delta_h_m) = (Vec::new(), Vec::new());
    // Pixels without a ray are left out, and those that truly show wall beyond the range.
    for ray in camera.grid_rays() {
        let there = match sighted_wall(surface, camera, truth, &ray) {
            Ok(hit) => hit.wall,
            Err(SurfaceError::Parallel | SurfaceError::BeyondRange { .. }) => continue,
            Err(source) => return Err(failed("true")(source)),
        };
        let ray_w = estimate.r_wc * ray;
        let here = surface
            .hit(&estimate.t_wc, &ray_w)
            .map_err(failed("estimated"))?
            .wall;
        delta_s_m.push(here.s_m - there.s_m);
        delta_h_m.push(here.h_m - there.h_m);
    }
    Ok(FrameOffsets {
        delta_s_m,
        delta_h_m,
        pixel_m: viewing_distance(surface, camera, truth).map_err(failed("true"))?
            / camera.focal_px(),
    })
}

/// Computes the mean of arcs on a circle of perimeter P.
///
/// It starts from the direction of `Σ exp(2πi Δs / P)` and repeats the mean of the shortest arcs
/// around it until convergence.
pub(super) fn mean_arc(arcs_m: &[f64], perimeter_m: f64) -> f64 {
    let (mut sin, mut cos) = (0.0, 0.0);
    for arc in arcs_m {
        let (s, c) = (TAU * arc / perimeter_m).sin_cos();
        sin += s;
        cos += c;
    }
    let mut mean = perimeter_m / TAU * sin.atan2(cos);
    // Only arcs near the antipode change while the mean moves, so a few iterations suffice.
    for _ in 0..MAX_MEAN_ITERATIONS {
        let step = arcs_m
            .iter()
            .map(|arc| shortest_arc(arc - mean, perimeter_m))
            .sum::<f64>()
            / arcs_m.len() as f64;
        mean += step;
        if step.abs() < 1e-15 * perimeter_m {
            break;
        }
    }
    shortest_arc(mean, perimeter_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::surface::{Circle, GaugeMotion};
    use tunnelstitch_geometry::trajectory::spiral;

    fn scene() -> (Circle, Camera, Vec<Pose>) {
        let circle = Circle::new(3.0).unwrap();
        let camera = Camera::from_vertical_fov(640, 480, 60f64.to_radians());
        (circle, camera, spiral(24, 0.1, 30f64.to_radians()))
    }

    #[test]
    fn the_gauge_costs_nothing_even_across_the_wrap() {
        let (circle, camera, truth) = scene();
        for alpha_rad in [0.3, 3.1, -3.1] {
            let gauge = GaugeMotion::about_y(alpha_rad, -7.0);
            let error = wall_error(&circle, camera, &gauge.apply_all(&truth), &truth).unwrap();
            assert!(error.mm.max < 1e-6, "{}", error.mm.max);
            assert!((error.shift_s_m - 3.0 * alpha_rad).abs() < 1e-9);
            assert!((error.shift_h_m + 7.0).abs() < 1e-9);
        }
    }

    #[test]
    fn a_frame_pushed_along_the_axis_is_off_by_that_much() {
        let (circle, camera, truth) = scene();
        let mut estimated = truth.clone();
        estimated[5].t_wc.y += 0.024;
        let error = wall_error(&circle, camera, &estimated, &truth).unwrap();
        // The mean shift of 1 mm is removed everywhere.
        assert!((error.frame_rms_mm[5] - 23.0).abs() < 1e-6);
        assert!((error.mm.median - 1.0).abs() < 1e-6);
        assert_eq!(error.worst_frame, 5);
        let px = 0.023 * camera.fx / 3.0;
        assert!((error.worst_frame_rms_px - px).abs() < 1e-6);
        assert!((error.px.max - px).abs() < 1e-6);
        let rms = ((23.0f64.powi(2) + 23.0) / 24.0).sqrt();
        assert!((error.mm.rms - rms).abs() < 1e-6);
    }

    #[test]
    fn a_camera_outside_names_its_frame() {
        let (circle, camera, truth) = scene();
        let mut estimated = truth.clone();
        estimated[2].t_wc.x = 5.0;
        let message = wall_error(&circle, camera, &estimated, &truth)
            .unwrap_err()
            .to_string();
        assert!(message.contains("frame 2, estimated pose"), "{message}");
    }
}
