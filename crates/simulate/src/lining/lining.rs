//! A round lining as built.
//!
//! The radius at the angle θ and the chainage h is `r + δ(θ, h)`, with δ the sum of ovality and
//! undulation, of the displacement of a shape.json, and of the steps of segments.

use crate::as_built::AsBuilt;
use crate::error::SimulateError;
use crate::lining::segments::{Segment, SegmentRings};
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

    /// Deviation from the radius, metres, as if all of the wall belonged to the given segment.
    fn deviation_in_m(&self, segment: Option<Segment>, theta: f64, h_m: f64) -> f64 {
        let smooth_m = self.undulation.deviation_m(theta, h_m);
        let shape_m = self
            .shape
            .as_ref()
            .map_or(0.0, |shape| shape.delta_m(theta * self.radius_m, h_m));
        let step_m = match (&self.segments, segment) {
            (Some(rings), Some(segment)) => rings.step_m(segment),
            _ => 0.0,
        };
        smooth_m + shape_m + step_m
    }

    /// The segment at a point of the wall, if there are any.
    pub fn segment_at(&self, point: &Vector3<f64>) -> Option<Segment> {
        let rings = self.segments.as_ref()?;
        Some(rings.segment_at(point.x.atan2(point.z), point.y))
    }

    /// Deviation δ from the radius, metres, positive outwards.
    pub fn deviation_m(&self, theta: f64, h_m: f64) -> f64 {
        let rings = self.segments.as_ref();
        self.deviation_in_m(rings.map(|rings| rings.segment_at(theta, h_m)), theta, h_m)
    }

    /// Relative distance of a point beyond the wall, as if all of the wall belonged to the given
    /// segment; negative inside.
    pub fn beyond_in(&self, segment: Option<Segment>, point: &Vector3<f64>) -> f64 {
        let theta = point.x.atan2(point.z);
        let wall_m = self.radius_m + self.deviation_in_m(segment, theta, point.y);
        point.x.hypot(point.z) / wall_m - 1.0
    }

    /// Relative distance of a point beyond the wall; negative inside.
    pub fn beyond(&self, point: &Vector3<f64>) -> f64 {
        self.beyond_in(self.segment_at(point), point)
    }
}
