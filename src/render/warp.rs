//! The inverse warp: from wall points into a frame and to its values there, geometry and sampling in one pass.

use super::kernel::Kernel;
use super::picture::Picture;
use super::sample::{Sample, Samples, WHOLE};
use crate::camera::{Bend, Camera, SingleLens};
use crate::trajectory::Pose;
use crate::vectors::wide;
use nalgebra::{Matrix3, Vector3};

/// Most points of a run: all that is known of a run stays in the first-level cache.
pub const RUN: usize = 128;

/// Wall points in single precision, relative to an origin near them: coordinates are exact to 10⁻⁷ of the patch's size.
#[derive(Debug, Default)]
pub struct Points {
    /// The origin in the world, metres.
    pub origin: Vector3<f64>,
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
}

impl Points {
    /// The points, in order, relative to the first.
    pub fn new(points: &[Vector3<f64>]) -> Self {
        let mut all = Self::default();
        all.set(points);
        all
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Puts other points in their place.
    pub fn set(&mut self, points: &[Vector3<f64>]) {
        let origin = points.first().copied().unwrap_or_default();
        self.origin = origin;
        for axis in [&mut self.x, &mut self.y, &mut self.z] {
            axis.resize(points.len(), 0.0);
        }
        let axes = self.x.iter_mut().zip(&mut self.y).zip(&mut self.z);
        for (point, ((x, y), z)) in points.iter().zip(axes) {
            *x = (point.x - origin.x) as f32;
            *y = (point.y - origin.y) as f32;
            *z = (point.z - origin.z) as f32;
        }
    }
}

/// A camera at a pose, ready to look at wall points relative to an origin: `x_c = R_wcᵀ x + R_wcᵀ (origin − t_wc)`, then the
/// lens and `u = fx x + cx`, `v = fy y + cy` ([`Camera::project`]).
///
/// Single precision: to about 10⁻⁴ px.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    r_cw: [[f32; 3]; 3],
    centre: [f32; 3],
    focal: [f32; 2],
    principal: [f32; 2],
    lens: SingleLens,
    limit: [f32; 2],
}

impl Look {
    /// The camera at `pose`, for points relative to `origin`.
    pub fn new(camera: &Camera, pose: &Pose, origin: &Vector3<f64>) -> Self {
        let r_wc = pose.r_wc.to_rotation_matrix();
        let r_cw: Matrix3<f32> = r_wc.matrix().transpose().cast();
        Self {
            r_cw: std::array::from_fn(|row| std::array::from_fn(|k| r_cw[(row, k)])),
            centre: pose.to_camera(origin).cast().into(),
            focal: [camera.fx as f32, camera.fy as f32],
            principal: [camera.cx as f32, camera.cy as f32],
            lens: SingleLens::new(camera),
            limit: [(camera.width - 1) as f32, (camera.height - 1) as f32],
        }
    }

    /// The pixel of one of the points, wherever it lies.
    pub fn pixel(&self, points: &Points, at: usize) -> (f32, f32) {
        let (u, v, _) = self.project(self.lens, [points.x[at], points.y[at], points.z[at]]);
        (u, v)
    }

    /// Where point `k` appears, and whether that is within the outermost pixel centres.
    #[inline(always)]
    fn project(&self, lens: impl Bend, [x, y, z]: [f32; 3]) -> (f32, f32, bool) {
        let [a, b, c]: [f32; 3] = std::array::from_fn(|row| {
            let r = &self.r_cw[row];
            self.centre[row] + (r[0] * x + r[1] * y + r[2] * z)
        });
        let (p, q, shown) = lens.bend(a, b, c);
        let u = self.focal[0] * p + self.principal[0];
        let v = self.focal[1] * q + self.principal[1];
        let seen = shown & (u >= 0.0) & (v >= 0.0) & (u <= self.limit[0]) & (v <= self.limit[1]);
        (u, v, seen)
    }
}

/// Where a run of points appears in a frame, and the values there: colour in the first three of four lanes, grey in the
/// first.
pub struct Run {
    u: [f32; RUN],
    v: [f32; RUN],
    seen: [bool; RUN],
    /// Index of the first sample under the kernel.
    first: [u32; RUN],
    /// Tabulated phases along u and v.
    phases: [[i32; RUN]; 2],
    /// True where the kernel lies within the picture.
    inside: [bool; RUN],
    values: [[f32; 4]; RUN],
}

impl Default for Run {
    fn default() -> Self {
        Self {
            u: [0.0; RUN],
            v: [0.0; RUN],
            seen: [false; RUN],
            first: [0; RUN],
            phases: [[0; RUN]; 2],
            inside: [false; RUN],
            values: [[0.0; 4]; RUN],
        }
    }
}

impl Run {
    /// Which of the points the frame shows; after [`Run::sample`], without those whose kernel meets a masked pixel.
    #[inline(always)]
    pub fn seen(&self) -> &[bool; RUN] {
        &self.seen
    }

    /// The pixel coordinates of the points, u and v.
    #[inline(always)]
    pub fn pixels(&self) -> (&[f32; RUN], &[f32; RUN]) {
        (&self.u, &self.v)
    }

    /// The values at the points that the frame shows.
    #[inline(always)]
    pub fn values(&self) -> &[[f32; 4]; RUN] {
        &self.values
    }

    /// The pixel coordinates, which of them are seen, and the values to be changed.
    #[inline(always)]
    #[expect(clippy::type_complexity, reason = "parts of the run, side by side")]
    pub fn parts(&mut self) -> (&[f32; RUN], &[f32; RUN], &[bool; RUN], &mut [[f32; 4]; RUN]) {
        (&self.u, &self.v, &self.seen, &mut self.values)
    }

    /// Finds the pixels of `count` points from index `start`.
    pub fn project(&mut self, look: &Look, points: &Points, start: usize, count: usize) {
        match look.lens {
            SingleLens::Straight(lens) => self.project_through(lens, look, points, start, count),
            SingleLens::Brown(lens) => self.project_through(lens, look, points, start, count),
            SingleLens::Fisheye(lens) => self.project_through(lens, look, points, start, count),
            SingleLens::RollingStraight(lens) => {
                self.project_through(lens, look, points, start, count)
            }
            SingleLens::RollingBrown(lens) => {
                self.project_through(lens, look, points, start, count)
            }
            SingleLens::RollingFisheye(lens) => {
                self.project_through(lens, look, points, start, count)
            }
        }
    }

    fn project_through(
        &mut self,
        lens: impl Bend,
        look: &Look,
        points: &Points,
        start: usize,
        count: usize,
    ) {
        let (x, y, z) = (
            &points.x[start..][..count],
            &points.y[start..][..count],
            &points.z[start..][..count],
        );
        let (u, v, seen) = (
            &mut self.u[..count],
            &mut self.v[..count],
            &mut self.seen[..count],
        );
        wide(
            #[inline(always)]
            || {
                for k in 0..count {
                    (u[k], v[k], seen[k]) = look.project(lens, [x[k], y[k], z[k]]);
                }
            },
        );
    }

    /// Looks up the values of the `count` points projected before.
    pub fn sample(&mut self, picture: &Picture, kernel: &Kernel, count: usize) {
        if picture.mask().is_some() {
            for k in 0..count {
                self.seen[k] = self.seen[k] && picture.shows(self.u[k], self.v[k], kernel);
            }
        }
        wide(
            #[inline(always)]
            || match (picture.samples(), picture.format().channels) {
                (Samples::Eight(samples), 1) => {
                    self.sample_of::<u8, 1>(picture, samples, kernel, count);
                }
                (Samples::Eight(samples), _) => {
                    self.sample_of::<u8, 3>(picture, samples, kernel, count);
                }
                (Samples::Sixteen(samples), 1) => {
                    self.sample_of::<u16, 1>(picture, samples, kernel, count);
                }
                (Samples::Sixteen(samples), _) => {
                    self.sample_of::<u16, 3>(picture, samples, kernel, count);
                }
            },
        );
    }

    #[inline(always)]
    fn sample_of<T: Sample, const C: usize>(
        &mut self,
        picture: &Picture,
        samples: &[T],
        kernel: &Kernel,
        count: usize,
    ) {
        self.address(picture, kernel, count);
        let stride = picture.width() * C;
        match kernel.taps() {
            1 => self.gather::<T, C, 1>(samples, stride, kernel, count),
            2 => self.gather::<T, C, 2>(samples, stride, kernel, count),
            4 => self.gather::<T, C, 4>(samples, stride, kernel, count),
            8 => self.gather::<T, C, 8>(samples, stride, kernel, count),
            12 => self.gather::<T, C, 12>(samples, stride, kernel, count),
            _ => self.inside[..count].fill(false),
        }
        for k in 0..count {
            if self.seen[k] && !self.inside[k] {
                let [red, green, blue] = picture.at(self.u[k], self.v[k], kernel);
                self.values[k] = [red, green, blue, 0.0];
            }
        }
    }

    /// The samples and phases that each point needs.
    #[inline(always)]
    fn address(&mut self, picture: &Picture, kernel: &Kernel, count: usize) {
        let (taps, before) = (kernel.taps() as i32, kernel.before() as i32);
        let (width, height) = (picture.width() as i32, picture.height() as i32);
        let channels = picture.format().channels as i32;
        let rounding = kernel.rounding();
        let (u, v, seen) = (&self.u[..count], &self.v[..count], &self.seen[..count]);
        let (first, inside) = (&mut self.first[..count], &mut self.inside[..count]);
        let [across, down] = &mut self.phases;
        let (across, down) = (&mut across[..count], &mut down[..count]);
        for k in 0..count {
            let (x, s) = whole(u[k] + rounding);
            let (y, t) = whole(v[k] + rounding);
            across[k] = Kernel::phase(s);
            down[k] = Kernel::phase(t);
            let (left, top) = (x - before, y - before);
            inside[k] = seen[k]
                & (left >= 0)
                & (top >= 0)
                & (left <= width - taps)
                & (top <= height - taps);
            first[k] = (top.wrapping_mul(width).wrapping_add(left)).wrapping_mul(channels) as u32;
        }
    }

    /// `Σ_y w_y Σ_x w_x I(x, y)` over `N × N` pixels, where all of them lie in the picture.
    #[inline(always)]
    fn gather<T: Sample, const C: usize, const N: usize>(
        &mut self,
        samples: &[T],
        stride: usize,
        kernel: &Kernel,
        count: usize,
    ) {
        for k in 0..count {
            if !self.inside[k] {
                continue;
            }
            let w_x = kernel.at(self.phases[0][k] as usize).first_chunk();
            let w_y = kernel.at(self.phases[1][k] as usize).first_chunk();
            // A kernel of N taps has N weights.
            let (Some(w_x), Some(w_y)) = (w_x, w_y) else {
                continue;
            };
            let own = &samples[self.first[k] as usize..];
            self.values[k] = if C == 1 {
                [grey::<T, N>(own, stride, w_x, w_y), 0.0, 0.0, 0.0]
            } else {
                colour::<T, N>(own, stride, w_x, w_y)
            };
        }
    }
}

/// A number from 0 to 2²² cut to the whole number below it, and what was cut off; anything for other numbers.
#[inline(always)]
fn whole(value: f32) -> (i32, f32) {
    let nearest = (value + WHOLE) - WHOLE;
    let below = if nearest > value {
        nearest - 1.0
    } else {
        nearest
    };
    (
        ((below + WHOLE).to_bits() & 0x7f_ffff) as i32,
        value - below,
    )
}

/// The grey value under a kernel that begins with the first sample: down the columns first, side by side.
///
/// Arrays of fixed size, here and in [`colour`], are what the compiler makes vectors of.
#[inline(always)]
fn grey<T: Sample, const N: usize>(
    samples: &[T],
    stride: usize,
    w_x: &[f32; N],
    w_y: &[f32; N],
) -> f32 {
    let mut columns = [0.0f32; N];
    for (j, w) in w_y.iter().enumerate() {
        if let Some(row) = samples[j * stride..].first_chunk::<N>() {
            columns = std::array::from_fn(|k| columns[k] + w * row[k].value());
        }
    }
    let mut value = 0.0;
    for (w, column) in w_x.iter().zip(columns) {
        value += w * column;
    }
    value
}

/// The colour under a kernel that begins with the first sample. Pixels are read four samples wide; the fourth lane is the
/// neighbour's and means nothing.
#[inline(always)]
fn colour<T: Sample, const N: usize>(
    samples: &[T],
    stride: usize,
    w_x: &[f32; N],
    w_y: &[f32; N],
) -> [f32; 4] {
    let mut value = [0.0f32; 4];
    for (j, w_y) in w_y.iter().enumerate() {
        let row = &samples[j * stride..][..3 * N + 1];
        let mut sum = [0.0f32; 4];
        for (k, w_x) in w_x.iter().enumerate() {
            if let Some(pixel) = row[3 * k..].first_chunk::<4>() {
                sum = std::array::from_fn(|c| sum[c] + w_x * pixel[c].value());
            }
        }
        value = std::array::from_fn(|c| value[c] + w_y * sum[c]);
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_cut_to_the_whole_below() {
        for (value, below, rest) in [
            (0.0, 0, 0.0),
            (0.75, 0, 0.75),
            (1.0, 1, 0.0),
            (4095.5, 4095, 0.5),
        ] {
            assert_eq!(whole(value), (below, rest));
        }
    }
}
