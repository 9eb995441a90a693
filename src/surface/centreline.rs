//! The line along the middle of a curved tunnel.
//!
//! Points given by the user are joined by a cubic spline of their chord lengths (C², with the ends
//! bent as the circles through the first and last three points). It is walked in even steps of its
//! own length: the nodes. Each has a frame `Q = (E_x, T, E_z)` that turns along as little as
//! possible (the rotation-minimising frame: from node to node, T is carried over by the smallest
//! rotation). Between nodes position and size of the section are cubic Hermite polynomials, and the
//! frame `Q_k Exp(τ ω_k)` with `ω_k = Log(Q_kᵀ Q_{k+1})`, so that derivatives are exact. Beyond
//! both ends the tunnel goes on straight.
//!
//! Source: W. Wang, B. Jüttler, D. Zheng, Y. Liu, "Computation of rotation minimizing frames", ACM
//! TOG 27(1), 2008.

use super::SurfaceError;
use crate::trajectory::so3;
use nalgebra::{UnitQuaternion, Vector3};
use std::ops::{Add, Mul, Sub};

mod room;

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
pub struct Station {
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
struct Node {
    point: Vector3<f64>,
    frame: UnitQuaternion<f64>,
    scale: f64,
    /// How the scale grows, a metre.
    growth: f64,
}

/// Nodes whose surrounding sphere is kept, to find the nearest.
const RUN: usize = 64;
/// Steps between nodes over the section's size.
const STEP: f64 = 0.02;
/// A step of Newton's method after which no other is taken, over the length between nodes.
const SETTLED: f64 = 1e-7;
/// Nodes at the most.
const MOST_NODES: usize = 4_000_000;
/// Pieces of the spline's parameter between two given points, to measure its length.
const FINE: usize = 64;

/// A smooth line with frames.
#[derive(Clone, Debug)]
pub struct Centreline {
    step_m: f64,
    nodes: Vec<Node>,
    /// Turn from each node to the next, in the node's axes.
    turns: Vec<Vector3<f64>>,
    /// Middle and radius of every run of nodes.
    spheres: Vec<(Vector3<f64>, f64)>,
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
        let line = Self::walked(&spline, &scales, STEP * farthest_m)?;
        line.check_bends(farthest_m)?;
        line.check_apart(farthest_m)?;
        Ok(line)
    }

    /// Walks a spline in steps of about `step_m`.
    fn walked(spline: &Spline, scales: &[f64], step_m: f64) -> Result<Self, SurfaceError> {
        let lengths = spline.lengths();
        let length_m = lengths[lengths.len() - 1];
        let steps = (length_m / step_m).ceil().max(1.0);
        if !steps.is_finite() || steps > MOST_NODES as f64 {
            return Err(SurfaceError::Centreline {
                what: format!("{length_m:.0} m are too long for a tunnel of this size"),
            });
        }
        let step_m = length_m / steps;
        let rises = rises(scales, &spline.chords);
        let mut frame: Option<UnitQuaternion<f64>> = None;
        let nodes: Vec<Node> = (0..=steps as usize)
            .map(|k| {
                let (place, share) = spline.at_length(&lengths, k as f64 * step_m);
                let velocity = spline.velocity(place, share);
                let tangent = velocity.normalize();
                let chord_m = spline.chords[place];
                let (scale, rise) = hermite(
                    [scales[place], scales[place + 1]],
                    [rises[place], rises[place + 1]].map(|rise| rise * chord_m),
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
            .chunks(RUN)
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
    pub fn at(&self, h_m: f64) -> Station {
        let last = self.turns.len();
        let length_m = self.length_m();
        if h_m < 0.0 || h_m > length_m {
            let (node, from_m) = if h_m < 0.0 {
                (&self.nodes[0], 0.0)
            } else {
                (&self.nodes[last], length_m)
            };
            let along = node.frame * Vector3::y();
            return Station {
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
        Station {
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
            for k in run * RUN..((run + 1) * RUN).min(self.nodes.len()) {
                let distance = (point - self.nodes[k].point).norm();
                if distance < nearest.0 {
                    nearest = (distance, k);
                }
            }
        }
        self.refined(point, nearest.1 as f64 * self.step_m)
    }

    /// The chainage whose section's plane holds a point, near `h_m`: `Tᵀ(p − c) = 0` by Newton's
    /// method.
    pub fn refined(&self, point: &Vector3<f64>, h_m: f64) -> f64 {
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
            if step.abs() < SETTLED * self.step_m {
                break;
            }
        }
        h_m
    }
}

/// Slopes of the section's scale at the given points over the chords, so that the cubics between
/// them are smooth and monotone: none overshoots the radii given. There is none at the ends, beyond
/// which the scale stays.
///
/// Of neighbouring slopes of one sign it is the weighted harmonic mean, else 0.
///
/// Source: F. N. Fritsch, J. Butland, "A method for constructing local monotone piecewise cubic
/// interpolants", SIAM J. Sci. Stat. Comput. 5(2), 1984.
fn rises(scales: &[f64], chords: &[f64]) -> Vec<f64> {
    let slope = |k: usize| (scales[k + 1] - scales[k]) / chords[k];
    let mut rises = vec![0.0; scales.len()];
    for k in 1..chords.len() {
        let (before, after) = (slope(k - 1), slope(k));
        if before * after > 0.0 {
            let (a, b) = (chords[k - 1], chords[k]);
            let (a, b) = (a + 2.0 * b, 2.0 * a + b);
            rises[k] = (a + b) / (a / before + b / after);
        }
    }
    rises
}

/// Value and derivative of the cubic with the given ends and end slopes.
fn hermite<T>(p: [T; 2], m: [T; 2], t: f64) -> (T, T)
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T>,
{
    let (t2, t3) = (t * t, t * t * t);
    let rise = t2 * (3.0 - 2.0 * t);
    let point = p[0] + (p[1] - p[0]) * rise + m[0] * (t3 - 2.0 * t2 + t) + m[1] * (t3 - t2);
    let slope = (p[1] - p[0]) * (6.0 * t - 6.0 * t2)
        + m[0] * (3.0 * t2 - 4.0 * t + 1.0)
        + m[1] * (3.0 * t2 - 2.0 * t);
    (point, slope)
}

/// A cubic spline through points, parametrised by the lengths of the chords.
struct Spline {
    points: Vec<Vector3<f64>>,
    chords: Vec<f64>,
    /// Derivatives at the points.
    slopes: Vec<Vector3<f64>>,
}

impl Spline {
    /// C²: `m_{k−1}/c_{k−1} + 2 (1/c_{k−1} + 1/c_k) m_k + m_{k+1}/c_k = 3 (Δ_{k−1}/c_{k−1}² +
    /// Δ_k/c_k²)`, a tridiagonal system; the slopes at the ends are those of the circles through
    /// three points.
    fn through(points: Vec<Vector3<f64>>) -> Self {
        let n = points.len();
        let chords: Vec<f64> = points.windows(2).map(|p| (p[1] - p[0]).norm()).collect();
        let mut slopes = vec![Vector3::zeros(); n];
        if n == 2 {
            slopes.fill((points[1] - points[0]) / chords[0]);
            return Self {
                points,
                chords,
                slopes,
            };
        }
        slopes[0] = end_slope([points[0], points[1], points[2]]);
        slopes[n - 1] = -end_slope([points[n - 1], points[n - 2], points[n - 3]]);
        // Thomas' algorithm.
        let (mut upper, mut right) = (vec![0.0; n], slopes.clone());
        for k in 1..n - 1 {
            let (before, after) = (1.0 / chords[k - 1], 1.0 / chords[k]);
            let mut rhs = ((points[k] - points[k - 1]) * before * before
                + (points[k + 1] - points[k]) * after * after)
                * 3.0;
            let mut diagonal = 2.0 * (before + after);
            rhs -= right[k - 1] * before;
            diagonal -= upper[k - 1] * before;
            upper[k] = after / diagonal;
            right[k] = rhs / diagonal;
        }
        for k in (1..n - 1).rev() {
            slopes[k] = right[k] - slopes[k + 1] * upper[k];
        }
        Self {
            points,
            chords,
            slopes,
        }
    }

    fn ends(&self, place: usize, share: f64) -> (Vector3<f64>, Vector3<f64>) {
        let chord = self.chords[place];
        let (point, slope) = hermite(
            [self.points[place], self.points[place + 1]],
            [self.slopes[place] * chord, self.slopes[place + 1] * chord],
            share,
        );
        (point, slope / chord)
    }

    fn point(&self, place: usize, share: f64) -> Vector3<f64> {
        self.ends(place, share).0
    }

    fn velocity(&self, place: usize, share: f64) -> Vector3<f64> {
        self.ends(place, share).1
    }

    /// Length of the line up to each of [`FINE`] steps between each two points (Simpson's rule).
    fn lengths(&self) -> Vec<f64> {
        let mut lengths = vec![0.0];
        let mut length = 0.0;
        for (place, chord) in self.chords.iter().enumerate() {
            for k in 0..FINE {
                let speed = |x: f64| self.velocity(place, (k as f64 + x) / FINE as f64).norm();
                length += (speed(0.0) + 4.0 * speed(0.5) + speed(1.0)) / 6.0 * chord / FINE as f64;
                lengths.push(length);
            }
        }
        lengths
    }

    /// The piece and the share of it at a length.
    fn at_length(&self, lengths: &[f64], length_m: f64) -> (usize, f64) {
        let k = lengths.partition_point(|length| *length <= length_m);
        let k = k.clamp(1, lengths.len() - 1) - 1;
        let within = (length_m - lengths[k]) / (lengths[k + 1] - lengths[k]);
        let fine = k as f64 + within.clamp(0.0, 1.0);
        let place = (k / FINE).min(self.chords.len() - 1);
        (place, fine / FINE as f64 - place as f64)
    }
}

/// The direction at the first of three points of the circle through them; of the line, if they lie
/// on one.
///
/// The angle between chord and tangent is that which the chord subtends at the third point.
fn end_slope(p: [Vector3<f64>; 3]) -> Vector3<f64> {
    let (first, second) = (p[1] - p[0], p[2] - p[1]);
    let normal = first.cross(&second);
    let Some(normal) = normal.try_normalize(1e-9 * first.norm() * second.norm()) else {
        return first.normalize();
    };
    let angle = (p[0] - p[2]).angle(&(p[1] - p[2]));
    let turn = UnitQuaternion::from_scaled_axis(-normal * angle);
    turn * first.normalize()
}
