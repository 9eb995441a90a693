//! Frames and poses in, panorama out.

use super::draw::{Composition, Mode, Scene};
use super::levelling::COARSEST;
use super::seams::{STEP_PX, Seams};
use super::thumbnails::Thumbnails;
use super::view::Kernels;
use super::{
    Canvas, Drawn, Exposure, FrameStack, Interpolation, Panorama, Placement, RenderError, Tile,
    level_for, memory, native_px_per_metre, place, tiles,
};
use crate::camera::Pinhole;
use crate::frames::FrameFile;
use crate::progress::Progress;
use crate::surface::Surface;
use crate::trajectory::Pose;
use rayon::prelude::*;

/// How frames become a panorama.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderOptions {
    /// How frames are sampled between their pixels.
    pub interpolation: Interpolation,
    /// Which frames a pixel shows.
    pub mode: Mode,
    /// Whether exposure is undone and light levelled out over seams; else frames keep the values they have.
    pub blend: bool,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            interpolation: Interpolation::default(),
            mode: Mode::default(),
            blend: true,
        }
    }
}

/// How a panorama is drawn from frames on disk.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StitchOptions {
    /// Resolution, pixels per metre; without it the frames' own at the wall.
    pub px_per_metre: Option<f64>,
    /// Treats every camera as standing on the axis; see [`on_the_axis`].
    pub ignore_offset: bool,
    /// How frames become a panorama.
    pub render: RenderOptions,
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
    let mut frames = FrameStack::open(files, camera, level)?;
    let copies = 2;
    check_memory(&canvas, copies, &frames)?;
    frames.hold_all(progress)?;
    render(
        surface,
        &frames,
        &placements,
        &canvas,
        &options.render,
        progress,
    )
}

/// Draws the canvas from placed frames that are held.
///
/// The bytes do not depend on the number of threads.
///
/// # Errors
/// [`RenderError::Count`] unless there is one placement per frame.
pub fn render(
    surface: &dyn Surface,
    frames: &FrameStack,
    placements: &[Placement],
    canvas: &Canvas,
    options: &RenderOptions,
    progress: &dyn Progress,
) -> Result<Panorama, RenderError> {
    if frames.len() != placements.len() {
        return Err(RenderError::Count {
            poses: placements.len(),
            frames: frames.len(),
        });
    }
    let plan = Plan::new(surface, frames, placements, canvas, options, progress)?;
    let scene = plan.scene(surface, frames, placements, canvas);
    let mut panorama = Panorama::empty(*canvas, frames.format());
    let bands = tiles(surface, canvas, placements);
    progress.start("panorama", bands.iter().map(Vec::len).sum());
    // As many tiles at once as keep all threads busy.
    let tiles: Vec<Tile> = bands.into_iter().flatten().collect();
    for run in tiles.chunks(16 * rayon::current_num_threads().max(1)) {
        let drawn: Vec<Drawn> = run.par_iter().map(|tile| scene.draw(tile)).collect();
        for (tile, drawn) in run.iter().zip(&drawn) {
            panorama.put(tile, drawn);
        }
        progress.advance(run.len());
    }
    progress.finish();
    Ok(panorama)
}

/// All that is settled before the first tile is drawn.
struct Plan {
    mode: Mode,
    kernels: Kernels,
    exposure: Exposure,
    seams: Option<Seams>,
}

impl Plan {
    fn new(
        surface: &dyn Surface,
        frames: &FrameStack,
        placements: &[Placement],
        canvas: &Canvas,
        options: &RenderOptions,
        progress: &dyn Progress,
    ) -> Result<Self, RenderError> {
        let mut plan = Self {
            mode: options.mode,
            kernels: Kernels::new(options.interpolation),
            exposure: Exposure::none(frames.len()),
            seams: None,
        };
        if !options.blend && options.mode != Mode::BestView {
            return Ok(plan);
        }
        let camera = frames.camera();
        let grid = canvas.grid(STEP_PX, COARSEST);
        let poses: Vec<Pose> = placements.iter().map(|placement| placement.pose).collect();
        let native = native_px_per_metre(surface, camera, &poses)?;
        let level = Thumbnails::level(camera, native, grid.px_per_metre);
        let thumbnails = Thumbnails::of(frames, level, progress)?;
        // Seams are sought in evenly lit frames, even where frames are to stay as they are.
        let white = frames.format().white();
        let exposure = Exposure::solve(surface, &thumbnails, placements, canvas, white);
        if options.mode == Mode::BestView {
            plan.seams = Some(Seams::find(
                surface,
                &thumbnails,
                &exposure.of_thumbnails(&thumbnails),
                placements,
                grid,
                options.blend.then_some(white),
            ));
        }
        if options.blend {
            plan.exposure = exposure;
        }
        Ok(plan)
    }

    fn scene<'a>(
        &'a self,
        surface: &'a dyn Surface,
        frames: &'a FrameStack,
        placements: &'a [Placement],
        canvas: &'a Canvas,
    ) -> Scene<'a> {
        let composition = match (self.mode, &self.seams) {
            (Mode::BestView, Some(seams)) => Composition::Seams(seams),
            (Mode::Median, _) => Composition::Median,
            _ => Composition::Average,
        };
        Scene {
            surface,
            frames,
            placements,
            canvas,
            kernels: &self.kernels,
            exposure: &self.exposure,
            composition,
        }
    }
}

/// Checks that `copies` panoramas (each drawn one, and one on its way to the file) and the frames, all of them held, fit into the
/// free memory.
///
/// # Errors
/// [`RenderError::Memory`].
pub(crate) fn check_memory(
    canvas: &Canvas,
    copies: u64,
    frames: &FrameStack,
) -> Result<(), RenderError> {
    let picture = canvas.pixels() as u64 * frames.format().pixel_bytes(true) as u64;
    let needed = frames.frame_bytes() * frames.len() as u64 + picture * copies;
    fits(canvas, frames.len(), needed, memory::available_bytes())
}

fn fits(
    canvas: &Canvas,
    frames: usize,
    needed: u64,
    available: Option<u64>,
) -> Result<(), RenderError> {
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
    fn what_is_beyond_the_memory_is_refused() {
        let canvas = Canvas {
            columns: 10_000,
            rows: 10_000,
            px_per_metre: 100.0,
            h_start_m: 0.0,
        };
        assert!(fits(&canvas, 100, 500_000_000, Some(500_000_000)).is_ok());
        assert!(fits(&canvas, 100, 500_000_001, None).is_ok());
        let message = fits(&canvas, 100, 500_000_001, Some(500_000_000))
            .unwrap_err()
            .to_string();
        assert!(message.contains("10000 × 10000 px") && message.contains("--px-per-metre"));
    }
}
