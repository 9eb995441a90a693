//! Stitching: from frames and poses to the panorama.

use super::budget::Budget;
use super::memory;
use super::panorama::Panorama;
use super::plan::{Plan, Settled};
use crate::compositing::band::Target;
use crate::compositing::options::RenderOptions;
use crate::error::RenderError;
use crate::layout::canvas::Canvas;
use crate::layout::placement::{Placement, native_px_per_metre, place_frames};
use crate::sampling::picture_cache::{PictureCache, level_for};
use tunnelstitch_core::frames::FrameSet;
use tunnelstitch_core::progress::Progress;
use tunnelstitch_geometry::camera::Cameras;
use tunnelstitch_geometry::surface::Surface;
use tunnelstitch_geometry::trajectory::{Pose, Shutter};

/// Options of stitching frames on disk.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StitchOptions {
    /// Resolution, pixels per metre; without it the frames' own at the wall, or twice that with
    /// [`RenderOptions::super_resolve`].
    pub px_per_metre: Option<f64>,
    /// Treats every camera as if it stood on the axis; see [`on_the_axis`].
    pub ignore_offset: bool,
    /// Options of drawing.
    pub render: RenderOptions,
    /// Memory that may be used, bytes.
    pub memory: u64,
}

/// Memory of a panorama as a whole and in shards, bytes.
#[derive(Clone, Copy, Debug, Default)]
pub struct PlannedMemory {
    /// Drawn as a whole, with as many frames as there is room for.
    pub whole: u64,
    /// Finding its exposures and seams, with the frames of one band at a time.
    pub seams: u64,
    /// Drawing a shard, likewise.
    pub shard: u64,
    /// Putting it together from shards.
    pub join: u64,
}

/// Resolution of a wall that is solved from all frames, in units of the frames' own. A higher value
/// is slower and gains little.
const SUPER_RESOLVE_SCALE: f64 = 2.0;

impl Default for StitchOptions {
    fn default() -> Self {
        Self {
            px_per_metre: None,
            ignore_offset: false,
            render: RenderOptions::default(),
            memory: 2 << 30,
        }
    }
}

/// Moves the poses to the axis, `t_x = t_z = 0`, with chainage and rotation kept: for a panorama
/// that does not account for the camera's position (bricks seem to zoom).
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
    /// Place of every frame.
    pub placements: Vec<Placement>,
    /// Resolution of the frames at the wall, pixels per metre ([`native_px_per_metre`]).
    pub native_px_per_metre: f64,
    /// The canvas.
    pub canvas: Canvas,
}

/// Lays frames out for given poses, their rows read by `shutter`, at `px_per_metre` or `finer`
/// times the frames' own resolution: the canvas that [`stitch()`] draws.
///
/// # Errors
/// As [`place_frames`], [`native_px_per_metre`] and [`Canvas::covering`].
pub fn lay_out(
    surface: &dyn Surface,
    cameras: impl Into<Cameras>,
    poses: &[Pose],
    shutter: &Shutter,
    px_per_metre: Option<f64>,
    finer: f64,
) -> Result<LaidOut, RenderError> {
    let cameras = cameras.into();
    let placements = place_frames(surface, &cameras, poses, shutter)?;
    let native = native_px_per_metre(surface, &cameras, poses)?;
    let px_per_metre = px_per_metre.unwrap_or(finer * native);
    let canvas = Canvas::of_placements(surface, &placements, px_per_metre)?;
    Ok(LaidOut {
        placements,
        native_px_per_metre: native,
        canvas,
    })
}

/// Frames on disk, laid out to be drawn.
pub struct Stitch<'a> {
    surface: &'a dyn Surface,
    frames: PictureCache,
    laid_out: LaidOut,
    options: StitchOptions,
}

impl<'a> Stitch<'a> {
    /// Places the frames for given poses, their rows read by `shutter`, lays out the canvas and
    /// reads the frames' headers. Frames are to be halved where the canvas is coarser than half
    /// their resolution.
    ///
    /// # Errors
    /// Everything in [`RenderError`]; no frame is decoded yet.
    pub fn new(
        surface: &'a dyn Surface,
        cameras: impl Into<Cameras>,
        files: &FrameSet,
        poses: &[Pose],
        shutter: &Shutter,
        options: &StitchOptions,
    ) -> Result<Self, RenderError> {
        if poses.len() != files.len() {
            return Err(RenderError::Count {
                poses: poses.len(),
                frames: files.len(),
            });
        }
        let cameras = cameras.into();
        let moved;
        let poses = if options.ignore_offset {
            moved = on_the_axis(poses);
            &moved
        } else {
            poses
        };
        let finer = if options.render.super_resolve {
            SUPER_RESOLVE_SCALE
        } else {
            1.0
        };
        let laid_out = lay_out(
            surface,
            &cameras,
            poses,
            shutter,
            options.px_per_metre,
            finer,
        )?;
        let canvas = &laid_out.canvas;
        let shorter_side = cameras.shorter_side();
        let level = level_for(
            shorter_side,
            laid_out.native_px_per_metre,
            canvas.px_per_metre,
        );
        Ok(Self {
            surface,
            frames: PictureCache::open(files, &cameras, level)?,
            laid_out,
            options: *options,
        })
    }

    /// The canvas.
    pub fn canvas(&self) -> &Canvas {
        &self.laid_out.canvas
    }

    /// The frames.
    pub fn frames(&self) -> &PictureCache {
        &self.frames
    }

    /// Computes the memory that drawing needs if the output holds `output` bytes of it.
    ///
    /// # Errors
    /// [`RenderError::Memory`] if the least that is needed is more than may be used.
    pub fn budget(&self, output: u64) -> Result<Budget, RenderError> {
        Budget::new(
            self.surface,
            &self.laid_out.canvas,
            &self.frames,
            &self.laid_out.placements,
            &self.options.render,
            output,
            self.options.memory,
        )
    }

    /// Computes the memory on so many threads of a machine with as much as may be used, of which
    /// the output holds `output` bytes.
    ///
    /// # Errors
    /// [`RenderError`] of a camera that sees no wall.
    pub fn planned_memory(
        &self,
        output: u64,
        threads: usize,
    ) -> Result<PlannedMemory, RenderError> {
        let work = (&self.laid_out.placements[..], &self.options.render);
        let canvas = &self.laid_out.canvas;
        let least = Budget::least(self.surface, canvas, &self.frames, work, output, threads)?;
        let frames = self.frames.frame_bytes() * self.frames.len() as u64;
        let most = least.within(self.options.memory, &self.frames);
        Ok(PlannedMemory {
            whole: most.most(frames),
            seams: least.settling().max(least.drawing()),
            shard: least.drawing(),
            join: output + least.grid,
        })
    }

    /// Finds exposures and seams, within a budget. As many frames as there is room for stay in
    /// memory.
    ///
    /// # Errors
    /// A frame that cannot be decoded.
    pub fn settle(
        &mut self,
        budget: &Budget,
        progress: &dyn Progress,
    ) -> Result<Settled, RenderError> {
        // Those that are drawn first, since all are looked at now.
        let mut first: Vec<usize> = (0..self.frames.len()).collect();
        let start = |frame: &usize| self.laid_out.placements[*frame].footprint.h_min_m;
        first.sort_by(|a, b| start(a).total_cmp(&start(b)));
        first.truncate((budget.room / self.frames.frame_bytes().max(1)) as usize);
        self.frames.prefetch(&first, progress)?;
        Settled::find(
            self.surface,
            &self.frames,
            &self.laid_out.placements,
            &self.laid_out.canvas,
            &self.options.render,
            progress,
        )
    }

    /// Plan for drawing with these exposures and seams, and the frames.
    pub fn plan(&mut self, settled: Settled) -> (Plan<'_>, &mut PictureCache) {
        let plan = Plan::with(
            self.surface,
            &self.laid_out.placements,
            &self.laid_out.canvas,
            &self.options.render,
            settled,
        );
        (plan, &mut self.frames)
    }
}

/// Draws the panorama of frames on disk for given poses into memory, their rows read by `shutter`.
///
/// # Errors
/// Everything in [`RenderError`]; sizes are checked before a frame is read.
pub fn stitch(
    surface: &dyn Surface,
    cameras: impl Into<Cameras>,
    files: &FrameSet,
    poses: &[Pose],
    shutter: &Shutter,
    options: &StitchOptions,
    progress: &dyn Progress,
) -> Result<Panorama, RenderError> {
    let mut stitch = Stitch::new(surface, cameras, files, poses, shutter, options)?;
    let mut panorama = Panorama::empty(*stitch.canvas(), stitch.frames().format());
    let budget = stitch.budget(panorama.bytes())?;
    let settled = stitch.settle(&budget, progress)?;
    let (plan, frames) = stitch.plan(settled);
    plan.draw(frames, budget.room, &mut [&mut panorama], progress)?;
    Ok(panorama)
}

/// Draws the canvas from placed frames in memory.
///
/// # Errors
/// [`RenderError::Count`] unless there is one placement per frame.
pub fn render(
    surface: &dyn Surface,
    frames: &mut PictureCache,
    placements: &[Placement],
    canvas: &Canvas,
    options: &RenderOptions,
    progress: &dyn Progress,
) -> Result<Panorama, RenderError> {
    let plan = Plan::new(surface, frames, placements, canvas, options, progress)?;
    let mut panorama = Panorama::empty(*canvas, frames.format());
    let targets: &mut [&mut dyn Target] = &mut [&mut panorama];
    plan.draw(frames, u64::MAX, targets, progress)?;
    Ok(panorama)
}

/// Checks that `copies` panoramas (each drawn one, and one on its way to the file) and the frames,
/// all of them held, fit into the free memory; returns what they take, bytes.
///
/// # Errors
/// [`RenderError::Memory`].
pub fn check_memory(
    canvas: &Canvas,
    copies: u64,
    frames: &PictureCache,
) -> Result<u64, RenderError> {
    let picture = canvas.pixels() as u64 * frames.format().pixel_bytes(true) as u64;
    let needed = frames.frame_bytes() * frames.len() as u64 + picture * copies;
    memory::check_available(canvas, frames, needed, memory::available_bytes())?;
    Ok(needed)
}
