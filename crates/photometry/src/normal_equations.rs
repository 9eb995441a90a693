//! Sparse normal equations of the photometric calibration, the wall eliminated.

use super::observation::{FRAME_UNKNOWNS, LIGHT_TERMS, Row, Unknowns};
use super::priors::Priors;
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::Llt;
use faer::sparse::{SparseColMat, Triplet};
use faer::{Col, Mat, Side};
use nalgebra::SMatrix;

/// Block of the normal matrix between two frames.
type Block = [[f64; FRAME_UNKNOWNS]; FRAME_UNKNOWNS];

/// Matrix over the light's unknowns.
pub type LightMatrix = SMatrix<f64, LIGHT_TERMS, LIGHT_TERMS>;

/// The normal equations `N x = g`, a block for each pair of frames that overlap and a border for
/// the light.
///
/// With the rows `r_i` of a wall point, their logarithms `y_i` and weights w, eliminating s leaves
///
/// `N = Σ w r rᵀ − (Σ w r)(Σ w r)ᵀ/Σ w`,   `g = Σ w r y − (Σ w r)(Σ w y)/Σ w`.
///
/// Unknowns are in the order `α_0, β_0, α_1, … c_0, …`: the border comes last and causes no fill-in
/// among the frames.
pub struct NormalEquations {
    /// Of each frame i, its blocks with frames j ≥ i, in ascending order of j.
    pairs: Vec<Vec<(usize, Block)>>,
    /// Of each unknown of a frame, its entries with the light's.
    border: Vec<[f64; LIGHT_TERMS]>,
    /// Of the light's unknowns, the lower triangle.
    corner: [[f64; LIGHT_TERMS]; LIGHT_TERMS],
    /// Right side g.
    right: Vec<f64>,
}

/// Solution of the normal equations.
pub struct Solution {
    /// The unknowns.
    pub x: Unknowns,
    factor: Llt<usize, f64>,
}

impl NormalEquations {
    /// No observations.
    pub fn zeros(frames: usize) -> Self {
        Self {
            pairs: vec![Vec::new(); frames],
            border: vec![[0.0; LIGHT_TERMS]; FRAME_UNKNOWNS * frames],
            corner: [[0.0; LIGHT_TERMS]; LIGHT_TERMS],
            right: vec![0.0; FRAME_UNKNOWNS * frames + LIGHT_TERMS],
        }
    }

    /// Adds a wall point; `total`: sum of the `weights`, above 0.
    pub fn add(&mut self, point: &[Row], weights: &[f64], total: f64) {
        let light = self.border.len();
        // Terms and logarithms relative to their weighted mean: the same as eliminating s.
        let mut mean = [0.0; LIGHT_TERMS];
        let mut mean_log = 0.0;
        for (row, w) in point.iter().zip(weights) {
            for (mean, term) in mean.iter_mut().zip(&row.terms) {
                *mean += w * term / total;
            }
            mean_log += w * row.log / total;
        }
        for (a, (one, w)) in point.iter().zip(weights).enumerate() {
            let log = one.log - mean_log;
            let terms: [f64; LIGHT_TERMS] = std::array::from_fn(|k| one.terms[k] - mean[k]);
            for (k, term) in terms.iter().enumerate() {
                self.right[light + k] += w * term * log;
                for (entry, other) in self.corner[k].iter_mut().zip(&terms[..=k]) {
                    *entry += w * term * other;
                }
            }
            for (r, value) in one.own.iter().enumerate() {
                let row = FRAME_UNKNOWNS * one.frame + r;
                self.right[row] += w * value * log;
                for (entry, term) in self.border[row].iter_mut().zip(&terms) {
                    *entry += w * value * term;
                }
            }
            for (b, (other, w_other)) in point.iter().zip(weights).enumerate().skip(a) {
                let share = if a == b { *w } else { 0.0 } - w * w_other / total;
                let (first, second) = if one.frame <= other.frame {
                    (one, other)
                } else {
                    (other, one)
                };
                let block = self.block(first.frame, second.frame);
                for (r, row) in block.iter_mut().enumerate() {
                    for (c, entry) in row.iter_mut().enumerate() {
                        *entry += share * first.own[r] * second.own[c];
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

    /// Adds the sums of other wall points.
    pub fn merge(&mut self, other: Self) {
        for (i, others) in other.pairs.into_iter().enumerate() {
            for (j, block) in others {
                let sum = self.block(i, j).as_flattened_mut();
                add_all(sum, block.as_flattened());
            }
        }
        add_all(self.border.as_flattened_mut(), other.border.as_flattened());
        add_all(self.corner.as_flattened_mut(), other.corner.as_flattened());
        add_all(&mut self.right, &other.right);
    }

    /// Solves `(N + σ² P) x = g − σ² P x₀` with P the inverse variances of the priors, σ² the
    /// `variance` of the residuals, and x₀ the `known` light, to which x is added; `None` if the
    /// matrix is not positive definite.
    pub fn solve(
        &self,
        priors: &Priors,
        variance: f64,
        known: &[f64; LIGHT_TERMS],
    ) -> Option<Solution> {
        let n = self.right.len();
        let matrix = SparseColMat::try_new_from_triplets(n, n, &self.lower(priors, variance));
        let factor = matrix.ok()?.sp_cholesky(Side::Lower).ok()?;
        let light = self.border.len();
        let x = factor.solve(&Col::from_fn(n, |k| match k.checked_sub(light) {
            Some(term) => self.right[k] - self.prior(priors, variance, k) * known[term],
            None => self.right[k],
        }));
        if !x.iter().all(|value| value.is_finite()) {
            return None;
        }
        let frames = self.pairs.len();
        let own = |frame: usize| std::array::from_fn(|k| x[FRAME_UNKNOWNS * frame + k]);
        Some(Solution {
            x: Unknowns {
                frames: (0..frames).map(own).collect(),
                light: std::array::from_fn(|k| x[self.border.len() + k]),
            },
            factor,
        })
    }

    /// The entry of `σ² P` of unknown k.
    fn prior(&self, priors: &Priors, variance: f64, k: usize) -> f64 {
        let own = [priors.log_gain_sigma, priors.bias_sigma_grey];
        let sigma = match k.checked_sub(self.border.len()) {
            None => own[k % FRAME_UNKNOWNS],
            Some(term) => priors.light_sigma(term),
        };
        variance / (sigma * sigma)
    }

    /// Entries of the lower triangle of `N + σ² P`.
    fn lower(&self, priors: &Priors, variance: f64) -> Vec<Triplet<usize, usize, f64>> {
        let border = self.border.len();
        let prior = |k: usize| self.prior(priors, variance, k);
        let diagonal = (0..self.right.len()).map(|k| Triplet::new(k, k, prior(k)));
        let mut entries: Vec<Triplet<usize, usize, f64>> = diagonal.collect();
        let pairs = self.pairs.iter().enumerate();
        for (i, (j, block)) in pairs.flat_map(|(i, own)| own.iter().map(move |pair| (i, pair))) {
            for (r, row) in block.iter().enumerate() {
                for (c, value) in row.iter().enumerate() {
                    let (row, column) = (FRAME_UNKNOWNS * i + r, FRAME_UNKNOWNS * j + c);
                    if i < *j {
                        entries.push(Triplet::new(column, row, *value));
                    } else if row >= column {
                        entries.push(Triplet::new(row, column, *value));
                    }
                }
            }
        }
        for k in 0..LIGHT_TERMS {
            for row in 0..border {
                entries.push(Triplet::new(border + k, row, self.border[row][k]));
            }
            for l in 0..=k {
                entries.push(Triplet::new(border + k, border + l, self.corner[k][l]));
            }
        }
        entries
    }
}

impl Solution {
    /// The light's block of `(N + σ² P)⁻¹`; times σ², the covariance of its unknowns.
    pub fn light_cofactors(&self) -> LightMatrix {
        let border = FRAME_UNKNOWNS * self.x.frames.len();
        let unit = Mat::from_fn(border + LIGHT_TERMS, LIGHT_TERMS, |row, column| {
            if row == border + column { 1.0 } else { 0.0 }
        });
        let columns = self.factor.solve(&unit);
        LightMatrix::from_fn(|row, column| columns[(border + row, column)])
    }
}

/// Adds one list to another, entry by entry.
fn add_all(sum: &mut [f64], more: &[f64]) {
    for (entry, more) in sum.iter_mut().zip(more) {
        *entry += more;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use rand::{Rng, SeedableRng};

    const FRAMES: usize = 5;
    const N: usize = FRAME_UNKNOWNS * FRAMES + LIGHT_TERMS;
    const PRIORS: Priors = Priors {
        log_gain_sigma: 0.3,
        bias_sigma_grey: 1.0,
        shading_sigma: 0.5,
        lamp_sigma: 0.5,
    };
    const VARIANCE: f64 = 1e-3;

    /// Wall points that two to four frames show, in no order, with weights.
    fn points() -> Vec<(Vec<Row>, Vec<f64>)> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        (0..200)
            .map(|point| {
                let count = 2 + point % 3;
                let row = |k: usize| Row {
                    frame: (3 * point + 2 * k) % FRAMES,
                    own: [1.0, rng.random_range(0.005..0.02)],
                    terms: std::array::from_fn(|_| rng.random_range(-1.0..1.0)),
                    log: rng.random_range(4.0..5.0),
                };
                let rows: Vec<Row> = (0..count).map(row).collect();
                let weights = (0..count).map(|_| rng.random_range(0.1..1.0));
                let weights = weights.collect();
                (rows, weights)
            })
            .collect()
    }

    /// A row with all unknowns.
    fn dense(row: &Row) -> DVector<f64> {
        let mut all = DVector::zeros(N);
        for (k, regressor) in row.own.iter().enumerate() {
            all[FRAME_UNKNOWNS * row.frame + k] = *regressor;
        }
        for (k, term) in row.terms.iter().enumerate() {
            all[FRAME_UNKNOWNS * FRAMES + k] = *term;
        }
        all
    }

    fn flat(x: &Unknowns) -> DVector<f64> {
        let own = x.frames.as_flattened().iter();
        DVector::from_iterator(N, own.chain(&x.light).copied())
    }

    /// `min_s Σ w (y − s − rᵀx)²` over all points.
    fn cost(points: &[(Vec<Row>, Vec<f64>)], x: &DVector<f64>) -> f64 {
        let of_point = |(rows, weights): &(Vec<Row>, Vec<f64>)| {
            let left: Vec<f64> = rows.iter().map(|row| row.log - dense(row).dot(x)).collect();
            let total: f64 = weights.iter().sum();
            let pairs = || weights.iter().zip(&left);
            let wall = pairs().map(|(w, e)| w * e).sum::<f64>() / total;
            pairs().map(|(w, e)| w * (e - wall).powi(2)).sum::<f64>()
        };
        points.iter().map(of_point).sum()
    }

    fn normal(points: &[(Vec<Row>, Vec<f64>)]) -> NormalEquations {
        let (first, second) = points.split_at(points.len() / 3);
        let [mut sum, more] = [first, second].map(|points| {
            let mut normal = NormalEquations::zeros(FRAMES);
            for (rows, weights) in points {
                normal.add(rows, weights, weights.iter().sum());
            }
            normal
        });
        sum.merge(more);
        sum
    }

    /// Gradient and curvature of the cost with the prior, by central differences (exact: the cost
    /// is quadratic).
    #[test]
    fn the_solution_is_the_minimum_of_the_cost() {
        let points = points();
        let solution = normal(&points)
            .solve(&PRIORS, VARIANCE, &[0.0; LIGHT_TERMS])
            .unwrap();
        let x = flat(&solution.x);
        let sigma = |k: usize| match k.checked_sub(FRAME_UNKNOWNS * FRAMES) {
            Some(term) => PRIORS.light_sigma(term),
            None => [PRIORS.log_gain_sigma, PRIORS.bias_sigma_grey][k % FRAME_UNKNOWNS],
        };
        let all = |x: &DVector<f64>| {
            let prior = (0..N).map(|k| (x[k] / sigma(k)).powi(2)).sum::<f64>();
            cost(&points, x) + VARIANCE * prior
        };
        let step = 1e-3;
        for k in 0..N {
            let moved = |amount: f64| {
                let mut x = x.clone();
                x[k] += amount;
                all(&x)
            };
            let slope = (moved(step) - moved(-step)) / (2.0 * step);
            assert!(slope.abs() < 1e-7, "unknown {k}: {slope}");
        }
    }

    #[test]
    fn the_sparse_matrix_is_the_dense_one() {
        let points = points();
        let mut matrix = DMatrix::zeros(N, N);
        for (rows, weights) in &points {
            let mut sum = DVector::zeros(N);
            for (row, w) in rows.iter().zip(weights) {
                let row = dense(row);
                matrix += *w * &row * row.transpose();
                sum += *w * row;
            }
            matrix -= &sum * sum.transpose() / weights.iter().sum::<f64>();
        }
        for k in 0..N {
            let sigma = match k.checked_sub(FRAME_UNKNOWNS * FRAMES) {
                Some(term) => PRIORS.light_sigma(term),
                None => [PRIORS.log_gain_sigma, PRIORS.bias_sigma_grey][k % FRAME_UNKNOWNS],
            };
            matrix[(k, k)] += VARIANCE / (sigma * sigma);
        }
        let normal = normal(&points);
        let mut sparse = DMatrix::zeros(N, N);
        for entry in normal.lower(&PRIORS, VARIANCE) {
            assert!(entry.row >= entry.col);
            sparse[(entry.row, entry.col)] += entry.val;
        }
        sparse.fill_upper_triangle_with_lower_triangle();
        assert!((&sparse - &matrix).amax() < 1e-10);
        let cofactors = normal
            .solve(&PRIORS, VARIANCE, &[0.0; LIGHT_TERMS])
            .unwrap()
            .light_cofactors();
        let inverse = matrix.try_inverse().unwrap();
        let expected = inverse.view_range(FRAME_UNKNOWNS * FRAMES.., FRAME_UNKNOWNS * FRAMES..);
        assert!((cofactors - expected).amax() < 1e-8 * expected.amax());
    }
}
