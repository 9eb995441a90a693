//! The pixels of all frames that show a region of the wall, each with its footprint as a stencil of fine pixels.

use super::Region;
use crate::camera::Camera;
use crate::render::Canvas;
use crate::surface::Surface;
use crate::trajectory::Pose;

/// Points along each side of a region that are projected to find its place in a frame.
const OUTLINE: usize = 9;
/// Fine pixels along the side of a stencil, at the most: a pixel that looks so obliquely that its footprint is wider
/// tells little of the wall's detail, and is left out.
const REACH: usize = 12;
/// Parts of a pixel along each side.
const PARTS: usize = 4;

/// A frame with its place.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The camera, with its motion.
    pub camera: Camera,
    /// Where it stood.
    pub pose: &'a Pose,
}

/// What each pixel of each view reads of the fine pixels of a region: pixel p reads `Σ_k w_pk x_k` with `w_pk` the share
/// of its square, projected onto the wall, that lies in fine pixel k.
///
/// The square is a parallelogram on the wall (the map from pixels to the wall is linear within a pixel). It is taken in
/// [`PARTS`]² parts, and each part as the upright rectangle of its width and height around its middle: exact for an
/// upright camera, and of the right area, middle and about the right width for a turned one.
pub struct Footprints {
    pub(super) region: Region,
    pub(super) views: Vec<Stencils>,
}

impl Footprints {
    /// The footprints of the pixels whose footprints lie in the region entirely; of `views` in their order.
    pub fn new(surface: &dyn Surface, canvas: &Canvas, region: Region, views: &[View]) -> Self {
        let stencils = views
            .iter()
            .map(|view| Stencils::new(surface, canvas, &region, view));
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
}

/// The stencils of one view's pixels.
pub(super) struct Stencils {
    /// Fine pixels from one row of the region to the next.
    stride: usize,
    /// Fine pixels along a stencil's rows: 4, 6, 8 or 12.
    width: usize,
    /// Rows of a stencil.
    height: usize,
    /// First fine pixel of each stencil.
    first: Vec<u32>,
    /// `w`, stencil by stencil, row by row.
    weights: Vec<f32>,
    /// The pixels' numbers in their frame, row-major.
    pub pixels: Vec<u32>,
}

/// A pixel's middle with the two sides of its parallelogram, fine pixels.
struct Spot {
    pixel: usize,
    middle: [f32; 2],
    sides: [[f32; 2]; 2],
}

impl Spot {
    /// Half the width of the parallelogram along an axis.
    fn reach(&self, axis: usize) -> f32 {
        0.5 * (self.sides[0][axis].abs() + self.sides[1][axis].abs())
    }

    /// The first fine pixel along an axis.
    fn first(&self, axis: usize) -> f32 {
        (self.middle[axis] - self.reach(axis)).floor()
    }

    /// The number of fine pixels along an axis.
    fn span(&self, axis: usize) -> usize {
        let end = (self.middle[axis] + self.reach(axis)).floor() + 1.0;
        (end - self.first(axis)) as usize
    }
}

impl Stencils {
    fn new(surface: &dyn Surface, canvas: &Canvas, region: &Region, view: &View) -> Self {
        let mut spots = spots(surface, canvas, region, view);
        let most = |spots: &[Spot], axis| spots.iter().map(|spot| spot.span(axis)).max();
        let width = match most(&spots, 0).unwrap_or(1) {
            0..=4 => 4,
            5..=6 => 6,
            7..=8 => 8,
            _ => REACH,
        };
        let height = most(&spots, 1).unwrap_or(1);
        // Stencils are wider than some footprints, and begin earlier where they would end beyond the region.
        let start = |spot: &Spot| {
            let column = (spot.first(0) as usize).min(region.columns.saturating_sub(width));
            let row = (spot.first(1) as usize).min(region.rows.saturating_sub(height));
            [column, row]
        };
        if region.columns < width || region.rows < height {
            spots.clear();
        }
        let mut weights = vec![0.0; spots.len() * width * height];
        for (spot, stencil) in spots.iter().zip(weights.chunks_exact_mut(width * height)) {
            fill(spot, start(spot), stencil, width);
        }
        let first = spots.iter().map(|spot| {
            let [column, row] = start(spot);
            (row * region.columns + column) as u32
        });
        Self {
            stride: region.columns,
            width,
            height,
            first: first.collect(),
            weights,
            pixels: spots.iter().map(|spot| spot.pixel as u32).collect(),
        }
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.first.len()
    }

    /// `Σ_k w_pk x_k` for every pixel p.
    #[inline(always)]
    pub fn read(&self, x: &[f32], out: &mut Vec<f32>) {
        match self.width {
            4 => self.read_as::<4>(x, out),
            6 => self.read_as::<6>(x, out),
            8 => self.read_as::<8>(x, out),
            _ => self.read_as::<REACH>(x, out),
        }
    }

    #[inline(always)]
    fn read_as<const W: usize>(&self, x: &[f32], out: &mut Vec<f32>) {
        out.clear();
        let stencils = self.weights.chunks_exact(W * self.height);
        let all = self.first.iter().zip(stencils);
        out.extend(all.map(|(first, stencil)| self.dot::<W>(stencil, x, *first as usize)));
    }

    /// Adds `Σ_p w_pk v_p` to every fine pixel k.
    #[inline(always)]
    pub fn spread(&self, values: &[f32], y: &mut [f32]) {
        match self.width {
            4 => self.spread_as::<4>(values, y),
            6 => self.spread_as::<6>(values, y),
            8 => self.spread_as::<8>(values, y),
            _ => self.spread_as::<REACH>(values, y),
        }
    }

    #[inline(always)]
    fn spread_as<const W: usize>(&self, values: &[f32], y: &mut [f32]) {
        let stencils = self.weights.chunks_exact(W * self.height);
        for ((first, stencil), value) in self.first.iter().zip(stencils).zip(values) {
            self.add::<W>(stencil, *value, y, *first as usize);
        }
    }

    /// Adds `Σ_p w_pk ω_p Σ_l w_pl x_l` to every fine pixel k: the view's part of the normal matrix times x.
    #[inline(always)]
    pub fn add_normal(&self, omega: &[f32], x: &[f32], y: &mut [f32]) {
        match self.width {
            4 => self.add_normal_as::<4>(omega, x, y),
            6 => self.add_normal_as::<6>(omega, x, y),
            8 => self.add_normal_as::<8>(omega, x, y),
            _ => self.add_normal_as::<REACH>(omega, x, y),
        }
    }

    #[inline(always)]
    fn add_normal_as<const W: usize>(&self, omega: &[f32], x: &[f32], y: &mut [f32]) {
        let stencils = self.weights.chunks_exact(W * self.height);
        for ((first, stencil), omega) in self.first.iter().zip(stencils).zip(omega) {
            let first = *first as usize;
            let read = self.dot::<W>(stencil, x, first);
            self.add::<W>(stencil, omega * read, y, first);
        }
    }

    /// Adds the diagonal of the view's part of the normal matrix, `Σ_p w_pk² ω_p`.
    pub fn add_diagonal(&self, omega: &[f32], y: &mut [f32]) {
        let stencils = self.weights.chunks_exact(self.width * self.height);
        for ((first, stencil), omega) in self.first.iter().zip(stencils).zip(omega) {
            for (j, row) in stencil.chunks_exact(self.width).enumerate() {
                let start = *first as usize + j * self.stride;
                for (y, w) in y[start..start + self.width].iter_mut().zip(row) {
                    *y += w * w * omega;
                }
            }
        }
    }

    #[inline(always)]
    fn dot<const W: usize>(&self, stencil: &[f32], x: &[f32], first: usize) -> f32 {
        let mut sums = [0.0f32; W];
        for (j, row) in stencil.chunks_exact(W).enumerate() {
            let start = first + j * self.stride;
            for (sum, (w, x)) in sums.iter_mut().zip(row.iter().zip(&x[start..start + W])) {
                *sum += w * x;
            }
        }
        sums.iter().sum()
    }

    #[inline(always)]
    fn add<const W: usize>(&self, stencil: &[f32], value: f32, y: &mut [f32], first: usize) {
        for (j, row) in stencil.chunks_exact(W).enumerate() {
            let start = first + j * self.stride;
            for (y, w) in y[start..start + W].iter_mut().zip(row) {
                *y += w * value;
            }
        }
    }
}

/// The pixels' places in the region: those whose footprints lie in it entirely and are not too wide.
fn spots(surface: &dyn Surface, canvas: &Canvas, region: &Region, view: &View) -> Vec<Spot> {
    let (camera, pose) = (&view.camera, view.pose);
    let Some([columns, rows]) = window(surface, canvas, region, view) else {
        return Vec::new();
    };
    // One more pixel on every side, for differences.
    let wide = (columns[1] - columns[0] + 2) as usize;
    let mut places: Vec<[f32; 2]> = Vec::with_capacity(wide * (rows[1] - rows[0] + 2) as usize);
    for v in rows[0] - 1..=rows[1] {
        let start = pose.to_world(&camera.origin(v as f64));
        places.extend((columns[0] - 1..=columns[1]).map(|u| {
            let hit = camera
                .ray(u as f64, v as f64)
                .and_then(|ray| surface.hit(&start, &(pose.r_wc * ray)).ok());
            hit.map_or([f32::NAN; 2], |hit| region.place(canvas, &hit.wall))
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

/// Columns and rows, each from and to before, of the frame's pixels that may show the region; `None` if it shows nothing
/// of it.
fn window(
    surface: &dyn Surface,
    canvas: &Canvas,
    region: &Region,
    view: &View,
) -> Option<[[i64; 2]; 2]> {
    let (mut from, mut to) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for across in 0..OUTLINE {
        for down in 0..OUTLINE {
            let share = [across, down].map(|k| k as f64 / (OUTLINE - 1) as f64);
            let x_w = surface.frame(region.wall(canvas, share)).x_w;
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

/// Fills a pixel's stencil (all zeros before) whose first fine pixel is `corner`.
fn fill(spot: &Spot, corner: [usize; 2], stencil: &mut [f32], width: usize) {
    let height = stencil.len() / width;
    let weight = 1.0 / (PARTS * PARTS) as f32;
    let at = |k: usize| (k as f32 + 0.5) / PARTS as f32 - 0.5;
    let reach = [0, 1].map(|axis| spot.reach(axis) / PARTS as f32);
    for part_v in (0..PARTS).map(at) {
        for part_u in (0..PARTS).map(at) {
            let [across, down] = [0, 1].map(|axis| {
                let middle = spot.middle[axis] - corner[axis] as f32
                    + part_u * spot.sides[0][axis]
                    + part_v * spot.sides[1][axis];
                [middle - reach[axis], middle + reach[axis]]
            });
            for (j, share_v) in shares(down, height) {
                for (i, share_u) in shares(across, width) {
                    stencil[j * width + i] += weight * share_v * share_u;
                }
            }
        }
    }
}

/// The unit cells that an interval meets, of the first so many (it ends there but for rounding), each with its share of it.
fn shares([from, to]: [f32; 2], cells: usize) -> impl Iterator<Item = (usize, f32)> {
    let (from, to) = (from.max(0.0), to.min(cells as f32));
    let scale = 1.0 / (to - from).max(f32::MIN_POSITIVE);
    (from as usize..cells.min(to as usize + 1)).filter_map(move |cell| {
        let overlap = to.min(cell as f32 + 1.0) - from.max(cell as f32);
        (overlap > 0.0).then_some((cell, overlap * scale))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_wall::{TestWall, waves};

    /// A region of 60 × 40 fine pixels that the fourth frame of the ring shows, across θ = 0 if asked for.
    fn seen(across: bool) -> (TestWall, Canvas, Footprints, usize) {
        let wall = TestWall::ring(waves);
        let frame = if across { 0 } else { 3 };
        let canvas = Canvas {
            columns: 1738,
            rows: 400,
            px_per_metre: 1738.0 / wall.perimeter_m(),
            h_start_m: -0.7,
        };
        let pose = wall.poses[frame];
        let ray = pose.r_wc * nalgebra::Vector3::z();
        let [column, row] = canvas.pixel_of(wall.circle.hit(&pose.t_wc, &ray).unwrap().wall);
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
        let footprints = Footprints::new(&wall.circle, &canvas, region, &[view]);
        (wall, canvas, footprints, frame)
    }

    /// Of a wall that grows evenly, a pixel reads what lies under its middle, but for what a fine pixel is even in itself:
    /// an eighth of a fine pixel over the pixel's width at the most.
    #[test]
    fn a_footprint_is_centred_where_the_pixel_looks() {
        for across in [false, true] {
            let (wall, canvas, footprints, frame) = seen(across);
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
                let place = region.place(&canvas, &hit.unwrap().wall);
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
