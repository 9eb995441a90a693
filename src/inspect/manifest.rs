//! Metadata of the viewer's page besides the tiles: `tunnel.json` and `wall.json`.

use crate::camera::Cameras;
use crate::inspect::layer_values::LayerValues;
use crate::inspect::level_strip::BORDER;
use crate::inspect::mesh::{GridLines, WallRectangle};
use crate::inspect::tileset::TILESET;
use crate::render::Canvas;
use crate::surface::Surface;
use crate::trajectory::Pose;
use serde::Serialize;
use tunnelstitch_core::PROGRAM;

/// Name of the file with the metadata of a tunnel.
pub const MANIFEST: &str = "tunnel.json";
/// Name of the file with the wall's points.
pub const WALL: &str = "wall.json";

/// Folder of the map's images.
pub(super) const MAP_FOLDER: &str = "map";

/// Version of the content of `tunnel.json`.
const SCHEMA_VERSION: u32 = 1;

/// Maximum distance of the wall from the polyline of its points, as a share of the perimeter.
///
/// It is 2 mm in a tunnel of 3 m radius; lengths are then accurate to a ten-thousandth.
const TOLERANCE: f64 = 1e-4;

/// Content of `tunnel.json`.
#[derive(Debug, Serialize)]
pub struct Manifest {
    schema_version: u32,
    program: &'static str,
    /// Name of the survey.
    pub name: String,
    /// Perimeter of the section, metres.
    pub perimeter_m: f64,
    /// Angle θ of twelve o'clock, degrees.
    pub twelve_at_deg: f64,
    /// Angles θ of the arc lengths k/N of the perimeter, k from 0 to N, degrees, non-decreasing.
    theta_deg: Vec<f64>,
    /// Range of chainage over all layers, metres.
    pub chainage_m: [f64; 2],
    /// Names of the frames.
    pub frames: Vec<String>,
    /// Unit directions of the corners of a frame (of a rig, of one of its first camera) in camera
    /// coordinates, in order around it.
    pub corners: Vec<[f64; 3]>,
    /// Layers, with the initially shown one first.
    pub layers: Vec<PanoramaLayer>,
}

/// Panorama of one set of poses.
#[derive(Clone, Debug, Serialize)]
pub struct PanoramaLayer {
    /// Name of the layer and of its folder.
    pub name: String,
    /// Path of the tileset.
    tileset: String,
    /// Resolution, pixels per metre.
    px_per_metre: f64,
    /// Range of chainage, metres.
    pub chainage_m: [f64; 2],
    /// Images of the map.
    map: MapImages,
    /// Poses of the frames, camera-to-world: position (m) and quaternion, x y z w.
    poses: Vec<[f64; 7]>,
    /// Values that it shows besides the picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    values: Option<LayerValues>,
}

/// Images of the map, `folder/ROW.jpg`: the textures of one level, θ to the right, chainage down.
#[derive(Clone, Debug, Serialize)]
pub struct MapImages {
    folder: String,
    px_per_metre: f64,
    /// Width and height of the level, pixels.
    size_px: [u32; 2],
    /// Rows of an image without its border, pixels.
    rows_px: usize,
    /// Width of an image's border, pixels.
    border_px: usize,
}

impl MapImages {
    /// The images of a level.
    pub(super) fn new(canvas: &Canvas, level: usize) -> Self {
        let halved = |side: u32| (0..level).fold(side, |side, _| side.div_ceil(2));
        Self {
            folder: MAP_FOLDER.to_owned(),
            px_per_metre: canvas.px_per_metre / 2f64.powi(level as i32),
            size_px: [canvas.columns, canvas.rows].map(halved),
            rows_px: crate::raster::TILE_EDGE_PX,
            border_px: BORDER,
        }
    }
}

impl PanoramaLayer {
    /// The layer `name` of a canvas that was rendered from `poses`.
    pub fn new(name: &str, canvas: &Canvas, mut map: MapImages, poses: &[Pose]) -> Self {
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
            values: None,
        }
    }

    /// The layer with values.
    pub(super) fn with_values(self, values: LayerValues) -> Self {
        Self {
            values: Some(values),
            ..self
        }
    }
}

impl Manifest {
    /// The manifest of at least one layer.
    pub fn new(
        name: String,
        surface: &dyn Surface,
        cameras: &Cameras,
        frames: Vec<String>,
        twelve_at_deg: f64,
        layers: Vec<PanoramaLayer>,
    ) -> Self {
        let camera = cameras.of(0);
        let [right, below] = cameras.size().map(|side| f64::from(side) - 1.0);
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
            theta_deg: sample_angles_deg(surface),
            chainage_m,
            frames,
            corners: corners.into_iter().filter_map(direction).collect(),
            layers,
        }
    }
}

/// Number of steps of [`Manifest::theta_deg`] around the section.
const ANGLE_STEPS: u32 = 720;

/// Samples the angles θ at equal steps of arc length, degrees.
fn sample_angles_deg(surface: &dyn Surface) -> Vec<f64> {
    let mut last = f64::NEG_INFINITY;
    let angle = |k: u32| {
        let share = f64::from(k) / f64::from(ANGLE_STEPS);
        let mut theta_deg = surface
            .angle_rad(share * surface.perimeter_m())
            .to_degrees();
        // Angles continue beyond 360°, and rounding must not make them decrease.
        if theta_deg < last - 180.0 {
            theta_deg += 360.0;
        }
        last = last.max(theta_deg);
        (last * 1e6).round() / 1e6
    };
    (0..=ANGLE_STEPS).map(angle).collect()
}

/// Content of `wall.json`: points of the wall between which it is nearly straight.
///
/// The page converts between wall and world coordinates by them, for any shape of tunnel.
#[derive(Debug, Serialize)]
pub struct WallPoints {
    /// Arc lengths, metres, from 0 to the perimeter.
    s_m: Vec<f64>,
    /// Chainages, metres.
    h_m: Vec<f64>,
    /// World coordinates x, y, z of all points, metres; s varies fastest, then h.
    points_m: Vec<f64>,
}

impl WallPoints {
    /// Samples the wall over a range of chainage, metres.
    pub fn new(surface: &dyn Surface, chainage_m: [f64; 2]) -> Self {
        let perimeter_m = surface.perimeter_m();
        let rectangle = WallRectangle {
            s_m: [0.0, perimeter_m],
            h_m: chainage_m,
        };
        let tolerance_m = TOLERANCE * perimeter_m;
        let lines = GridLines::cut(surface, &rectangle, tolerance_m, tolerance_m);
        let mut points = Vec::new();
        surface.lattice(&lines.s_m, &lines.h_m, &mut points);
        // Rounded to a hundredth of the tolerance.
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
        let angles = sample_angles_deg(&circle);
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
