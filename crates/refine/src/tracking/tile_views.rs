//! Views of tiles by which the light that moves with the camera is estimated.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::samples::sampling::Sampling;
use nalgebra::{Vector2, Vector3};
use std::ops::Range;
use tunnelstitch_core::frames::SHADING_TERMS;
use tunnelstitch_geometry::trajectory::Pose;

/// Frames that the shading is estimated from, at the most: it is the same in all.
pub const MAX_SHADING_FRAMES: usize = 60;
/// Tiles that the shading is estimated from, spread over all of these frames.
const MAX_SHADING_TILES: usize = 1000;

/// The frames that the light is estimated from, of `count`: the middle ones.
pub fn calibrated_frames(count: usize) -> Range<usize> {
    let first = count.saturating_sub(MAX_SHADING_FRAMES) / 2;
    first..(first + MAX_SHADING_FRAMES).min(count)
}

/// A tile in a frame.
pub struct TileView {
    /// The frame, counted from the first that the light is estimated from.
    pub frame: usize,
    /// Its centre, pixels of the full-size frame.
    pub pixel: Vector2<f64>,
    /// Its centre, metres.
    pub x_w: Vector3<f64>,
    /// The wall's unit normal there.
    pub normal: Vector3<f64>,
    /// Mean grey value, without the frame's bias.
    pub grey: f64,
    /// The frame's gain.
    pub gain: f64,
}

/// Tiles spread over all of the wall, as the frames show them that the light is estimated from.
pub struct TileViews {
    /// The views of each tile.
    pub tiles: Vec<Vec<TileView>>,
    /// The first of these frames.
    first: usize,
    /// Their poses.
    pub poses: Vec<Pose>,
}

impl TileViews {
    /// Observes tiles at the frames' present poses.
    pub fn observe(
        context: &EstimationContext,
        options: &RefineOptions,
        frames: &FrameStates,
    ) -> Result<Self, ProblemError> {
        let range = calibrated_frames(frames.estimates.len());
        let level = options.handover_level(context.cameras.shorter_side());
        let window = frames.window_of(range.clone(), range.clone());
        let problem = PhotometricProblem::new(context, Sampling::of(level), window)?;
        let estimates = frames.estimates[range.clone()].iter();
        let poses: Vec<Pose> = estimates.map(|estimate| estimate.pose).collect();
        let tiles = problem.gather_from_tiles(
            MAX_SHADING_TILES,
            |tiles: &mut Vec<Vec<TileView>>, tile| {
                let means = tile.workspace.mean_values(tile.points, tile.observations());
                let (x_w, normal) = (tile.points.centre.x_w, tile.points.centre.normal());
                let seen = tile.observers.iter().zip(means);
                let views = seen.filter_map(|(observer, mean)| {
                    let frame = tile.participants[observer.frame as usize];
                    let camera = problem.camera_of(frame);
                    let gain = tile.sampled_frames[observer.frame as usize].gain();
                    Some(TileView {
                        frame,
                        pixel: camera.project(&poses[frame].to_camera(&x_w))?,
                        x_w,
                        normal,
                        grey: mean * f64::from(gain * observer.shade),
                        gain: f64::from(gain),
                    })
                });
                tiles.push(views.collect());
            },
        )?;
        Ok(Self {
            tiles: tiles.into_iter().flatten().collect(),
            first: range.start,
            poses,
        })
    }

    /// Frames and pixels at which wall is observed.
    pub fn pixels(&self) -> Vec<(usize, Vector2<f64>)> {
        let views = self.tiles.iter().flatten();
        views
            .map(|view| (self.first + view.frame, view.pixel))
            .collect()
    }

    /// Number of independent readings of the light: a frame has as many as there are terms of the
    /// shading, however many tiles it shows
    /// ([`tunnelstitch_photometry::PhotometricCalibration::solve`]).
    pub fn independent(&self) -> f64 {
        (self.poses.len() * SHADING_TERMS) as f64
    }
}
