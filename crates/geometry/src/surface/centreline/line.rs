//! The centreline with its rotation-minimising frames.
//!
//! The given points are interpolated by a cubic spline with chord-length parametrisation (C², with
//! end tangents of the circles through the first and last three points). It is sampled at nodes of
//! uniform arc length. Each node has a rotation-minimising frame `Q = (E_x, T, E_z)`: from node to
//! node, T is transported by the smallest rotation. Between nodes position and size of the section
//! are cubic Hermite polynomials, and the frame `Q_k Exp(τ ω_k)` with `ω_k = Log(Q_kᵀ Q_{k+1})`, so
//! that derivatives are exact. Beyond both ends the tunnel continues straight.
//!
//! Source: W. Wang, B. Jüttler, D. Zheng, Y. Liu, "Computation of rotation minimizing frames", ACM
//! TOG 27(1), 2008.

use super::spline::{Spline, hermite, monotone_slopes};
use crate::surface::error::SurfaceError;
use crate::trajectory::so3;
use nalgebra::{UnitQuaternion, Vector3};

/// A point that the centreline passes through.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CentrePoint {
    /// Position, metres.
    pub point: Vector3<f64>,
    /// Radius of the tunnel at the point, metres; the nominal radius if not given.
    pub radius_m: Option<f64>,
}

/// Position, frame and scale of the centreline at a chainage.
#[derive(Clone, Copy, Debug)]
pub struct CentrelineFrame {
    /// Position, metres.
    pub point: Vector3<f64>,
    /// `∂point/∂h`.
    pub velocity: Vector3<f64>,
    /// Rotation from the section's frame (x, along, z) to the world.
    pub frame: UnitQuaternion<f64>,
    /// Rotation rate of the frame along the tunnel, in its own axes, radians per metre.
    pub turn: Vector3<f64>,
    /// Scale of the section relative to its nominal size.
    pub scale: f64,
    /// Derivative of the scale, per metre.
    pub growth: f64,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) point: Vector3<f64>,
    frame: UnitQuaternion<f64>,
    pub(super) scale: f64,
    /// Derivative of the scale, per metre.
    growth: f64,
}

/// Nodes per bounding sphere, for the nearest-node search.
pub(super) const NODES_PER_SPHERE: usize = 64;
/// Distance between nodes relative to the section's size.
const NODE_STEP: f64 = 0.02;
/// Newton step at which the chainage has converged, relative to the distance between nodes.
const CHAINAGE_TOLERANCE: f64 = 1e-7;
/// Largest number of nodes.
const MAX_NODES: usize = 4_000_000;
/// A smooth centreline with frames.
#[derive(Clone, Debug)]
pub struct Centreline {
    pub(super) step_m: f64,
    pub(super) nodes: Vec<Node>,
    /// Rotation vector from each node to the next, in the node's axes.
    pub(super) turns: Vec<Vector3<f64>>,
    /// Centre and radius of the bounding sphere of every [`NODES_PER_SPHERE`] nodes.
    pub(super) spheres: Vec<(Vector3<f64>, f64)>,
}

impl Centreline {
    /// Creates the centreline through points, for a section with nominal radius `nominal_m` that
    /// extends to `farthest_m` from the line.
    ///
    /// # Errors
    /// [`SurfaceError::Centreline`]: fewer than two points, coincident points, a radius that is not
    /// positive, a bend tighter than the section, a tunnel that intersects itself.
    pub fn through(
        points: &[CentrePoint],
        nominal_m: f64,
        farthest_m: f64,
    ) -> Result<Self, SurfaceError> {
        let fail = |what: String| SurfaceError::Centreline { what };
        if points.len() < 2 {
            return Err(fail(match points.len() {
                0 => "no points; a line needs two or more".to_owned(),
                _ => "one point only; a line needs two or more".to_owned(),
            }));
        }
        for (k, pair) in points.windows(2).enumerate() {
            let apart_m = (pair[1].point - pair[0].point).norm();
            if !apart_m.is_finite() {
                return Err(fail(format!(
                    "points {} and {} must be finite numbers of metres",
                    k + 1,
                    k + 2
                )));
            }
            if apart_m < 1e-6 * farthest_m {
                return Err(fail(format!(
                    "points {} and {} coincide; remove one of them",
                    k + 1,
                    k + 2
                )));
            }
        }
        let scale = |k: usize| {
            points[k]
                .radius_m
                .map_or(1.0, |radius_m| radius_m / nominal_m)
        };
        if let Some(k) = (0..points.len()).find(|k| !(scale(*k).is_finite() && scale(*k) > 0.0)) {
            return Err(fail(format!(
                "the radius at point {} must be a positive number of metres",
                k + 1
            )));
        }
        let spline = Spline::through(points.iter().map(|point| point.point).collect());
        let scales: Vec<f64> = (0..points.len()).map(scale).collect();
        let line = Self::sample_spline(&spline, &scales, NODE_STEP * farthest_m)?;
        line.check_bends(farthest_m)?;
        line.check_self_intersection(farthest_m)?;
        Ok(line)
    }

    /// Samples a spline in uniform steps of about `step_m`.
    fn sample_spline(spline: &Spline, scales: &[f64], step_m: f64) -> Result<Self, SurfaceError> {
        let lengths = spline.lengths();
        let length_m = lengths[lengths.len() - 1];
        let steps = (length_m / step_m).ceil().max(1.0);
        if !steps.is_finite() || steps > MAX_NODES as f64 {
            return Err(SurfaceError::Centreline {
                what: format!("a length of {length_m:.0} m is too long for a tunnel of this size"),
            });
        }
        let step_m = length_m / steps;
        let slopes = monotone_slopes(scales, &spline.chords);
        let mut frame: Option<UnitQuaternion<f64>> = None;
        let nodes: Vec<Node> = (0..=steps as usize)
            .map(|k| {
                let (place, share) = spline.at_length(&lengths, k as f64 * step_m);
                let velocity = spline.velocity(place, share);
                let tangent = velocity.normalize();
                let chord_m = spline.chords[place];
                let (scale, rise) = hermite(
                    [scales[place], scales[place + 1]],
                    [slopes[place], slopes[place + 1]].map(|rise| rise * chord_m),
                    share,
                );
                let before = frame.unwrap_or_default();
                let carried = before * Vector3::y();
                // For an exactly opposite tangent any rotation by 180° is smallest.
                let least =
                    UnitQuaternion::rotation_between(&carried, &tangent).unwrap_or_else(|| {
                        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
                    });
                let now = least * before;
                frame = Some(now);
                Node {
                    point: spline.point(place, share),
                    frame: now,
                    scale,
                    growth: rise / chord_m / velocity.norm(),
                }
            })
            .collect();
        let turns = nodes
            .windows(2)
            .map(|pair| so3::log(&(pair[0].frame.inverse() * pair[1].frame)))
            .collect();
        let spheres = nodes
            .chunks(NODES_PER_SPHERE)
            .map(|run| {
                let middle = run[run.len() / 2].point;
                let radius = run.iter().map(|node| (node.point - middle).norm());
                (middle, radius.fold(0.0, f64::max))
            })
            .collect();
        Ok(Self {
            step_m,
            nodes,
            turns,
            spheres,
        })
    }

    /// Length of the centreline, metres.
    pub fn length_m(&self) -> f64 {
        self.step_m * self.turns.len() as f64
    }

    /// The centreline at a chainage; beyond its ends it continues straight.
    pub fn at(&self, h_m: f64) -> CentrelineFrame {
        let last = self.turns.len();
        let length_m = self.length_m();
        if h_m < 0.0 || h_m > length_m {
            let (node, from_m) = if h_m < 0.0 {
                (&self.nodes[0], 0.0)
            } else {
                (&self.nodes[last], length_m)
            };
            let along = node.frame * Vector3::y();
            return CentrelineFrame {
                point: node.point + along * (h_m - from_m),
                velocity: along,
                frame: node.frame,
                turn: Vector3::zeros(),
                scale: node.scale,
                growth: 0.0,
            };
        }
        let k = ((h_m / self.step_m) as usize).min(last - 1);
        let (a, b) = (&self.nodes[k], &self.nodes[k + 1]);
        let share = h_m / self.step_m - k as f64;
        let (point, velocity) = hermite(
            [a.point, b.point],
            [a.frame * Vector3::y(), b.frame * Vector3::y()].map(|t| t * self.step_m),
            share,
        );
        let (scale, growth) = hermite(
            [a.scale, b.scale],
            [a.growth, b.growth].map(|growth| growth * self.step_m),
            share,
        );
        CentrelineFrame {
            point,
            velocity: velocity / self.step_m,
            frame: a.frame * so3::exp(&(self.turns[k] * share)),
            turn: self.turns[k] / self.step_m,
            scale,
            growth: growth / self.step_m,
        }
    }

    /// Chainage of the section whose plane contains a point, on the nearest part of the line.
    pub fn chainage_m(&self, point: &Vector3<f64>) -> f64 {
        let mut nearest = (f64::INFINITY, 0usize);
        // No node is nearer than its bounding sphere.
        for (run, (middle, radius)) in self.spheres.iter().enumerate() {
            if (point - middle).norm() - radius >= nearest.0 {
                continue;
            }
            for k in run * NODES_PER_SPHERE..((run + 1) * NODES_PER_SPHERE).min(self.nodes.len()) {
                let distance = (point - self.nodes[k].point).norm();
                if distance < nearest.0 {
                    nearest = (distance, k);
                }
            }
        }
        self.refine_chainage_m(point, nearest.1 as f64 * self.step_m)
    }

    /// Chainage near `h_m` of the section whose plane contains a point: solves `Tᵀ(p − c) = 0` by
    /// Newton's method.
    pub fn refine_chainage_m(&self, point: &Vector3<f64>, h_m: f64) -> f64 {
        let mut h_m = h_m;
        for _ in 0..20 {
            let at = self.at(h_m);
            let along = at.frame * Vector3::y();
            let arm = point - at.point;
            let ahead = along.dot(&arm);
            let turning = at.frame * at.turn;
            let slope = along.dot(&at.velocity) - turning.cross(&along).dot(&arm);
            let step = ahead / slope.max(0.1);
            // Beyond the ends the line is straight, where Newton's step is exact.
            let outside = h_m < 0.0 || h_m > self.length_m();
            let most = if outside {
                f64::INFINITY
            } else {
                4.0 * self.step_m
            };
            h_m += step.clamp(-most, most);
            // The remaining error is of the order of the step squared.
            if step.abs() < CHAINAGE_TOLERANCE * self.step_m {
                break;
            }
        }
        h_m
    }
}
