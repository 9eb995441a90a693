//! A round lining as built.
//!
//! The radius at the angle θ and the chainage h is `r + δ(θ, h)`, with δ the sum of ovality and
//! undulation, of the displacement of a shape.json, and of the steps of segments.

use crate::as_built::AsBuilt;
use crate::error::SimulateError;
use crate::lining::segments::SegmentRings;
use crate::lining::shape_spline::ShapeSpline;
use crate::lining::undulation::Undulation;
use crate::procedural_noise::RandomStream;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// A round lining that deviates from its radius.
#[derive(Clone, Debug)]
pub(crate) struct Lining {
    /// r, metres.
    pub radius_m: f64,
    undulation: Undulation,
    shape: Option<ShapeSpline>,
    /// Rings of segments, if it is built of them.
    pub segments: Option<SegmentRings>,
}

impl Lining {
    /// The lining of a tunnel of the given radius.
    ///
    /// # Errors
    /// [`SimulateError::ShapeFile`] for a shape.json that cannot be used.
    pub fn new(radius_m: f64, as_built: &AsBuilt, seed: u64) -> Result<Self, SimulateError> {
        let shape = match &as_built.shape_file {
            Some(path) => Some(ShapeSpline::read(path, TAU * radius_m)?),
            None => None,
        };
        Ok(Self {
            radius_m,
            undulation: Undulation::new(radius_m, as_built, RandomStream::Lining.seed(seed)),
            shape,
            segments: as_built
                .segments
                .map(|segments| SegmentRings::new(segments, RandomStream::Segments.seed(seed))),
        })
    }

    /// Deviation from the radius without the steps of segments, metres.
    fn smooth_deviation_m(&self, theta: f64, h_m: f64) -> f64 {
        let s_m = theta * self.radius_m;
        let shape_m = self
            .shape
            .as_ref()
            .map_or(0.0, |shape| shape.delta_m(s_m, h_m));
        self.undulation.deviation_m(theta, h_m) + shape_m
    }

    /// Step of the segment at a point of the wall, metres; 0 without segments.
    pub fn step_m(&self, theta: f64, h_m: f64) -> f64 {
        self.segments
            .as_ref()
            .map_or(0.0, |rings| rings.step_m(rings.segment_at(theta, h_m)))
    }

    /// Deviation δ from the radius, metres, positive outwards.
    pub fn deviation_m(&self, theta: f64, h_m: f64) -> f64 {
        self.smooth_deviation_m(theta, h_m) + self.step_m(theta, h_m)
    }

    /// Relative distance of a point beyond the wall; negative inside.
    pub fn beyond(&self, point: &Vector3<f64>) -> f64 {
        self.beyond_with_step(self.step_m(point.x.atan2(point.z), point.y), point)
    }

    /// Relative distance of a point beyond the wall, as if all segments had the given step, metres;
    /// negative inside.
    pub fn beyond_with_step(&self, step_m: f64, point: &Vector3<f64>) -> f64 {
        let deviation_m = self.smooth_deviation_m(point.x.atan2(point.z), point.y) + step_m;
        point.x.hypot(point.z) / (self.radius_m + deviation_m) - 1.0
    }
}
