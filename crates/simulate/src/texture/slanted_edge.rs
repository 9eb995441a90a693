//! Slanted-edge texture: a test target for sharpness.

use crate::texture::wall_texture::WallTexture;
use tunnelstitch_geometry::surface::{WallPoint, shortest_arc};

/// Nominal distance between squares, metres; adjusted to the perimeter along s.
const PITCH_M: f64 = 0.6;
/// Side of a square, metres.
const SIDE_M: f64 = 0.36;
/// Rotation of the squares, degrees.
const SLANT_DEG: f64 = 5.0;
/// Grey level between squares.
const BACKGROUND: f32 = 128.0;
/// Grey levels of alternating squares.
const TONES: [f32; 2] = [72.0, 184.0];

/// Alternating dark and bright squares, each rotated by 5°, with the slanted edges by which ISO
/// 12233 measures sharpness.
pub(super) struct SlantedEdgeWall {
    /// Distance between squares along s, metres.
    pitch_s_m: f64,
}

impl SlantedEdgeWall {
    /// A wall of the given perimeter (metres).
    pub fn new(perimeter_m: f64) -> Self {
        Self {
            pitch_s_m: perimeter_m / squares_around(perimeter_m),
        }
    }

    /// Grey level of a square.
    fn tone(column: i64, row: i64) -> f32 {
        TONES[(column + row).rem_euclid(2) as usize]
    }
}

/// Number of squares around the section.
fn squares_around(perimeter_m: f64) -> f64 {
    (perimeter_m / PITCH_M).round().max(1.0)
}

impl WallTexture for SlantedEdgeWall {
    /// Fills a row, with each texel's coverage computed as if it were aligned with the square.
    ///
    /// The error is a few thousandths of the step between the grey levels.
    fn fill_row(&self, h_m: f64, texel_m: f64, row: &mut [f32]) {
        let (sin, cos) = SLANT_DEG.to_radians().sin_cos();
        let down = (h_m / PITCH_M).floor();
        let h = h_m - (down + 0.5) * PITCH_M;
        let inside = |x: f64| {
            let share = (0.5 * SIDE_M - x.abs()) / texel_m + 0.5;
            share.clamp(0.0, 1.0) as f32
        };
        for (k, value) in row.iter_mut().enumerate() {
            let s_m = (k as f64 + 0.5) * texel_m;
            let across = (s_m / self.pitch_s_m).floor();
            let s = s_m - (across + 0.5) * self.pitch_s_m;
            let share = inside(cos * s + sin * h) * inside(cos * h - sin * s);
            *value = BACKGROUND + share * (Self::tone(across as i64, down as i64) - BACKGROUND);
        }
    }
}

/// Straight edge between two grey levels of [`Wall::Target`](crate::Wall::Target).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlantedEdge {
    /// Midpoint of the edge.
    pub middle: WallPoint,
    /// Unit normal along (s, h), pointing out of the square.
    pub normal: [f64; 2],
    /// Half extents along and across the edge, metres, of the area that shows no other edge.
    pub clear_m: [f64; 2],
}

impl SlantedEdge {
    /// Lists the edges of all squares whose centres lie between two chainages, metres.
    ///
    /// The order of a square's edges is right, lower, left, upper.
    pub fn all(perimeter_m: f64, h_m: [f64; 2]) -> Vec<Self> {
        let around = squares_around(perimeter_m);
        let (sin, cos) = SLANT_DEG.to_radians().sin_cos();
        let [first, end] = [h_m[0], h_m[1]].map(|h_m| (h_m / PITCH_M - 0.5).ceil() as i64);
        let mut edges = Vec::new();
        for row in first..end {
            for column in 0..around as i64 {
                let middle = WallPoint {
                    s_m: (column as f64 + 0.5) * perimeter_m / around,
                    h_m: (row as f64 + 0.5) * PITCH_M,
                };
                let normals = [[cos, sin], [-sin, cos], [-cos, -sin], [sin, -cos]];
                edges.extend(normals.map(|normal| Self {
                    middle: WallPoint {
                        s_m: middle.s_m + 0.5 * SIDE_M * normal[0],
                        h_m: middle.h_m + 0.5 * SIDE_M * normal[1],
                    },
                    normal,
                    clear_m: [0.3 * SIDE_M, 0.25 * SIDE_M],
                }));
            }
        }
        edges
    }

    /// Signed distance of a wall point from the edge, metres, positive outside of the square.
    ///
    /// `None` outside of the area that shows no other edge.
    pub fn distance_m(&self, wall: &WallPoint, perimeter_m: f64) -> Option<f64> {
        let s = shortest_arc(wall.s_m - self.middle.s_m, perimeter_m);
        let h = wall.h_m - self.middle.h_m;
        let across = s * self.normal[0] + h * self.normal[1];
        let along = h * self.normal[0] - s * self.normal[1];
        (along.abs() <= self.clear_m[0] && across.abs() <= self.clear_m[1]).then_some(across)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn edges_lie_where_the_wall_has_them_and_are_isolated() {
        let perimeter_m = TAU * 3.0;
        let wall = SlantedEdgeWall::new(perimeter_m);
        let edges = SlantedEdge::all(perimeter_m, [0.0, 1.2]);
        assert_eq!(edges.len(), 31 * 2 * 4);
        let mut row = vec![0.0; 9000];
        let texel_m = perimeter_m / 9000.0;
        for edge in edges.iter().step_by(7) {
            let mut seen = 0;
            for line in -60..60 {
                let h_m = edge.middle.h_m + f64::from(line) * texel_m;
                wall.fill_row(h_m, texel_m, &mut row);
                for (k, value) in row.iter().enumerate() {
                    let point = WallPoint {
                        s_m: (k as f64 + 0.5) * texel_m,
                        h_m,
                    };
                    let Some(distance_m) = edge.distance_m(&point, perimeter_m) else {
                        continue;
                    };
                    if distance_m.abs() > 1.2 * texel_m {
                        assert_eq!(*value == BACKGROUND, distance_m > 0.0, "{edge:?} {point:?}");
                        seen += 1;
                    }
                }
            }
            assert!(seen > 3000, "{seen}");
        }
    }
}
