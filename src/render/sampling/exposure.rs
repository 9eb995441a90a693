//! What light and exposure do to each frame, and its undoing.
//!
//! A frame i shows `I = a_i V(u, v) S + b_i` of the evenly lit wall S: gain a and bias b are the
//! frame's own, V is the shading of lamp and lens, the same in all frames ([`Shading`]). For a wall
//! point x that frame i shows at pixel `u_i(x)` with value z,
//!
//! `ln z_i(x) = ln S(x) + α_i + β_i/m_i(x) + Σ_k c_k B_k(u_i(x)) + noise`
//!
//! to first order in the bias, with `a = e^α`, `b = β`, `ln V = Σ c_k B_k` and `m_i = a_i V S`,
//! what the frame shows but for its bias, by the solution so far. (With z itself in its place,
//! noise on both sides of the equation would look like a bias.) Robust least squares (biweight, S
//! eliminated) over wall points all over the panorama gives all frames at once, so that nothing
//! drifts from neighbour to neighbour.
//!
//! A common factor of gains and wall cannot be seen. It is fixed twice over: V is 1 where it is
//! brightest, and the gains are 1 in the (geometric) mean.
//!
//! Source: D. J. Fixsen, S. H. Moseley and R. G. Arendt, "Calibrating array detectors",
//! Astrophysical Journal Supplement 128, 2000; for panoramas D. B. Goldman, "Vignette and exposure
//! calibration and compensation", PAMI 32(12), 2010.

use super::patch_light::PatchLight as Light;
use super::photometric_samples::{Glimpse, glimpses};
use super::point_batch::PointBatch as Run;
use super::sample::Sample;
use super::thumbnails::Thumbnails;
use crate::frames::{Agreement, MAD_TO_SIGMA, SHADING_TERMS, Shading};
use crate::numerics::simd_dispatch::dispatch_simd;
use crate::render::layout::canvas::Canvas;
use crate::render::layout::placement::Placement;
use crate::render::warp::patches::PATCH_SCALE as SCALE;
use crate::surface::Surface;
use faer::Side;
use faer::prelude::Solve;
use faer::sparse::{SparseColMat, Triplet};
use nalgebra::{DVector, Vector2};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Unknowns of a frame: α, β.
const OWN: usize = 2;
/// 1-σ of α beforehand: a third more or less light.
const GAIN_SIGMA: f64 = 0.3;
/// 1-σ of β beforehand, grey levels.
const BIAS_SIGMA: f64 = 1.0;
/// 1-σ of the shading's coefficients beforehand.
const SHADING_SIGMA: f64 = 0.5;
/// Wall points a frame, and at the least.
const POINTS: (usize, usize) = (40, 20_000);
/// Steps of reweighting.
const STEPS: usize = 4;
/// Variance of a logarithm at the least: pictures without noise.
const LEAST_VARIANCE: f64 = 1e-10;

/// The exposure of all frames.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Exposure {
    frames: Vec<FrameExposure>,
    shading: Option<Table>,
    /// Full scale of the frames over 255.
    scale: f32,
}

/// Exposure of one frame: `I = a V S + b`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FrameExposure {
    /// Gain a.
    pub gain: f64,
    /// Bias b, grey levels of 255.
    pub bias: f64,
}

impl Exposure {
    /// Frames that stay as they are.
    pub fn none(frames: usize) -> Self {
        let own = FrameExposure {
            gain: 1.0,
            bias: 0.0,
        };
        Self {
            frames: vec![own; frames],
            shading: None,
            scale: 1.0,
        }
    }

    /// The exposures that make frames agree where they overlap.
    ///
    /// `white`: full scale of the frames' samples.
    pub fn solve(
        surface: &dyn Surface,
        thumbnails: &Thumbnails,
        placements: &[Placement],
        canvas: &Canvas,
        white: f32,
    ) -> Self {
        let count = placements.len();
        let grid = canvas.coarser((POINTS.0 * count).max(POINTS.1));
        let size = thumbnails.full_size();
        let points = glimpses(surface, thumbnails, placements, &grid);
        let Some(x) = fit(&points, count, size) else {
            return Self {
                scale: white / 255.0,
                ..Self::none(count)
            };
        };
        let own = |k: usize| FrameExposure {
            gain: x[OWN * k].exp(),
            bias: x[OWN * k + 1],
        };
        let terms = std::array::from_fn(|k| x[OWN * count + k]);
        let shading = Shading::none(size).changed(&terms);
        let brightest = shading.range()[1];
        let mean_log = (0..count).map(|k| x[OWN * k]).sum::<f64>() / count as f64;
        let level = mean_log.exp();
        let frames = (0..count).map(|k| FrameExposure {
            gain: own(k).gain / level,
            ..own(k)
        });
        Self {
            frames: frames.collect(),
            shading: Some(Table::new(&shading, brightest, size)),
            scale: white / 255.0,
        }
    }

    /// The frames' gains and biases.
    pub fn frames(&self) -> &[FrameExposure] {
        &self.frames
    }

    /// What undoes the exposure of a frame.
    pub fn of(&self, frame: usize) -> Response<'_> {
        let FrameExposure { gain, bias } = self.frames[frame];
        Response {
            gain: (1.0 / gain) as f32,
            bias: bias as f32 * self.scale,
            shading: self.shading.as_ref(),
        }
    }

    /// The same for thumbnails, which are 16 bits deep.
    pub fn of_thumbnails(&self, thumbnails: &Thumbnails) -> Self {
        let shading = self.shading.clone().map(|table| Table {
            offset: table.scale.map(|s| s * thumbnails.full(0.0)),
            scale: table.scale.map(|s| s * thumbnails.scale()),
            ..table
        });
        Self {
            frames: self.frames.clone(),
            shading,
            scale: u16::WHITE / 255.0,
        }
    }
}

/// Undoes the exposure of one frame: `S = (I − b)/(a V)`.
#[derive(Clone, Copy, Debug)]
pub struct Response<'a> {
    gain: f32,
    bias: f32,
    shading: Option<&'a Table>,
}

impl Response<'_> {
    /// True if there is nothing to undo.
    pub fn is_none(&self) -> bool {
        self.shading.is_none() && self.gain == 1.0 && self.bias == 0.0
    }

    /// The bias, which is taken away before values are multiplied by the light.
    pub fn bias(&self) -> f32 {
        self.bias
    }

    /// What values are multiplied by over a patch, by where its ends and middles appear in the
    /// frame; None if there is nothing to undo.
    pub fn light(&self, pixels: impl FnOnce() -> [[[f32; 2]; 3]; 3]) -> Option<Light> {
        if self.is_none() {
            return None;
        }
        let Some(table) = self.shading else {
            return Some(Light::even(self.gain));
        };
        let at = |[u, v]: [f32; 2]| self.gain * table.at(u, v);
        Some(Light::through(pixels().map(|row| row.map(at))))
    }

    /// Undoes it in the values of some columns of a run that lie in one row of a patch; `first`:
    /// the column where the patch begins.
    pub fn undo_by(
        &self,
        light: &Light,
        row: usize,
        run: &mut Run,
        first: usize,
        columns: Range<usize>,
    ) {
        let [a, b, c] = light.row(row);
        let bias = self.bias;
        let values = &mut run.values_mut()[columns.clone()];
        dispatch_simd(
            #[inline(always)]
            || {
                for (column, value) in columns.clone().zip(values.iter_mut()) {
                    let x = (column - first) as f32 * SCALE - 1.0;
                    let factor = (c * x + b) * x + a;
                    for value in value {
                        *value = (*value - bias) * factor;
                    }
                }
            },
        );
    }

    /// Undoes it in some of the values of a run by where its points appear.
    pub fn undo(&self, run: &mut Run, columns: Range<usize>) {
        if self.is_none() {
            return;
        }
        let (u, v, seen, values) = run.parts();
        let Some(table) = self.shading else {
            for value in values[columns].as_flattened_mut() {
                *value = self.undone(*value, self.gain);
            }
            return;
        };
        let last_column = columns.end.saturating_sub(1);
        dispatch_simd(
            #[inline(always)]
            || {
                // Light changes so slowly that it is looked up at the ends of short steps only.
                for start in columns.clone().step_by(STEP) {
                    let end = (start + STEP).min(columns.end);
                    let last = end.min(last_column);
                    if seen[start] && seen[last] {
                        let first = self.gain * table.at(u[start], v[start]);
                        let change = self.gain * table.at(u[last], v[last]) - first;
                        let slope = change / (last - start).max(1) as f32;
                        for (k, value) in values[start..end].iter_mut().enumerate() {
                            let factor = first + k as f32 * slope;
                            for value in value {
                                *value = self.undone(*value, factor);
                            }
                        }
                    } else {
                        let places = u[start..end].iter().zip(&v[start..end]);
                        for (value, (u, v)) in values[start..end].iter_mut().zip(places) {
                            let factor = self.gain * table.at(*u, *v);
                            for value in value {
                                *value = self.undone(*value, factor);
                            }
                        }
                    }
                }
            },
        );
    }

    /// The value of the evenly lit wall for one of the frame at a pixel.
    pub fn wall(&self, value: f32, u: f32, v: f32) -> f32 {
        let light = self.shading.map_or(1.0, |table| table.at(u, v));
        self.undone(value, self.gain * light)
    }

    #[inline(always)]
    fn undone(&self, value: f32, factor: f32) -> f32 {
        (value - self.bias) * factor
    }
}

/// Points of a run between which light is taken for linear.
const STEP: usize = 8;

/// Nodes of [`Table`] across and down.
const NODES: (usize, usize) = (65, 49);

/// `1/V` at nodes spread over a picture; bilinear between them.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Table {
    values: Vec<f32>,
    /// Nodes per pixel across and down.
    scale: [f32; 2],
    /// Where the first pixel's centre lies, nodes.
    offset: [f32; 2],
}

impl Table {
    fn new(shading: &Shading, brightest: f64, size: (usize, usize)) -> Self {
        let last = |size: usize| (size.max(2) - 1) as f64;
        let pixel =
            |k: usize, nodes: usize, size: usize| k as f64 / (nodes - 1) as f64 * last(size);
        let values = (0..NODES.1).flat_map(|j| {
            (0..NODES.0).map(move |i| {
                let at = Vector2::new(pixel(i, NODES.0, size.0), pixel(j, NODES.1, size.1));
                (brightest / shading.at(&at)) as f32
            })
        });
        let scale = |nodes: usize, size: usize| ((nodes - 1) as f64 / last(size)) as f32;
        Self {
            values: values.collect(),
            scale: [scale(NODES.0, size.0), scale(NODES.1, size.1)],
            offset: [0.0; 2],
        }
    }

    #[inline(always)]
    fn at(&self, u: f32, v: f32) -> f32 {
        // Points that are not seen may be anywhere: the casts saturate, and what comes out is not
        // used.
        let x = u * self.scale[0] + self.offset[0];
        let y = v * self.scale[1] + self.offset[1];
        let (i, j) = ((x as usize).min(NODES.0 - 2), (y as usize).min(NODES.1 - 2));
        let (s, t) = (x - i as f32, y - j as f32);
        let nodes = &self.values[j * NODES.0 + i..][..NODES.0 + 2];
        let upper = nodes[0] + s * (nodes[1] - nodes[0]);
        let lower = nodes[NODES.0] + s * (nodes[NODES.0 + 1] - nodes[NODES.0]);
        upper + t * (lower - upper)
    }
}

/// The unknowns `α_0, β_0, α_1, … c_0, …` of most likelihood; `None` if no two frames overlap.
fn fit(points: &[Vec<Glimpse>], frames: usize, size: (usize, usize)) -> Option<DVector<f64>> {
    if points.is_empty() {
        return None;
    }
    let unknowns = OWN * frames + SHADING_TERMS;
    let mut x = DVector::zeros(unknowns);
    let mut variance = f64::INFINITY;
    for _ in 0..STEPS {
        let parts: Vec<Normal> = points
            .par_chunks(points.len().div_ceil(16))
            .map(|points| {
                let mut normal = Normal::new(frames);
                for point in points {
                    normal.add(&rows_of(point, size, &x), &x, variance);
                }
                normal
            })
            .collect();
        let mut sum = Normal::new(frames);
        for part in parts {
            sum.merge(part);
        }
        variance = sum.variance();
        x = sum.solve(variance)?;
    }
    Some(x)
}

/// One row of the equations.
struct Row {
    frame: usize,
    /// Factors of α and β.
    own: [f64; OWN],
    /// Factors of the shading's coefficients.
    terms: [f64; SHADING_TERMS],
    log: f64,
}

/// The rows of a wall point, with `m_i` by the solution so far.
fn rows_of(point: &[Glimpse], size: (usize, usize), x: &DVector<f64>) -> Vec<Row> {
    let shading = x.len() - SHADING_TERMS;
    let mut rows: Vec<Row> = point
        .iter()
        .map(|glimpse| Row {
            frame: glimpse.frame,
            own: [1.0, 0.0],
            terms: glimpse.terms(size),
            log: f64::from(glimpse.grey).ln(),
        })
        .collect();
    let light = |row: &Row| {
        let terms = row.terms.iter().enumerate();
        x[OWN * row.frame] + terms.map(|(k, term)| term * x[shading + k]).sum::<f64>()
    };
    let wall = rows.iter().map(|row| row.log - light(row)).sum::<f64>() / rows.len() as f64;
    for row in &mut rows {
        row.own[1] = (-wall - light(row)).exp();
    }
    rows
}

/// What two frames have in common in the normal equations.
type Block = [[f64; OWN]; OWN];

/// The normal equations, S eliminated.
struct Normal {
    /// Of each frame i, its blocks with frames j ≥ i, in their order.
    pairs: Vec<Vec<(usize, Block)>>,
    /// Of each unknown of a frame, what it has in common with the shading's.
    border: Vec<[f64; SHADING_TERMS]>,
    /// Of the shading's unknowns, the lower triangle.
    corner: [[f64; SHADING_TERMS]; SHADING_TERMS],
    right: DVector<f64>,
    /// Sizes of the residuals.
    sizes: Vec<f64>,
}

impl Normal {
    fn new(frames: usize) -> Self {
        Self {
            pairs: vec![Vec::new(); frames],
            border: vec![[0.0; SHADING_TERMS]; OWN * frames],
            corner: [[0.0; SHADING_TERMS]; SHADING_TERMS],
            right: DVector::zeros(OWN * frames + SHADING_TERMS),
            sizes: Vec::new(),
        }
    }

    /// Adds a wall point; `x`: the solution so far, `variance`: that of the residuals.
    ///
    /// With `r_i` the rows, `y_i` the logarithms and w the weights:
    /// `N = Σ w r rᵀ − (Σ w r)(Σ w r)ᵀ/Σ w`, likewise the right side.
    fn add(&mut self, point: &[Row], x: &DVector<f64>, variance: f64) {
        let shading = self.border.len();
        let left: Vec<f64> = point
            .iter()
            .map(|row| {
                let first = OWN * row.frame;
                let own: f64 = (0..OWN).map(|k| row.own[k] * x[first + k]).sum();
                let light: f64 = (0..SHADING_TERMS)
                    .map(|k| row.terms[k] * x[shading + k])
                    .sum();
                row.log - own - light
            })
            .collect();
        let Agreement {
            sizes,
            weights,
            total,
        } = Agreement::of(&left, variance);
        self.sizes.extend(sizes);
        if total <= 0.0 {
            return;
        }
        // Rows and right sides relative to their weighted mean: the same as eliminating S.
        let mut mean = [0.0; SHADING_TERMS];
        let mut mean_log = 0.0;
        for (row, w) in point.iter().zip(&weights) {
            for (mean, term) in mean.iter_mut().zip(&row.terms) {
                *mean += w * term / total;
            }
            mean_log += w * row.log / total;
        }
        for (a, (one, w)) in point.iter().zip(&weights).enumerate() {
            let log = one.log - mean_log;
            let terms: [f64; SHADING_TERMS] = std::array::from_fn(|k| one.terms[k] - mean[k]);
            for (k, term) in terms.iter().enumerate() {
                self.right[shading + k] += w * term * log;
                for (entry, other) in self.corner[k].iter_mut().zip(&terms[..=k]) {
                    *entry += w * term * other;
                }
            }
            for (r, value) in one.own.iter().enumerate() {
                let row = OWN * one.frame + r;
                self.right[row] += w * value * log;
                for (entry, term) in self.border[row].iter_mut().zip(&terms) {
                    *entry += w * value * term;
                }
            }
            for (b, (other, w_other)) in point.iter().zip(&weights).enumerate().skip(a) {
                let share = if a == b { *w } else { 0.0 } - w * w_other / total;
                // Frames come in their order.
                let block = self.block(one.frame, other.frame);
                for (r, row) in block.iter_mut().enumerate() {
                    for (c, entry) in row.iter_mut().enumerate() {
                        *entry += share * one.own[r] * other.own[c];
                    }
                }
            }
        }
    }

    /// The block of two frames, i ≤ j.
    fn block(&mut self, i: usize, j: usize) -> &mut Block {
        let others = &mut self.pairs[i];
        let at = others.binary_search_by_key(&j, |(j, _)| *j);
        let at = at.unwrap_or_else(|at| {
            others.insert(at, (j, Block::default()));
            at
        });
        &mut others[at].1
    }

    fn merge(&mut self, other: Self) {
        for (i, others) in other.pairs.into_iter().enumerate() {
            for (j, block) in others {
                let sum = self.block(i, j).as_flattened_mut();
                for (entry, more) in sum.iter_mut().zip(block.as_flattened()) {
                    *entry += more;
                }
            }
        }
        let border = self.border.as_flattened_mut().iter_mut();
        let corner = self.corner.as_flattened_mut().iter_mut();
        for (entry, more) in border.zip(other.border.as_flattened()) {
            *entry += more;
        }
        for (entry, more) in corner.zip(other.corner.as_flattened()) {
            *entry += more;
        }
        self.right += other.right;
        self.sizes.extend(other.sizes);
    }

    /// Variance of the residuals, by their median.
    fn variance(&mut self) -> f64 {
        let half = self.sizes.len() / 2;
        let (_, median, _) = self.sizes.select_nth_unstable_by(half, f64::total_cmp);
        (MAD_TO_SIGMA * *median).powi(2).max(LEAST_VARIANCE)
    }

    /// Solves with the priors; `None` if the matrix is not positive definite.
    fn solve(&self, variance: f64) -> Option<DVector<f64>> {
        let frames = self.border.len();
        let n = self.right.len();
        let prior = |k: usize| {
            let sigma = match (k < frames, k % OWN) {
                (true, 0) => GAIN_SIGMA,
                (true, _) => BIAS_SIGMA,
                (false, _) => SHADING_SIGMA,
            };
            variance / (sigma * sigma)
        };
        // The lower triangle.
        let mut entries: Vec<Triplet<usize, usize, f64>> =
            (0..n).map(|k| Triplet::new(k, k, prior(k))).collect();
        let pairs = self.pairs.iter().enumerate();
        for (i, (j, block)) in pairs.flat_map(|(i, own)| own.iter().map(move |pair| (i, pair))) {
            for (r, row) in block.iter().enumerate() {
                for (c, value) in row.iter().enumerate() {
                    let (row, column) = (OWN * i + r, OWN * j + c);
                    if i < *j {
                        entries.push(Triplet::new(column, row, *value));
                    } else if row >= column {
                        entries.push(Triplet::new(row, column, *value));
                    }
                }
            }
        }
        for k in 0..SHADING_TERMS {
            for row in 0..frames {
                entries.push(Triplet::new(frames + k, row, self.border[row][k]));
            }
            for l in 0..=k {
                entries.push(Triplet::new(frames + k, frames + l, self.corner[k][l]));
            }
        }
        let matrix = SparseColMat::try_new_from_triplets(n, n, &entries).ok()?;
        let factor = matrix.sp_cholesky(Side::Lower).ok()?;
        let right = faer::Col::from_fn(n, |k| self.right[k]);
        let x = factor.solve(&right);
        let x = DVector::from_fn(n, |k, _| x[k]);
        x.iter().all(|v| v.is_finite()).then_some(x)
    }
}
