//! Errors of drawing a panorama.

use tunnelstitch_core::frames::FrameError;
use tunnelstitch_core::persist::checkpoint::CheckpointError;
use tunnelstitch_core::raster::RasterError;
use tunnelstitch_geometry::surface::SurfaceError;

/// Error of drawing a panorama.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// Some ray of a frame has no place on the wall.
    #[error(
        "frame {frame}: {source}; its picture cannot be laid on the wall: check its pose, or \
         remove the frame"
    )]
    Frame {
        /// Index of the frame.
        frame: usize,
        /// Reason.
        source: SurfaceError,
    },
    /// Frames and poses do not pair up.
    #[error("{poses} poses for {frames} frames; every frame needs exactly one pose")]
    Count {
        /// Poses given.
        poses: usize,
        /// Frames given.
        frames: usize,
    },
    /// The resolution is no number of pixels.
    #[error("{px_per_metre} px per metre is no resolution; it must be a positive number")]
    Resolution {
        /// Pixels per metre asked for.
        px_per_metre: f64,
    },
    /// A picture nobody can mean.
    #[error(
        "the panorama would be {columns:.0} × {rows:.0} px ({:.1} Gpx, at most {:.0} are drawn): \
         {perimeter_m:.3} m around and {chainage_m:.3} m along at {px_per_metre:.1} px per metre; \
         lower --px-per-metre. Frame {frame} reaches farthest: it spans {span_m:.3} m of \
         chainage",
        columns * rows / 1e9,
        limit_px / 1e9
    )]
    TooManyPixels {
        /// Columns around the section.
        columns: f64,
        /// Rows along the axis.
        rows: f64,
        /// Most pixels drawn.
        limit_px: f64,
        /// Length around, metres.
        perimeter_m: f64,
        /// Length along, metres.
        chainage_m: f64,
        /// Resolution.
        px_per_metre: f64,
        /// The frame with the longest footprint.
        frame: usize,
        /// Length of its footprint along the axis, metres.
        span_m: f64,
    },
    /// A picture for which this machine is too small.
    #[error(
        "a panorama of {columns} × {rows} px from {frames} frames needs at least {needed_mib} MiB \
         of memory, and {available_mib} MiB may be used; raise --memory if there is more, write \
         .tif (a .png or .jpg is held in memory as a whole), or lower --px-per-metre"
    )]
    Memory {
        /// Columns around the section.
        columns: u32,
        /// Rows along the axis.
        rows: u32,
        /// Number of frames.
        frames: usize,
        /// Memory needed, MiB.
        needed_mib: u64,
        /// Memory that may be used or is free, MiB.
        available_mib: u64,
        /// True if it is more than may be used, however much is free.
        by_limit: bool,
    },
    /// The output.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// A frame's file.
    #[error(transparent)]
    Frames(#[from] FrameError),
    /// The checkpoint of an interrupted run.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}
