//! The pixels of all frames that show a region of the wall, each with its footprint as a stencil of
//! fine pixels.

use super::stencils::{REACH, Spot, Stencils};
use super::{Lattice, Reading, Region};
use crate::camera::Camera;
use crate::surface::Surface;
use crate::trajectory::Pose;

/// Points along each side of a region that are projected to find its place in a frame.
const OUTLINE: usize = 9;
/// Weight of pixels above which a fine pixel counts as seen: a pixel of two by two gives 0.25.
const SEEN: f32 = 0.05;

/// A frame with its place.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The camera, with its motion.
    pub camera: Camera,
    /// Where it stood.
    pub pose: &'a Pose,
}

/// What each pixel of each view reads of the fine pixels of a region: the shares of its square,
/// projected onto the wall, that lie in each.
pub struct Footprints {
    pub(super) region: Region,
    pub(super) views: Vec<Stencils>,
}

impl Footprints {
    /// The footprints of the pixels whose footprints lie in the region entirely; of `views` in
    /// their order.
    pub fn new(surface: &dyn Surface, lattice: &Lattice, region: Region, views: &[View]) -> Self {
        let stencils = views
            .iter()
            .map(|view| Stencils::new(&region, spots(surface, lattice, &region, view)));
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

    /// The numbers, row-major, of a view's pixels in its frame.
    pub fn pixels(&self, view: usize) -> &[u32] {
        &self.views[view].pixels
    }

    /// Where the middles of a view's pixels lie in the region, fine pixels from its first corner.
    pub fn places(&self, view: usize) -> &[[f32; 2]] {
        &self.views[view].places
    }

    /// What a view's pixels read of the fine pixels `x`: `W x`.
    ///
    /// # Panics
    /// If x has not the region's size.
    pub fn read(&self, view: usize, x: &[f32]) -> Vec<f32> {
        assert_eq!(x.len(), self.region.pixels(), "fine pixels");
        let mut read = Vec::new();
        self.views[view].read(x, &mut read);
        read
    }

    /// `Wᵀ v` with the value v of each reading.
    fn spread(&self, readings: &[Vec<Reading>], value: impl Fn(&Reading) -> f32) -> Vec<f32> {
        let mut sum = vec![0.0; self.region.pixels()];
        for (stencils, readings) in self.views.iter().zip(readings) {
            let values: Vec<f32> = readings.iter().map(&value).collect();
            stencils.spread(&values, &mut sum);
        }
        sum
    }

    /// True for every fine pixel that pixels with a value show.
    pub(super) fn seen(&self, readings: &[Vec<Reading>]) -> Vec<bool> {
        let total = self.spread(readings, |r| f32::from(r.inverse_sigma > 0.0));
        total.into_iter().map(|total| total > SEEN).collect()
    }

    /// The mean of what all pixels read, each weighing by its precision and its share of a fine
    /// pixel; NaN where none does.
    ///
    /// `readings`: of each view's pixels, as [`Footprints::super_resolve`] takes them.
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

/// The pixels' places in the region: those whose footprints lie in it entirely and are not too
/// wide.
fn spots(surface: &dyn Surface, lattice: &Lattice, region: &Region, view: &View) -> Vec<Spot> {
    let (camera, pose) = (&view.camera, view.pose);
    let Some([columns, rows]) = window(surface, lattice, region, view) else {
        return Vec::new();
    };
    let chart = region.chart(lattice);
    let r_wc = pose.r_wc.to_rotation_matrix();
    // One more pixel on every side, for differences.
    let wide = (columns[1] - columns[0] + 2) as usize;
    let mut places: Vec<[f32; 2]> = Vec::with_capacity(wide * (rows[1] - rows[0] + 2) as usize);
    for v in rows[0] - 1..=rows[1] {
        let start = pose.to_world(&camera.origin(v as f64));
        places.extend((columns[0] - 1..=columns[1]).map(|u| {
            let hit = camera
                .ray(u as f64, v as f64)
                .and_then(|ray| surface.hit(&start, &(r_wc * ray)).ok());
            hit.map_or([f32::NAN; 2], |hit| chart.place(&hit.wall))
        }));
    }
    let size = [region.columns as f32, region.rows as f32];
    let mut spots = Vec::new();
    for v in rows[0]..rows[1] {
        for u in columns[0]..columns[1] {
            let k = (v - rows[0] + 1) as usize * wide + (u - columns[0] + 1) as usize;
            let half = |a: [f32; 2], b: [f32; 2]| [0.5 * (b[0] - a[0]), 0.5 * (b[1] - a[1])];
            let spot = Spot {
                pixel: v as usize * camera.width as usize + u as usize,
                middle: places[k],
                sides: [
                    half(places[k - 1], places[k + 1]),
                    half(places[k - wide], places[k + wide]),
                ],
            };
            // False for what is not a number, too.
            let within = (0..2).all(|axis| {
                let (middle, reach) = (spot.middle[axis], spot.reach(axis));
                middle - reach >= 0.0
                    && middle + reach < size[axis]
                    && 2.0 * reach < (REACH - 1) as f32
            });
            if within {
                spots.push(spot);
            }
        }
    }
    spots
}

/// Columns and rows, each from and to before, of the frame's pixels that may show the region;
/// `None` if it shows nothing of it.
fn window(
    surface: &dyn Surface,
    lattice: &Lattice,
    region: &Region,
    view: &View,
) -> Option<[[i64; 2]; 2]> {
    let (mut from, mut to) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for across in 0..OUTLINE {
        for down in 0..OUTLINE {
            let share = [across, down].map(|k| k as f64 / (OUTLINE - 1) as f64);
            let x_w = surface.frame(region.wall(lattice, share)).x_w;
            if let Some(pixel) = view.camera.project(&view.pose.to_camera(&x_w)) {
                for axis in 0..2 {
                    from[axis] = from[axis].min(pixel[axis]);
                    to[axis] = to[axis].max(pixel[axis]);
                }
            }
        }
    }
    // The outline comes from single points: a pixel and 2 % cover what bulges between them.
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
    use crate::test_wall::{TestWall, waves};
    use nalgebra::Vector3;

    /// A region of 60 × 40 fine pixels that the fourth frame of the ring shows, across θ = 0 if
    /// asked for.
    fn seen(across: bool) -> (TestWall, Lattice, Footprints, usize) {
        let wall = TestWall::ring(waves);
        let frame = if across { 0 } else { 3 };
        let lattice = Lattice {
            columns: 1738,
            spacing_m: [wall.perimeter_m() / 1738.0, 0.009],
            start_m: [0.0, -0.7],
        };
        let pose = wall.poses[frame];
        let ray = pose.r_wc * Vector3::z();
        let middle = wall.circle.hit(&pose.t_wc, &ray).unwrap().wall;
        let column = middle.s_m / lattice.spacing_m[0];
        let row = (middle.h_m - lattice.start_m[1]) / lattice.spacing_m[1];
        let region = Region {
            column: if across { -30 } else { column as i64 - 30 },
            row: row as i64 - 20,
            columns: 60,
            rows: 40,
        };
        let view = View {
            camera: wall.camera,
            pose: &pose,
        };
        let footprints = Footprints::new(&wall.circle, &lattice, region, &[view]);
        (wall, lattice, footprints, frame)
    }

    /// Of a wall that grows evenly, a pixel reads what lies under its middle, but for what a fine
    /// pixel is even in itself: an eighth of a fine pixel over the pixel's width at the most.
    #[test]
    fn a_footprint_is_centred_where_the_pixel_looks() {
        for across in [false, true] {
            let (wall, lattice, footprints, frame) = seen(across);
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
                let place = region.chart(&lattice).place(&hit.unwrap().wall);
                assert!((ones[n] - 1.0).abs() < 1e-5);
                assert!(
                    (s[n] - place[0]).abs() < 0.06 && (h[n] - place[1]).abs() < 0.06,
                    "{place:?}: {} {}",
                    s[n],
                    h[n]
                );
            }
        }
    }

    /// `⟨W x, v⟩ = ⟨x, Wᵀ v⟩`; the normal matrix is `Wᵀ Ω W`, and its diagonal is its own.
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
