//! Outlines of line segments and arcs: boxes and horseshoes.

use super::outline::{OutlineHit, OutlinePoint, Section, forward_root};
use crate::surface::error::{SurfaceError, check_size};
use nalgebra::Vector2;
use std::f64::consts::{FRAC_PI_2, TAU};

/// A segment of an outline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OutlinePiece {
    /// A line segment.
    Line {
        /// Start, metres.
        from: Vector2<f64>,
        /// End, metres.
        to: Vector2<f64>,
    },
    /// An arc around a centre, clockwise as seen with z up and x to the right.
    Arc {
        /// The centre, metres.
        centre: Vector2<f64>,
        /// The radius, metres.
        radius_m: f64,
        /// Start: the angle from z towards x, radians.
        from_rad: f64,
        /// Angle of the arc, radians.
        turn_rad: f64,
    },
}

impl OutlinePiece {
    fn length_m(&self) -> f64 {
        match self {
            Self::Line { from, to } => (to - from).norm(),
            Self::Arc {
                radius_m, turn_rad, ..
            } => radius_m * turn_rad,
        }
    }

    /// The point at `s_m` from the start.
    fn at(&self, s_m: f64) -> OutlinePoint {
        match *self {
            Self::Line { from, to } => {
                let tangent = (to - from).normalize();
                OutlinePoint {
                    point: from + tangent * s_m,
                    tangent,
                }
            }
            Self::Arc {
                centre,
                radius_m,
                from_rad,
                ..
            } => {
                let (sin, cos) = (from_rad + s_m / radius_m).sin_cos();
                OutlinePoint {
                    point: centre + Vector2::new(sin, cos) * radius_m,
                    tangent: Vector2::new(cos, -sin),
                }
            }
        }
    }

    /// Intersects a ray with the full line or circle of the segment: range, and distance from the
    /// start in metres; None if the ray points away.
    fn meet(&self, from: &Vector2<f64>, d: &Vector2<f64>) -> Option<(f64, f64)> {
        match *self {
            Self::Line { from: start, to } => {
                let along = (to - start).normalize();
                let outward = Vector2::new(-along.y, along.x);
                let speed = d.dot(&outward);
                if speed <= 0.0 {
                    return None;
                }
                let range = (start - from).dot(&outward) / speed;
                Some((range, (from + d * range - start).dot(&along)))
            }
            Self::Arc {
                centre,
                radius_m,
                from_rad,
                turn_rad,
            } => {
                let arm = from - centre;
                let c = arm.norm_squared() - radius_m * radius_m;
                let range = forward_root(d.norm_squared(), d.dot(&arm), c);
                let point = arm + d * range;
                // Relative to the middle of the arc, which is less than a full circle.
                let middle = from_rad + 0.5 * turn_rad;
                let angle = point.x.atan2(point.y) - middle;
                let angle = angle - TAU * (angle / TAU).round();
                Some((range, radius_m * (angle + 0.5 * turn_rad)))
            }
        }
    }
}

/// A closed sequence of segments.
#[derive(Clone, Debug, PartialEq)]
pub struct PiecewiseOutline {
    pieces: Vec<OutlinePiece>,
    /// Arc length at the start of each segment and at the end of the last, metres.
    starts_m: Vec<f64>,
    farthest_m: f64,
}

impl PiecewiseOutline {
    fn new(pieces: Vec<OutlinePiece>) -> Self {
        let mut starts_m = vec![0.0];
        let mut end_m = 0.0;
        for piece in &pieces {
            end_m += piece.length_m();
            starts_m.push(end_m);
        }
        let ends = pieces.iter().map(|piece| match piece {
            OutlinePiece::Line { from, to } => from.norm().max(to.norm()),
            OutlinePiece::Arc {
                centre, radius_m, ..
            } => centre.norm() + radius_m,
        });
        Self {
            farthest_m: ends.fold(0.0, f64::max),
            pieces,
            starts_m,
        }
    }

    /// Creates a box with the axis in its centre; sizes in metres.
    ///
    /// # Errors
    /// [`SurfaceError::Size`] unless both are positive and finite.
    pub fn rectangle(width_m: f64, height_m: f64) -> Result<Self, SurfaceError> {
        check_size("width_m", width_m)?;
        check_size("height_m", height_m)?;
        let (x, z) = (0.5 * width_m, 0.5 * height_m);
        let corners = [(0.0, z), (x, z), (x, -z), (-x, -z), (-x, z), (0.0, z)];
        let corners = corners.map(|(x, z)| Vector2::new(x, z));
        let lines = corners.windows(2).map(|ends| OutlinePiece::Line {
            from: ends[0],
            to: ends[1],
        });
        Ok(Self::new(lines.collect()))
    }

    /// Creates a horseshoe: a semicircular arch on straight walls and a flat floor, with the axis
    /// in the centre of the arch; sizes in metres.
    ///
    /// # Errors
    /// [`SurfaceError::Size`] unless both are positive and finite, [`SurfaceError::NoWalls`] unless
    /// it is higher than half its width.
    pub fn horseshoe(width_m: f64, height_m: f64) -> Result<Self, SurfaceError> {
        check_size("width_m", width_m)?;
        check_size("height_m", height_m)?;
        let r = 0.5 * width_m;
        let floor = r - height_m;
        if floor >= 0.0 {
            return Err(SurfaceError::NoWalls { width_m, height_m });
        }
        let line = |from: (f64, f64), to: (f64, f64)| OutlinePiece::Line {
            from: Vector2::new(from.0, from.1),
            to: Vector2::new(to.0, to.1),
        };
        let arc = |from_rad: f64| OutlinePiece::Arc {
            centre: Vector2::zeros(),
            radius_m: r,
            from_rad,
            turn_rad: FRAC_PI_2,
        };
        Ok(Self::new(vec![
            arc(0.0),
            line((r, 0.0), (r, floor)),
            line((r, floor), (-r, floor)),
            line((-r, floor), (-r, 0.0)),
            arc(3.0 * FRAC_PI_2),
        ]))
    }

    /// The segments.
    pub fn pieces(&self) -> &[OutlinePiece] {
        &self.pieces
    }
}

impl Section for PiecewiseOutline {
    fn perimeter_m(&self) -> f64 {
        self.starts_m[self.pieces.len()]
    }

    fn at(&self, s_m: f64) -> OutlinePoint {
        let s_m = s_m.rem_euclid(self.perimeter_m());
        let inner = &self.starts_m[1..self.pieces.len()];
        let k = inner.partition_point(|start| *start <= s_m);
        self.pieces[k].at(s_m - self.starts_m[k])
    }

    /// The nearest intersection within the ends of a segment, to rounding; the outline is convex.
    fn hit(&self, from: &Vector2<f64>, d: &Vector2<f64>) -> OutlineHit {
        let slack = 1e-9 * self.perimeter_m();
        let mut best = OutlineHit {
            range: f64::INFINITY,
            s_m: 0.0,
        };
        for (piece, start_m) in self.pieces.iter().zip(&self.starts_m) {
            let length_m = piece.length_m();
            if let Some((range, behind_m)) = piece.meet(from, d)
                && (-slack..=length_m + slack).contains(&behind_m)
                && range >= 0.0
                && range < best.range
            {
                best = OutlineHit {
                    range,
                    s_m: start_m + behind_m.clamp(0.0, length_m),
                };
            }
        }
        best
    }

    fn contains(&self, point: &Vector2<f64>) -> bool {
        let distance = point.norm();
        let d = point.try_normalize(0.0).unwrap_or(Vector2::x());
        self.hit(&Vector2::zeros(), &d).range > distance
    }

    fn farthest_m(&self) -> f64 {
        self.farthest_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_those_asked_for() {
        let section = PiecewiseOutline::rectangle(4.0, 3.0).unwrap();
        assert!((section.perimeter_m() - 14.0).abs() < 1e-12);
        assert!((section.distance_m(&Vector2::x()) - 2.0).abs() < 1e-12);
        assert!((section.distance_m(&-Vector2::y()) - 1.5).abs() < 1e-12);
        assert!((section.farthest_m() - 2.5).abs() < 1e-12);
        let section = PiecewiseOutline::horseshoe(4.0, 3.5).unwrap();
        let expected = 2.0 * std::f64::consts::PI + 3.0 + 4.0;
        assert!((section.perimeter_m() - expected).abs() < 1e-12);
        assert!((section.distance_m(&Vector2::y()) - 2.0).abs() < 1e-12);
        assert!((section.distance_m(&-Vector2::y()) - 1.5).abs() < 1e-12);
    }

    #[test]
    fn impossible_sizes_are_refused() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(
                PiecewiseOutline::rectangle(bad, 1.0).is_err()
                    && PiecewiseOutline::rectangle(1.0, bad).is_err()
            );
            assert!(
                PiecewiseOutline::horseshoe(bad, 1.0).is_err()
                    && PiecewiseOutline::horseshoe(1.0, bad).is_err()
            );
        }
        let flat = PiecewiseOutline::horseshoe(4.0, 2.0).unwrap_err();
        assert!(matches!(flat, SurfaceError::NoWalls { .. }));
    }
}
