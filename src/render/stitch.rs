//! Frames and poses in, panorama out.

use super::{
    Canvas, FrameStack, Interpolation, Panorama, Placement, RenderError, level_for, memory,
    native_px_per_metre, place, render,
};
use crate::camera::Pinhole;
use crate::frames::FrameFile;
use crate::progress::Progress;
use crate::surface::Surface;
use crate::trajectory::Pose;

/// How a panorama is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StitchOptions {
    /// Resolution, pixels per metre; without it the frames' own at the wall.
    pub px_per_metre: Option<f64>,
    /// How frames are sampled between their pixels.
    pub interpolation: Interpolation,
    /// Treats every camera as standing on the axis; see [`on_the_axis`].
    pub ignore_offset: bool,
}

/// The poses with `t_x = t_z = 0`: chainage and rotation kept, the distance from the axis forgotten. What a
/// panorama looks like that does not account for the camera's position (bricks seem to zoom).
pub fn on_the_axis(poses: &[Pose]) -> Vec<Pose> {
    poses
        .iter()
        .map(|pose| {
            let mut t_wc = pose.t_wc;
            t_wc.x = 0.0;
            t_wc.z = 0.0;
            Pose::new(pose.r_wc, t_wc)
        })
        .collect()
}

/// Frames laid out on a canvas that holds all they see.
#[derive(Clone, Debug)]
pub struct LaidOut {
    /// Every frame's place.
    pub placements: Vec<Placement>,
    /// The frames' own resolution at the wall, pixels per metre ([`native_px_per_metre`]).
    pub native_px_per_metre: f64,
    /// The canvas.
    pub canvas: Canvas,
}

/// Lays frames out for given poses, at `px_per_metre` or the frames' own resolution: the canvas that [`stitch()`] draws.
///
/// # Errors
/// As [`place`], [`native_px_per_metre`] and [`Canvas::covering`].
pub fn lay_out(
    surface: &dyn Surface,
    camera: &Pinhole,
    poses: &[Pose],
    px_per_metre: Option<f64>,
) -> Result<LaidOut, RenderError> {
    let placements = place(surface, camera, poses)?;
    let native = native_px_per_metre(surface, camera, poses)?;
    let canvas = Canvas::of_placements(surface, &placements, px_per_metre.unwrap_or(native))?;
    Ok(LaidOut {
        placements,
        native_px_per_metre: native,
        canvas,
    })
}

/// Draws the panorama of frames on disk for given poses: places the frames, lays out the canvas, loads the
/// frames (halved where the canvas is coarser than half their resolution) and renders.
///
/// # Errors
/// Everything in [`RenderError`]; sizes are checked before a frame is read.
pub fn stitch(
    surface: &dyn Surface,
    camera: &Pinhole,
    files: &[FrameFile],
    poses: &[Pose],
    options: &StitchOptions,
    progress: &dyn Progress,
) -> Result<Panorama, RenderError> {
    if poses.len() != files.len() {
        return Err(RenderError::Count {
            poses: poses.len(),
            frames: files.len(),
        });
    }
    let moved;
    let poses = if options.ignore_offset {
        moved = on_the_axis(poses);
        &moved
    } else {
        poses
    };
    let LaidOut {
        placements,
        native_px_per_metre,
        canvas,
    } = lay_out(surface, camera, poses, options.px_per_metre)?;
    let level = level_for(camera, native_px_per_metre, canvas.px_per_metre);
    // Whether there is colour shows only in the files; grey is the least that is needed.
    let copies = 2;
    check_memory(&canvas, copies, &camera.at_level(level), files.len(), 1)?;
    let frames = FrameStack::load(files, camera, level, progress)?;
    check_memory(&canvas, copies, frames.camera(), 0, frames.channels())?;
    render(
        surface,
        &frames,
        &placements,
        &canvas,
        options.interpolation,
        progress,
    )
}

/// Checks that `copies` panoramas (each drawn one, and one on its way to the file) and `frames` frames yet
/// to be loaded fit into the free memory.
///
/// # Errors
/// [`RenderError::Memory`].
pub(crate) fn check_memory(
    canvas: &Canvas,
    copies: u64,
    camera: &Pinhole,
    frames: usize,
    channels: usize,
) -> Result<(), RenderError> {
    let available = memory::available_bytes();
    fits(canvas, copies, camera, frames, channels, available)
}

fn fits(
    canvas: &Canvas,
    copies: u64,
    camera: &Pinhole,
    frames: usize,
    channels: usize,
    available: Option<u64>,
) -> Result<(), RenderError> {
    let frame = u64::from(camera.width) * u64::from(camera.height) * channels as u64;
    let picture = canvas.pixels() as u64 * (channels as u64 + 1);
    let needed = frame * frames as u64 + picture * copies;
    match available {
        Some(available) if needed > available => Err(RenderError::Memory {
            columns: canvas.columns,
            rows: canvas.rows,
            frames,
            needed_mib: needed >> 20,
            available_mib: available >> 20,
        }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_canvas_beyond_the_memory_is_refused() {
        let canvas = Canvas {
            columns: 10_000,
            rows: 10_000,
            px_per_metre: 100.0,
            h_start_m: 0.0,
        };
        let camera = Pinhole::from_vertical_fov(1000, 1000, 1.0);
        assert!(fits(&canvas, 2, &camera, 100, 1, Some(500_000_000)).is_ok());
        assert!(fits(&canvas, 2, &camera, 100, 1, None).is_ok());
        let message = fits(&canvas, 2, &camera, 101, 1, Some(500_000_000))
            .unwrap_err()
            .to_string();
        assert!(message.contains("10000 × 10000 px") && message.contains("--px-per-metre"));
    }
}
