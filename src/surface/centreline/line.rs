//! The line along the middle of a curved tunnel.
//!
//! Points given by the user are joined by a cubic spline of their chord lengths (C², with the ends
//! bent as the circles through the first and last three points). It is sampled in even steps of its
//! own length: the nodes. Each has a frame `Q = (E_x, T, E_z)` that turns along as little as
//! possible (the rotation-minimising frame: from node to node, T is carried over by the smallest
//! rotation). Between nodes position and size of the section are cubic Hermite polynomials, and the
//! frame `Q_k Exp(τ ω_k)` with `ω_k = Log(Q_kᵀ Q_{k+1})`, so that derivatives are exact. Beyond
//! both ends the tunnel goes on straight.
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
    /// Where it is, metres.
    pub point: Vector3<f64>,
    /// Radius of the tunnel there, metres; as elsewhere, if not given.
    pub radius_m: Option<f64>,
}

/// The centreline at a chainage.
#[derive(Clone, Copy, Debug)]
pub struct CentrelineFrame {
    /// Where it is, metres.
    pub point: Vector3<f64>,
    /// `∂point/∂h`.
    pub velocity: Vector3<f64>,
    /// From the section's frame (x, along, z) to the world.
    pub frame: UnitQuaternion<f64>,
    /// How the frame turns along the tunnel, in its own axes, radians a metre.
    pub turn: Vector3<f64>,
    /// Size of the section over its nominal one, ...
    pub scale: f64,
    /// ... and how that grows, a metre.
    pub growth: f64,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) point: Vector3<f64>,
    frame: UnitQuaternion<f64>,
    pub(super) scale: f64,
    /// How the scale grows, a metre.
    growth: f64,
}

/// Nodes whose surrounding sphere is kept, to find the nearest.
pub(super) const NODES_PER_SPHERE: usize = 64;
/// Steps between nodes over the section's size.
const NODE_STEP: f64 = 0.02;
/// A step of Newton's method after which no other is taken, over the length between nodes.
const CHAINAGE_TOLERANCE: f64 = 1e-7;
/// Nodes at the most.
const MAX_NODES: usize = 4_000_000;
/// A smooth line with frames.
#[derive(Clone, Debug)]
pub struct Centreline {
    pub(super) step_m: f64,
    pub(super) nodes: Vec<Node>,
    /// Turn from each node to the next, in the node's axes.
    pub(super) turns: Vec<Vector3<f64>>,
    /// Middle and radius of every run of nodes.
    pub(super) spheres: Vec<(Vector3<f64>, f64)>,
}

impl Centreline {
    /// The line through points, for a section that reaches `farthest_m` from it, of a nominal
    /// radius.
    ///
    /// # Errors
    /// [`SurfaceError::Centreline`]: fewer than two points, two at one place, a radius that is not
    /// positive, a bend tighter than the section, a tunnel that runs into itself.
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
                    "points {} and {} lie at one place; leave one of them out",
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

    /// Walks a spline in steps of about `step_m`.
    fn sample_spline(spline: &Spline, scales: &[f64], step_m: f64) -> Result<Self, SurfaceError> {
        let lengths = spline.lengths();
        let length_m = lengths[lengths.len() - 1];
        let steps = (length_m / step_m).ceil().max(1.0);
        if !steps.is_finite() || steps > MAX_NODES as f64 {
            return Err(SurfaceError::Centreline {
                what: format!("{length_m:.0} m are too long for a tunnel of this size"),
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
                // Exactly against the axis any turn by 180° will do.
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

    /// Its length, metres.
    pub fn length_m(&self) -> f64 {
        self.step_m * self.turns.len() as f64
    }

    /// The line at a chainage; beyond its ends it goes on straight.
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

    /// The chainage whose section's plane holds a point: of the nearest part of the line.
    pub fn chainage_m(&self, point: &Vector3<f64>) -> f64 {
        let mut nearest = (f64::INFINITY, 0usize);
        // No node of a run is nearer than its sphere.
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

    /// The chainage whose section's plane holds a point, near `h_m`: `Tᵀ(p − c) = 0` by Newton's
    /// method.
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
            // Beyond the ends the line is straight, and any step is right.
            let outside = h_m < 0.0 || h_m > self.length_m();
            let most = if outside {
                f64::INFINITY
            } else {
                4.0 * self.step_m
            };
            h_m += step.clamp(-most, most);
            // What is left is of the step's square.
            if step.abs() < CHAINAGE_TOLERANCE * self.step_m {
                break;
            }
        }
        h_m
    }
}
