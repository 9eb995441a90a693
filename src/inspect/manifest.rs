//! What the page knows of a tunnel besides its tiles: `tunnel.json` and `wall.json`.

use super::mesh::{Lines, Patch};
use super::strip::BORDER;
use super::tiles::MAP;
use super::tileset::TILESET;
use crate::PROGRAM;
use crate::camera::Camera;
use crate::render::Canvas;
use crate::surface::Surface;
use crate::trajectory::Pose;
use serde::Serialize;

/// Name of the file that says what a folder shows.
pub const MANIFEST: &str = "tunnel.json";
/// Name of the file with points of the wall.
pub const WALL: &str = "wall.json";

const SCHEMA_VERSION: u32 = 1;

/// The points of the wall may be this far from the straight lines between them, as a share of the
/// section's outline: 2 mm in a tunnel of 3 m radius, whose lengths are then right to a
/// ten-thousandth.
const TOLERANCE: f64 = 1e-4;

/// What a folder shows.
#[derive(Debug, Serialize)]
pub struct Manifest {
    schema_version: u32,
    program: &'static str,
    /// Name of the survey.
    pub name: String,
    /// Length of the section's outline, metres.
    pub perimeter_m: f64,
    /// The angle θ of twelve o'clock, degrees.
    pub twelve_at_deg: f64,
    /// The angles θ of the arc lengths k/N of the perimeter, k from 0 to N, degrees, as seen from
    /// the axis; never falling.
    theta_deg: Vec<f64>,
    /// From and to, metres, over all layers.
    pub chainage_m: [f64; 2],
    /// Names of the frames.
    pub frames: Vec<String>,
    /// Directions of the corners of a frame in camera coordinates, of unit length, around the
    /// picture.
    pub corners: Vec<[f64; 3]>,
    /// What there is to be seen, the one to begin with first.
    pub layers: Vec<Layer>,
}

/// A panorama of some poses.
#[derive(Clone, Debug, Serialize)]
pub struct Layer {
    /// Its name and folder.
    pub name: String,
    /// Its tree of tiles.
    tileset: String,
    /// Pixels per metre of wall.
    px_per_metre: f64,
    /// From and to, metres.
    pub chainage_m: [f64; 2],
    /// Its map.
    map: MapPlace,
    /// Poses of the frames, camera-to-world: position (m) and quaternion, x y z w.
    poses: Vec<[f64; 7]>,
}

/// The pictures of a map: one level of the tiles' own textures, `folder/ROW.jpg`, θ to the right
/// and chainage down.
#[derive(Clone, Debug, Serialize)]
pub struct MapPlace {
    folder: String,
    px_per_metre: f64,
    /// Pixels of the level.
    size_px: [u32; 2],
    /// Rows of a picture, border not counted.
    rows_px: usize,
    /// Border of a picture on all sides, pixels.
    border_px: usize,
}

impl MapPlace {
    /// The map of a level.
    pub(super) fn new(canvas: &Canvas, level: usize) -> Self {
        let halved = |side: u32| (0..level).fold(side, |side, _| side.div_ceil(2));
        Self {
            folder: MAP.to_owned(),
            px_per_metre: canvas.px_per_metre / 2f64.powi(level as i32),
            size_px: [canvas.columns, canvas.rows].map(halved),
            rows_px: crate::raster::TILE_EDGE_PX,
            border_px: BORDER,
        }
    }
}

impl Layer {
    /// The layer `name` of a canvas drawn from `poses`.
    pub fn new(name: &str, canvas: &Canvas, mut map: MapPlace, poses: &[Pose]) -> Self {
        map.folder = format!("{name}/{}", map.folder);
        let rounded = |value: f64| (value * 1e7).round() / 1e7;
        let numbers = |pose: &Pose| {
            let (t, q) = (&pose.t_wc, &pose.r_wc.coords);
            [t.x, t.y, t.z, q.x, q.y, q.z, q.w].map(rounded)
        };
        Self {
            name: name.to_owned(),
            tileset: format!("{name}/{TILESET}"),
            px_per_metre: canvas.px_per_metre,
            chainage_m: canvas.chainage_m(),
            map,
            poses: poses.iter().map(numbers).collect(),
        }
    }
}

impl Manifest {
    /// The manifest of layers, at least one.
    pub fn new(
        name: String,
        surface: &dyn Surface,
        camera: &Camera,
        frames: Vec<String>,
        twelve_at_deg: f64,
        layers: Vec<Layer>,
    ) -> Self {
        let (right, below) = (
            f64::from(camera.width) - 1.0,
            f64::from(camera.height) - 1.0,
        );
        let corners = [[0.0, 0.0], [right, 0.0], [right, below], [0.0, below]];
        let direction = |[u, v]: [f64; 2]| Some(camera.ray(u, v)?.normalize().into());
        let start = [f64::INFINITY, f64::NEG_INFINITY];
        let chainage_m = layers.iter().fold(start, |[from, to], layer| {
            [from.min(layer.chainage_m[0]), to.max(layer.chainage_m[1])]
        });
        Self {
            schema_version: SCHEMA_VERSION,
            program: PROGRAM,
            name,
            perimeter_m: surface.perimeter_m(),
            twelve_at_deg,
            theta_deg: angles_deg(surface),
            chainage_m,
            frames,
            corners: corners.into_iter().filter_map(direction).collect(),
            layers,
        }
    }
}

/// Steps of [`Manifest::theta_deg`] around the section.
const ANGLES: u32 = 720;

fn angles_deg(surface: &dyn Surface) -> Vec<f64> {
    let mut last = f64::NEG_INFINITY;
    let angle = |k: u32| {
        let share = f64::from(k) / f64::from(ANGLES);
        let mut theta_deg = surface
            .angle_rad(share * surface.perimeter_m())
            .to_degrees();
        // Beyond 360° it goes on; what rounding took is given back.
        if theta_deg < last - 180.0 {
            theta_deg += 360.0;
        }
        last = last.max(theta_deg);
        (last * 1e6).round() / 1e6
    };
    (0..=ANGLES).map(angle).collect()
}

/// Points of the wall between which it is nearly straight: the page finds places by them whatever
/// the tunnel's shape.
#[derive(Debug, Serialize)]
pub struct WallPoints {
    /// Arc lengths, metres, from 0 to the perimeter.
    s_m: Vec<f64>,
    /// Chainages, metres.
    h_m: Vec<f64>,
    /// World coordinates, metres, one after the other; s runs fastest, then h.
    points_m: Vec<f64>,
}

impl WallPoints {
    /// The wall over a range of chainage.
    pub fn new(surface: &dyn Surface, chainage_m: [f64; 2]) -> Self {
        let perimeter_m = surface.perimeter_m();
        let patch = Patch {
            s_m: [0.0, perimeter_m],
            h_m: chainage_m,
        };
        let tolerance_m = TOLERANCE * perimeter_m;
        let lines = Lines::cut(surface, &patch, tolerance_m, tolerance_m);
        let mut points = Vec::new();
        surface.lattice(&lines.s_m, &lines.h_m, &mut points);
        // Hundredths of the tolerance are enough.
        let step = 10f64.powf((0.01 * tolerance_m).log10().floor());
        let rounded = |value: &f64| (value / step).round() * step;
        Self {
            points_m: points
                .iter()
                .flat_map(|x| x.iter().map(rounded).collect::<Vec<_>>())
                .collect(),
            s_m: lines.s_m,
            h_m: lines.h_m,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{Circle, WallPoint};

    #[test]
    fn angles_go_around_once() {
        let circle = Circle::new(3.0).unwrap();
        let angles = angles_deg(&circle);
        for (k, theta_deg) in angles.iter().enumerate() {
            assert!(
                (theta_deg - 0.5 * k as f64).abs() < 1e-6,
                "{k}: {theta_deg}"
            );
        }
    }

    #[test]
    fn lengths_between_the_points_are_those_of_the_wall() {
        let circle = Circle::new(3.0).unwrap();
        let wall = WallPoints::new(&circle, [0.0, 1000.0]);
        assert_eq!(wall.h_m, [0.0, 1000.0]);
        let points: Vec<&[f64]> = wall.points_m.chunks_exact(3).collect();
        assert_eq!(points.len(), wall.s_m.len() * wall.h_m.len());
        let around = points[..wall.s_m.len()].windows(2).map(|pair| {
            let step = |k: usize| pair[1][k] - pair[0][k];
            step(0).hypot(step(1)).hypot(step(2))
        });
        let around_m: f64 = around.sum();
        assert!(
            (around_m / circle.perimeter_m() - 1.0).abs() < 3e-4,
            "{around_m}"
        );
        for (k, s_m) in wall.s_m.iter().enumerate() {
            let x_w = circle
                .frame(WallPoint {
                    s_m: *s_m,
                    h_m: 0.0,
                })
                .x_w;
            assert!((x_w.x - points[k][0]).abs() < 1e-4 && (x_w.z - points[k][2]).abs() < 1e-4);
        }
    }
}
