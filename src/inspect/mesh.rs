//! Triangulation of rectangles of the unrolled wall.
//!
//! A rectangle is divided along lines of constant `s` and `h` whose spacing follows the curvature:
//! between two lines no point of the wall is farther than a tolerance from the chord. Only
//! [`Surface::frame`] is evaluated, so that all shapes and curves are treated equally. A corner of
//! the section gets lines close to it, and a straight tunnel none along its length.

use crate::surface::{Surface, WallPoint};
use nalgebra::Vector3;

/// Rectangle of the unrolled wall, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallRectangle {
    /// Range of arc length around the section.
    pub s_m: [f64; 2],
    /// Range of chainage.
    pub h_m: [f64; 2],
}

/// Grid lines of a rectangle, metres, increasing and including its borders.
#[derive(Clone, Debug, PartialEq)]
pub struct GridLines {
    /// Lines of constant `s`.
    pub s_m: Vec<f64>,
    /// Lines of constant `h`.
    pub h_m: Vec<f64>,
}

/// Positions across the rectangle, as shares, at which deviations are evaluated.
const CROSS_SHARES: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
/// Positions along a chord, as shares, at which the wall is compared with it.
const CHORD_SHARES: [f64; 3] = [0.25, 0.5, 0.75];
/// Maximum halvings of a rectangle; far fewer are needed for realistic curvatures.
const MAX_HALVINGS: u32 = 16;

impl GridLines {
    /// Grid lines between which the wall is straight within `tolerance_m`.
    ///
    /// Their spacing does not fall below half of `finest_m`.
    pub fn cut(
        surface: &dyn Surface,
        rectangle: &WallRectangle,
        tolerance_m: f64,
        finest_m: f64,
    ) -> Self {
        let point = |s_m, h_m| surface.frame(WallPoint { s_m, h_m }).x_w;
        let at = |[from, to]: [f64; 2], share: f64| from + share * (to - from);
        let limits = (tolerance_m, finest_m);
        Self {
            s_m: bisect(rectangle.s_m, limits, &|s_m| {
                CROSS_SHARES.map(|share| point(s_m, at(rectangle.h_m, share)))
            }),
            h_m: bisect(rectangle.h_m, limits, &|h_m| {
                CROSS_SHARES.map(|share| point(at(rectangle.s_m, share), h_m))
            }),
        }
    }
}

/// Wall points on a line across the rectangle.
type CrossLine = [Vector3<f64>; CROSS_SHARES.len()];

/// Bisects the range until the wall is straight between neighbouring values.
fn bisect(
    range: [f64; 2],
    (tolerance_m, finest_m): (f64, f64),
    across: &dyn Fn(f64) -> CrossLine,
) -> Vec<f64> {
    let [from, to] = range;
    let mut lines = vec![from];
    // Stack of ranges to be examined.
    let mut open = vec![(from, to, 0)];
    while let Some((from, to, halvings)) = open.pop() {
        let (ends, length_m) = ([across(from), across(to)], to - from);
        let straight = || {
            CHORD_SHARES.iter().all(|share| {
                let wall = across(from + share * length_m);
                let chord = |k: usize| ends[0][k].lerp(&ends[1][k], *share);
                (0..wall.len()).all(|k| (wall[k] - chord(k)).norm() <= tolerance_m)
            })
        };
        if halvings == MAX_HALVINGS || length_m <= finest_m || straight() {
            lines.push(to);
        } else {
            let middle = 0.5 * (from + to);
            open.push((middle, to, halvings + 1));
            open.push((from, middle, halvings + 1));
        }
    }
    lines
}

/// Triangle mesh of a rectangle of the wall.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// Origin of the positions in the world, whole metres, which is exact in single precision.
    pub origin_m: Vector3<f64>,
    /// World positions relative to the origin, metres, row by row; `s` varies fastest.
    pub positions_m: Vec<Vector3<f32>>,
    /// Arc length and chainage of the positions, metres.
    pub wall: Vec<WallPoint>,
    /// Vertex indices of the triangles, counter-clockwise as seen from inside.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The mesh with vertices at the intersections of `lines`.
    pub fn new(surface: &dyn Surface, lines: &GridLines) -> Self {
        let mut points = Vec::new();
        surface.lattice(&lines.s_m, &lines.h_m, &mut points);
        let [low, high] = bounds(&points);
        let origin_m = ((low + high) * 0.5).map(f64::round);
        let (columns, rows) = (lines.s_m.len() as u32, lines.h_m.len() as u32);
        let wall = lines
            .h_m
            .iter()
            .flat_map(|&h_m| lines.s_m.iter().map(move |&s_m| WallPoint { s_m, h_m }));
        let cells = (1..rows).flat_map(|row| (1..columns).map(move |column| (row, column)));
        let triangles = cells.flat_map(|(row, column)| {
            let [upper, lower] = [(row - 1) * columns + column, row * columns + column];
            [[upper - 1, lower - 1, lower], [upper - 1, lower, upper]]
        });
        Self {
            origin_m,
            positions_m: points.iter().map(|x_w| (x_w - origin_m).cast()).collect(),
            wall: wall.collect(),
            triangles: triangles.collect(),
        }
    }

    /// Axis-aligned bounding box in the world, metres: minimum and maximum.
    pub fn bounds_m(&self) -> [Vector3<f64>; 2] {
        let points: Vec<_> = self.positions_m.iter().map(|x| x.cast()).collect();
        bounds(&points).map(|corner| corner + self.origin_m)
    }
}

/// Axis-aligned bounding box of points: minimum and maximum.
fn bounds(points: &[Vector3<f64>]) -> [Vector3<f64>; 2] {
    let start = [f64::INFINITY, f64::NEG_INFINITY].map(Vector3::repeat);
    points
        .iter()
        .fold(start, |[low, high], x| [low.inf(x), high.sup(x)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::section::PiecewiseOutline;
    use crate::surface::{CentrePoint, Centreline, Circle, Prism, Swept};
    use std::f64::consts::TAU;

    const RECTANGLE: WallRectangle = WallRectangle {
        s_m: [0.0, 3.0 * TAU],
        h_m: [9_990.0, 10_050.0],
    };

    #[test]
    fn a_straight_tunnel_is_cut_along_its_length_only() {
        let circle = Circle::new(3.0).unwrap();
        let lines = GridLines::cut(&circle, &RECTANGLE, 1e-3, 0.0);
        assert_eq!(lines.h_m, RECTANGLE.h_m);
        // The sagitta of a chord over Δs is Δs²/8r; bisection makes chords at most twice as fine as
        // needed.
        let widest = lines.s_m.windows(2).map(|pair| pair[1] - pair[0]);
        let widest = widest.fold(0.0, f64::max);
        let sagitta = widest * widest / (8.0 * 3.0);
        assert!((0.2e-3..=1e-3).contains(&sagitta), "{sagitta}");
        assert!(lines.s_m.is_sorted_by(|a, b| a < b));
    }

    #[test]
    fn triangles_lie_on_the_wall_and_face_inwards() {
        let circle = Circle::new(3.0).unwrap();
        let mesh = Mesh::new(&circle, &GridLines::cut(&circle, &RECTANGLE, 1e-3, 0.0));
        assert_eq!(mesh.origin_m, Vector3::new(0.0, 10_020.0, 0.0));
        for (x, wall) in mesh.positions_m.iter().zip(&mesh.wall) {
            let x_w = x.cast::<f64>() + mesh.origin_m;
            assert!((x_w - circle.frame(*wall).x_w).norm() < 3e-6);
        }
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|k| mesh.positions_m[k as usize].cast::<f64>());
            let normal = (b - a).cross(&(c - a));
            let outwards = (a + b + c) / 3.0 + mesh.origin_m;
            assert!(normal.dot(&Vector3::new(outwards.x, 0.0, outwards.z)) < 0.0);
        }
        let [low, high] = mesh.bounds_m();
        assert!((low.y, high.y) == (9_990.0, 10_050.0) && high.x > 2.99);
    }

    /// The triangles of a box and of a bent box lie on the wall and face inwards.
    #[test]
    fn corners_and_bends_are_followed() {
        let section = || Box::new(PiecewiseOutline::rectangle(4.0, 3.0).unwrap());
        let points: Vec<CentrePoint> = (0..=40)
            .map(|k| {
                let (sin, cos) = (0.2 * TAU * f64::from(k) / 40.0).sin_cos();
                CentrePoint {
                    point: Vector3::new(60.0 - 60.0 * cos, 60.0 * sin, 0.0),
                    radius_m: None,
                }
            })
            .collect();
        let line = Centreline::through(&points, 2.5, 2.5).unwrap();
        let (straight, bent) = (Prism::new(section()), Swept::new(section(), line));
        let surfaces: [(&dyn Surface, usize); 2] = [(&straight, 2), (&bent, 20)];
        for (surface, rows) in surfaces {
            let rectangle = WallRectangle {
                s_m: [0.0, surface.perimeter_m()],
                h_m: [5.0, 45.0],
            };
            let tolerance_m = 5e-3;
            let lines = GridLines::cut(surface, &rectangle, tolerance_m, tolerance_m);
            assert!(lines.h_m.len() >= rows && lines.s_m.len() < 80, "{lines:?}");
            let mesh = Mesh::new(surface, &lines);
            for triangle in &mesh.triangles {
                let [a, b, c] = triangle.map(|k| mesh.positions_m[k as usize].cast::<f64>());
                let walls = triangle.map(|k| mesh.wall[k as usize]);
                let mean = |f: fn(&WallPoint) -> f64| walls.iter().map(f).sum::<f64>() / 3.0;
                let frame = surface.frame(WallPoint {
                    s_m: mean(|wall| wall.s_m),
                    h_m: mean(|wall| wall.h_m),
                });
                let middle = (a + b + c) / 3.0 + mesh.origin_m;
                assert!((middle - frame.x_w).norm() < 3.0 * tolerance_m);
                let inwards = frame.e_h.cross(&frame.e_s);
                assert!((b - a).cross(&(c - a)).dot(&inwards) > 0.0);
            }
        }
    }

    #[test]
    fn the_finest_step_ends_it() {
        let circle = Circle::new(3.0).unwrap();
        let lines = GridLines::cut(&circle, &RECTANGLE, 0.0, 1.0);
        assert!(lines.s_m.len() < 64 && lines.h_m.len() <= 65);
    }
}
