//! Views of tiles by which the light that moves with the camera is estimated.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::samples::sampling::Sampling;
use nalgebra::Vector2;
use tunnelstitch_geometry::trajectory::Pose;
use tunnelstitch_photometry::{Observation, ObservedPoint, light_frames};

/// Tiles that the shading is estimated from, spread over all of its frames.
const MAX_SHADING_TILES: usize = 1000;

/// Tiles spread over all of the wall, as the frames show them that the light is estimated from.
pub struct TileViews {
    /// The centres of the tiles, observed by their mean values; frames are counted from the first
    /// that the light is estimated from.
    pub points: Vec<ObservedPoint>,
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
        let range = light_frames(frames.estimates.len());
        let level = options.handover_level(context.cameras.shorter_side());
        let window = frames.window_of(range.clone(), range.clone());
        let problem = PhotometricProblem::new(context, Sampling::of(level), window)?;
        let estimates = frames.estimates[range.clone()].iter();
        let poses: Vec<Pose> = estimates.map(|estimate| estimate.pose).collect();
        let points = problem.gather_from_tiles(
            MAX_SHADING_TILES,
            |points: &mut Vec<ObservedPoint>, tile| {
                let means = tile.workspace.mean_values(tile.points, tile.observations());
                let (x_w, normal) = (tile.points.centre.x_w, tile.points.centre.normal());
                let seen = tile.observers.iter().zip(means);
                let seen = seen.filter_map(|(observer, mean)| {
                    let frame = tile.participants[observer.frame as usize];
                    let camera = problem.camera_of(frame);
                    let gain = tile.sampled_frames[observer.frame as usize].gain();
                    let pixel = camera.project(&poses[frame].to_camera(&x_w))?;
                    let pixel = [pixel.x as f32, pixel.y as f32];
                    let value = (mean * f64::from(observer.shade)) as f32;
                    Observation::new(frame, pixel, value, gain)
                });
                points.push(ObservedPoint {
                    x_w,
                    normal,
                    seen: seen.collect(),
                });
            },
        )?;
        Ok(Self {
            points: points.into_iter().flatten().collect(),
            first: range.start,
            poses,
        })
    }

    /// Frames and pixels at which wall is observed.
    pub fn pixels(&self) -> Vec<(usize, Vector2<f64>)> {
        let seen = self.points.iter().flat_map(|point| &point.seen);
        seen.map(|one| (self.first + one.frame, one.pixel()))
            .collect()
    }
}
