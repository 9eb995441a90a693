//! A frame as a tile of the canvas looks at it.

use super::exposure::Response;
use super::kernel::{Interpolation, Kernel};
use super::warp::{Look, Points, Run};
use super::{Canvas, Picture, Placement, Tile};
use crate::camera::Pinhole;
use crate::surface::Surface;
use nalgebra::Vector2;

/// Kernels are made for stretches of this step from 1 upwards.
const STRETCH_STEP: f64 = 0.25;
/// The widest kernel: frames are halved before they are more than twice as fine as the canvas, save where a camera stands
/// much nearer to the wall than the others.
const MOST_STRETCH: f64 = 4.0;

/// The kernels of an interpolation for all stretches.
#[derive(Clone, Debug)]
pub struct Kernels(Vec<Kernel>);

impl Kernels {
    /// The kernels of an interpolation.
    pub fn new(interpolation: Interpolation) -> Self {
        let steps = ((MOST_STRETCH - 1.0) / STRETCH_STEP) as usize;
        let kernel = |k| Kernel::new(interpolation, 1.0 + STRETCH_STEP * k as f64);
        Self((0..=steps).map(kernel).collect())
    }

    /// The widest kernel that is no wider than `stretch`.
    fn stretched(&self, stretch: f64) -> &Kernel {
        // The cast saturates, so that anything odd gets an end of the list.
        let step = ((stretch - 1.0) / STRETCH_STEP) as usize;
        &self.0[step.min(self.0.len() - 1)]
    }
}

/// A frame, ready to be sampled at the points of one tile.
pub struct View<'a> {
    /// Index of the frame.
    pub frame: usize,
    look: Look,
    picture: &'a Picture,
    kernel: &'a Kernel,
    response: Response<'a>,
    /// `2/width`, `2/height` of the picture, and the last pixel centres.
    feather: [f32; 4],
}

impl<'a> View<'a> {
    /// The frame with the given picture, as it is seen from `tile`, whose points are relative to `points.origin`.
    #[expect(clippy::too_many_arguments, reason = "a view is all of these")]
    pub fn new(
        frame: usize,
        surface: &dyn Surface,
        camera: &Pinhole,
        placement: &Placement,
        picture: &'a Picture,
        kernels: &'a Kernels,
        response: Response<'a>,
        canvas: &Canvas,
        tile: &Tile,
        points: &Points,
    ) -> Self {
        let stretch = stretch(surface, camera, placement, canvas, tile);
        let (width, height) = (camera.width as f32, camera.height as f32);
        Self {
            frame,
            look: Look::new(camera, &placement.pose, &points.origin),
            picture,
            kernel: kernels.stretched(stretch),
            response,
            feather: [2.0 / width, 2.0 / height, width - 0.5, height - 0.5],
        }
    }

    /// Looks at `count` points from index `start`: where they appear, and the values there with the frame's exposure undone.
    pub fn look_at(&self, run: &mut Run, points: &Points, start: usize, count: usize) {
        run.look(&self.look, self.picture, self.kernel, points, start, count);
        self.response.undo(run, count);
    }

    /// `tent(u) tent(v)`: 1 in the middle, falling to 0 half a pixel beyond the outermost pixel centres.
    #[inline(always)]
    pub fn feather(&self, u: f32, v: f32) -> f32 {
        let [across, down, right, bottom] = self.feather;
        (u + 0.5).min(right - u) * across * ((v + 0.5).min(bottom - v) * down)
    }
}

/// How many pixels of a frame a step of one canvas pixel covers in the middle of a tile, along that axis of the frame along
/// which it covers more.
fn stretch(
    surface: &dyn Surface,
    camera: &Pinhole,
    placement: &Placement,
    canvas: &Canvas,
    tile: &Tile,
) -> f64 {
    let middle = [
        f64::from(tile.column) + 0.5 * f64::from(tile.columns),
        f64::from(tile.row) + 0.5 * f64::from(tile.rows),
    ];
    let wall = surface.frame(canvas.wall_at(middle));
    let x_c = placement.pose.to_camera(&wall.x_w);
    if x_c.z <= 0.0 {
        return 1.0;
    }
    let jacobian = camera.project_jacobian(&x_c);
    let step = |e| jacobian * placement.pose.r_wc.inverse_transform_vector(&e);
    let (s, h): (Vector2<f64>, Vector2<f64>) = (step(wall.e_s), step(wall.e_h));
    s.x.hypot(h.x).max(s.y.hypot(h.y)) / canvas.px_per_metre
}
