//! Footprints of the frames' pixels on a region of the wall, as stencils of fine pixels.

use crate::reading::Reading;
use crate::region::{FineGrid, Region};
use crate::stencils::{MAX_STENCIL_WIDTH, PixelFootprint, Stencils};
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::surface::Surface;
use tunnelstitch_geometry::trajectory::Pose;

/// Number of points along each side of a region that are projected into a frame.
const OUTLINE_POINTS: usize = 9;
/// Minimum weight of a seen fine pixel; a pixel of 2 × 2 fine pixels has the weight 0.25.
const MIN_SEEN_WEIGHT: f32 = 0.05;

/// Camera with its pose.
#[derive(Clone, Copy, Debug)]
pub struct PosedCamera<'a> {
    /// The camera, with its motion during readout.
    pub camera: Camera,
    /// Pose of the camera.
    pub pose: &'a Pose,
}

/// Observation matrix W of a region: the share of each pixel's projected square in each fine pixel.
pub struct Footprints {
    pub(super) region: Region,
    pub(super) views: Vec<Stencils>,
}

impl Footprints {
    /// Computes the footprints of all pixels of `views` that lie entirely in the region.
    pub fn new(
        surface: &dyn Surface,
        grid: &FineGrid,
        region: Region,
        views: &[PosedCamera],
    ) -> Self {
        let stencils = views
            .iter()
            .map(|view| Stencils::new(&region, project_pixels(surface, grid, &region, view)));
        Self {
            region,
            views: stencils.collect(),
        }
    }

    /// Number of pixels of all views.
    pub fn len(&self) -> usize {
        self.views.iter().map(Stencils::len).sum()
    }

    /// True if no view shows the region.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Row-major indices of a view's pixels in its frame.
    pub fn pixels(&self, view: usize) -> &[u32] {
        &self.views[view].pixels
    }

    /// Centres of a view's pixels in the region, fine pixels from its first corner.
    pub fn positions(&self, view: usize) -> &[[f32; 2]] {
        &self.views[view].positions
    }

    /// Predicts the readings of a view's pixels from the fine pixels `x`: `W x`.
    ///
    /// # Panics
    /// If x does not have the region's size.
    pub fn read(&self, view: usize, x: &[f32]) -> Vec<f32> {
        assert_eq!(x.len(), self.region.pixels(), "fine pixels");
        let mut read = Vec::new();
        self.views[view].read(x, &mut read);
        read
    }

    /// Computes `Wᵀ v` with a value v of each reading.
    fn spread(&self, readings: &[Vec<Reading>], value: impl Fn(&Reading) -> f32) -> Vec<f32> {
        let mut sum = vec![0.0; self.region.pixels()];
        for (stencils, readings) in self.views.iter().zip(readings) {
            let values: Vec<f32> = readings.iter().map(&value).collect();
            stencils.spread(&values, &mut sum);
        }
        sum
    }

    /// Mask of the fine pixels that pixels with a value show.
    pub(super) fn seen(&self, readings: &[Vec<Reading>]) -> Vec<bool> {
        let total = self.spread(readings, |r| f32::from(r.inverse_sigma > 0.0));
        total
            .into_iter()
            .map(|total| total > MIN_SEEN_WEIGHT)
            .collect()
    }

    /// Mean of all readings per fine pixel, weighted by precision and footprint; NaN where unseen.
    ///
    /// `readings`: those of each view's pixels, as for [`Footprints::super_resolve`].
    pub fn mean(&self, readings: &[Vec<Reading>]) -> Vec<f32> {
        let precision = |reading: &Reading| reading.inverse_sigma * reading.inverse_sigma;
        let sum = self.spread(readings, |reading| precision(reading) * reading.value);
        let weight = self.spread(readings, precision);
        let found = sum.iter().zip(&weight).zip(self.seen(readings));
        found
            .map(|((sum, weight), seen)| if seen { sum / weight } else { f32::NAN })
            .collect()
    }
}

/// Computes the footprints of the pixels that lie entirely in the region and are not too wide.
fn project_pixels(
    surface: &dyn Surface,
    grid: &FineGrid,
    region: &Region,
    view: &PosedCamera,
) -> Vec<PixelFootprint> {
    let (camera, pose) = (&view.camera, view.pose);
    let Some([columns, rows]) = visible_window(surface, grid, region, view) else {
        return Vec::new();
    };
    let coordinates = region.coordinates(grid);
    let r_wc = pose.r_wc.to_rotation_matrix();
    // One more pixel on every side, for central differences.
    let wide = (columns[1] - columns[0] + 2) as usize;
    let mut positions: Vec<[f32; 2]> = Vec::with_capacity(wide * (rows[1] - rows[0] + 2) as usize);
    for v in rows[0] - 1..=rows[1] {
        let start = pose.to_world(&camera.origin(v as f64));
        positions.extend((columns[0] - 1..=columns[1]).map(|u| {
            let hit = camera
                .ray(u as f64, v as f64)
                .and_then(|ray| surface.hit(&start, &(r_wc * ray)).ok());
            hit.map_or([f32::NAN; 2], |hit| coordinates.of(&hit.wall))
        }));
    }
    let size = [region.columns as f32, region.rows as f32];
    let mut footprints = Vec::new();
    for v in rows[0]..rows[1] {
        for u in columns[0]..columns[1] {
            let k = (v - rows[0] + 1) as usize * wide + (u - columns[0] + 1) as usize;
            let half = |a: [f32; 2], b: [f32; 2]| [0.5 * (b[0] - a[0]), 0.5 * (b[1] - a[1])];
            let footprint = PixelFootprint {
                pixel: v as usize * camera.width as usize + u as usize,
                middle: positions[k],
                sides: [
                    half(positions[k - 1], positions[k + 1]),
                    half(positions[k - wide], positions[k + wide]),
                ],
            };
            // Also false for NaN.
            let within = (0..2).all(|axis| {
                let (middle, reach) = (footprint.middle[axis], footprint.half_width(axis));
                middle - reach >= 0.0
                    && middle + reach < size[axis]
                    && 2.0 * reach < (MAX_STENCIL_WIDTH - 1) as f32
            });
            if within {
                footprints.push(footprint);
            }
        }
    }
    footprints
}

/// Range of columns and rows of the frame's pixels that may show the region; `None` if none do.
fn visible_window(
    surface: &dyn Surface,
    grid: &FineGrid,
    region: &Region,
    view: &PosedCamera,
) -> Option<[[i64; 2]; 2]> {
    let (mut from, mut to) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for across in 0..OUTLINE_POINTS {
        for down in 0..OUTLINE_POINTS {
            let share = [across, down].map(|k| k as f64 / (OUTLINE_POINTS - 1) as f64);
            let x_w = surface.frame(region.wall(grid, share)).x_w;
            if let Some(pixel) = view.camera.project(&view.pose.to_camera(&x_w)) {
                for axis in 0..2 {
                    from[axis] = from[axis].min(pixel[axis]);
                    to[axis] = to[axis].max(pixel[axis]);
                }
            }
        }
    }
    // The outline is sampled; a margin of a pixel and 2 % covers its curvature between points.
    let range = |axis: usize, size: u32| {
        let margin = 1.0 + 0.02 * (to[axis] - from[axis]);
        let first = (from[axis] - margin).max(0.0).floor() as i64;
        let end = (to[axis] + margin).min(f64::from(size) - 1.0).floor() as i64 + 1;
        [first, end]
    };
    let window = [range(0, view.camera.width), range(1, view.camera.height)];
    (from[0].is_finite() && window.iter().all(|[first, end]| first < end)).then_some(window)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use tunnelstitch_core::test_wall::{TestWall, waves};

    /// A region of 60 × 40 fine pixels in the centre of a frame, optionally across θ = 0.
    fn seen(across: bool) -> (TestWall, FineGrid, Footprints, usize) {
        let wall = TestWall::ring(waves);
        let frame = if across { 0 } else { 3 };
        let grid = FineGrid {
            columns: 1738,
            spacing_m: [wall.perimeter_m() / 1738.0, 0.009],
            start_m: [0.0, -0.7],
        };
        let pose = wall.poses[frame];
        let ray = pose.r_wc * Vector3::z();
        let middle = wall.circle.hit(&pose.t_wc, &ray).unwrap().wall;
        let column = middle.s_m / grid.spacing_m[0];
        let row = (middle.h_m - grid.start_m[1]) / grid.spacing_m[1];
        let region = Region {
            column: if across { -30 } else { column as i64 - 30 },
            row: row as i64 - 20,
            columns: 60,
            rows: 40,
        };
        let view = PosedCamera {
            camera: wall.camera,
            pose: &pose,
        };
        let footprints = Footprints::new(&wall.circle, &grid, region, &[view]);
        (wall, grid, footprints, frame)
    }

    /// On a linear ramp, a pixel reads the value under its centre, except for the quantisation by
    /// constant fine pixels: at most an eighth of a fine pixel over the pixel's width.
    #[test]
    fn a_footprint_is_centred_on_the_projected_pixel() {
        for across in [false, true] {
            let (wall, grid, footprints, frame) = seen(across);
            let (region, stencils) = (footprints.region, &footprints.views[0]);
            assert!(stencils.len() > 200, "{}", stencils.len());
            let read = |value: &dyn Fn(usize) -> f32| {
                let (mut read, x) = (Vec::new(), (0..2400).map(value).collect::<Vec<f32>>());
                stencils.read(&x, &mut read);
                read
            };
            let ones = read(&|_| 1.0);
            let [s, h] = [
                read(&|k| (k % 60) as f32 + 0.5),
                read(&|k| (k / 60) as f32 + 0.5),
            ];
            for (n, pixel) in stencils.pixels.iter().enumerate() {
                let (u, v) = (f64::from(pixel % 160), f64::from(pixel / 160));
                let pose = wall.poses[frame];
                let hit = wall
                    .circle
                    .hit(&pose.t_wc, &(pose.r_wc * wall.camera.ray(u, v).unwrap()));
                let position = region.coordinates(&grid).of(&hit.unwrap().wall);
                assert!((ones[n] - 1.0).abs() < 1e-5);
                assert!(
                    (s[n] - position[0]).abs() < 0.06 && (h[n] - position[1]).abs() < 0.06,
                    "{position:?}: {} {}",
                    s[n],
                    h[n]
                );
            }
        }
    }

    /// `⟨W x, v⟩ = ⟨x, Wᵀ v⟩`; the normal matrix is `Wᵀ Ω W`, consistent with its diagonal.
    #[test]
    fn spreading_is_the_transpose_of_reading() {
        let (_, _, footprints, _) = seen(false);
        let stencils = &footprints.views[0];
        let number = |k: usize| (12.9 * k as f32).sin();
        let x: Vec<f32> = (0..2400).map(number).collect();
        let mut read = Vec::new();
        stencils.read(&x, &mut read);
        let v: Vec<f32> = (0..stencils.len()).map(|k| number(k + 7).abs()).collect();
        let dot =
            |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
        let mut spread = vec![0.0; 2400];
        stencils.spread(&v, &mut spread);
        assert!((dot(&read, &v) - dot(&x, &spread)).abs() < 1e-3);
        let normal = |x: &[f32]| {
            let mut y = vec![0.0; 2400];
            stencils.add_normal(&v, x, &mut y);
            y
        };
        let squares: f64 = read.iter().zip(&v).map(|(r, v)| f64::from(r * r * v)).sum();
        assert!((dot(&x, &normal(&x)) - squares).abs() < 1e-3);
        let mut diagonal = vec![0.0; 2400];
        stencils.add_diagonal(&v, &mut diagonal);
        let unit: Vec<f32> = (0..2400)
            .map(|k| if k == 1230 { 1.0 } else { 0.0 })
            .collect();
        assert!((normal(&unit)[1230] - diagonal[1230]).abs() < 1e-6);
    }
}
