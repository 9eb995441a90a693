//! The most likely fine pixels, given what frames show of them.

use super::footprints::Footprints;
use super::roughness::{KINDS, Roughness};
use crate::frames::MAD_TO_SIGMA;
use crate::vectors::wide;

/// Rounds of solving and learning how rough the wall is.
const ROUNDS: usize = 4;
/// Steps of conjugate gradients a round.
const STEPS: usize = 10;
/// Huber's loss is quadratic up to this many σ.
const HUBER: f32 = 2.0;

impl Footprints {
    /// TODO
    pub fn solve(&self, values: &[&[f32]], noise: &[f32], start: &[f32]) -> Vec<f32> {
        let mut problem = Problem::new(self, values, noise);
        problem.solve(start)
    }
}

struct Problem<'a> {
    footprints: &'a Footprints,
    /// Values over noise and noise precision of each view's pixels.
    values: Vec<Vec<f32>>,
    precision: Vec<Vec<f32>>,
    omega: Vec<Vec<f32>>,
    seen: Vec<bool>,
}

impl<'a> Problem<'a> {
    fn new(footprints: &'a Footprints, values: &[&[f32]], noise: &[f32]) -> Self {
        let pixels = footprints.region.pixels();
        let mut weight = vec![0.0f32; pixels];
        let (mut read, mut precisions) = (Vec::new(), Vec::new());
        for ((stencils, values), noise) in footprints.views.iter().zip(values).zip(noise) {
            let found: Vec<f32> = stencils.pixels.iter().map(|p| values[*p as usize]).collect();
            let precision: Vec<f32> = found
                .iter()
                .map(|v| if v.is_finite() { 1.0 / (noise * noise) } else { 0.0 })
                .collect();
            let ones: Vec<f32> = precision.iter().map(|p| if *p > 0.0 { 1.0 } else { 0.0 }).collect();
            stencils.spread(&ones, &mut weight);
            read.push(found.iter().map(|v| if v.is_finite() { *v } else { 0.0 }).collect());
            precisions.push(precision);
        }
        Self {
            footprints,
            values: read,
            omega: precisions.clone(),
            precision: precisions,
            seen: weight.iter().map(|w| *w > 0.05).collect(),
        }
    }

    fn solve(&mut self, start: &[f32]) -> Vec<f32> {
        let region = self.footprints.region;
        let n = region.pixels();
        let known: Vec<f32> = start.iter().copied().filter(|v| v.is_finite()).collect();
        let mean = known.iter().sum::<f32>() / known.len().max(1) as f32;
        let mut x: Vec<f32> = start.iter().map(|v| if v.is_finite() { *v } else { mean }).collect();
        let mut rough = Roughness::new(region.columns, region.rows, &self.seen);
        let n_seen = self.seen.iter().filter(|s| **s).count() as f64;
        let energies = rough.products(&x, &x);
        for kind in 0..KINDS {
            rough.strengths[kind] = n_seen / KINDS as f64 / energies[kind].max(1e-6 * n_seen);
        }
        let probe: Vec<f32> = (0..n).map(|k| {
            let s = hash(k as u64);
            if self.seen[k] { s } else { 0.0 }
        }).collect();
        let mut u = vec![0.0; n];
        let mut scale = 1.0f32;
        let observed: f64 = self.precision.iter().flatten().filter(|p| **p > 0.0).count() as f64;
        let mut gamma_all = 0.0;
        let debug = std::env::var("SR_DEBUG").is_ok();
        let huber_prior: f32 = std::env::var("SR_HP").ok().and_then(|v| v.parse().ok()).unwrap_or(0.0);
        let rounds: usize = std::env::var("SR_ROUNDS").ok().and_then(|v| v.parse().ok()).unwrap_or(ROUNDS);
        let steps: usize = std::env::var("SR_STEPS").ok().and_then(|v| v.parse().ok()).unwrap_or(STEPS);
        for round in 0..rounds {
            if round > 0 {
                let residuals = self.residuals(&x);
                let mut all: Vec<f32> = residuals.iter().flatten().filter(|r| !r.is_nan()).map(|r| r.abs()).collect();
                if all.is_empty() { break; }
                let middle = all.len() / 2;
                let mad = MAD_TO_SIGMA as f32 * *all.select_nth_unstable_by(middle, f32::total_cmp).1;
                let left = (1.0 - gamma_all / observed).max(0.05) as f32;
                scale = (mad * mad / left).max(1.0);
                if debug { eprintln!("round {round}: mad {mad:.3} left {left:.3} scale {scale:.3} strengths {:?} gamma {gamma_all:.0} n {n_seen} obs {observed}", rough.strengths.map(|a| (1e4*a).round()/1e4)); }
                let limit = HUBER * mad.max(left.sqrt());
                for ((omega, precision), r) in self.omega.iter_mut().zip(&self.precision).zip(&residuals) {
                    for ((o, p), r) in omega.iter_mut().zip(precision).zip(r) {
                        *o = if *p > 0.0 { p / scale * (limit / r.abs()).min(1.0) } else { 0.0 };
                    }
                }
                if huber_prior > 0.0 {
                    let mut d = vec![0.0; n];
                    for kind in 0..KINDS {
                        rough.differences(kind, &x, &mut d);
                        let w = &mut rough.weights[kind];
                        let mut all: Vec<f32> = d.iter().zip(w.iter()).filter(|(_, w)| **w > 0.0).map(|(d, _)| d.abs()).collect();
                        if all.is_empty() { continue; }
                        let middle = all.len() / 2;
                        let limit = huber_prior * MAD_TO_SIGMA as f32 * *all.select_nth_unstable_by(middle, f32::total_cmp).1;
                        for (w, d) in w.iter_mut().zip(&d) {
                            if *w > 0.0 { *w = (limit / d.abs()).min(1.0).max(1e-4); }
                        }
                    }
                }
            }
            let mut right = vec![0.0; n];
            for ((stencils, omega), values) in self.footprints.views.iter().zip(&self.omega).zip(&self.values) {
                let weighted: Vec<f32> = omega.iter().zip(values).map(|(o, v)| o * v).collect();
                stencils.spread(&weighted, &mut right);
            }
            self.improve(&rough, &right, steps, &mut x);
            self.improve(&rough, &probe, steps, &mut u);
            let (energies, traces, shares) = (rough.products(&x, &x), rough.products(&u, &probe), rough.shares());
            gamma_all = 0.0;
            for kind in 0..KINDS {
                let a = rough.strengths[kind];
                let gamma = (shares[kind] * n_seen - a * traces[kind]).max(1e-3 * n_seen);
                gamma_all += gamma;
                rough.strengths[kind] = (gamma / energies[kind].max(1e-9 * n_seen)).clamp(0.1 * a, 10.0 * a);
            }
        }
        x.iter().zip(&self.seen).zip(start).map(|((x, seen), start)| if *seen { *x } else { *start }).collect()
    }

    fn residuals(&self, x: &[f32]) -> Vec<Vec<f32>> {
        let views = self.footprints.views.iter().zip(&self.values).zip(&self.precision);
        views.map(|((stencils, values), precision)| {
            let mut read = Vec::new();
            stencils.read(x, &mut read);
            read.iter().zip(values).zip(precision).map(|((r, v), p)| if *p > 0.0 { (v - r) * p.sqrt() } else { f32::NAN }).collect()
        }).collect()
    }

    fn improve(&self, rough: &Roughness, right: &[f32], steps: usize, x: &mut [f32]) {
        let n = x.len();
        let mut scratch = vec![0.0; n];
        let mut times = |x: &[f32], y: &mut [f32]| {
            y.fill(0.0);
            for (stencils, omega) in self.footprints.views.iter().zip(&self.omega) {
                wide(
                    #[inline(always)]
                    || stencils.add_normal(omega, x, y),
                );
            }
            rough.add_to(x, &mut scratch, y);
        };
        let mut diagonal = vec![0.0; n];
        for (stencils, omega) in self.footprints.views.iter().zip(&self.omega) {
            stencils.add_diagonal(omega, &mut diagonal);
        }
        rough.add_diagonal(&mut diagonal);
        for d in &mut diagonal {
            *d = if *d > 0.0 { 1.0 / *d } else { 1.0 };
        }
        let mut product = vec![0.0; n];
        times(x, &mut product);
        let mut residual: Vec<f32> = right.iter().zip(&product).map(|(b, p)| b - p).collect();
        let mut direction = vec![0.0f32; n];
        let mut last = 0.0;
        for step in 0..steps {
            let rho: f64 = residual.iter().zip(&diagonal).map(|(r, d)| f64::from(r * r * d)).sum();
            if rho <= 0.0 || !rho.is_finite() {
                break;
            }
            let beta = if step == 0 { 0.0 } else { (rho / last) as f32 };
            last = rho;
            for ((p, r), d) in direction.iter_mut().zip(&residual).zip(&diagonal) {
                *p = d * r + beta * *p;
            }
            times(&direction, &mut product);
            let curvature: f64 = direction.iter().zip(&product).map(|(p, q)| f64::from(p * q)).sum();
            if curvature <= 0.0 { break; }
            let alpha = (rho / curvature) as f32;
            for k in 0..n {
                x[k] += alpha * direction[k];
                residual[k] -= alpha * product[k];
            }
        }
    }
}

fn hash(k: u64) -> f32 {
    let mut z = k.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    if (z ^ (z >> 31)) & 1 == 0 { 1.0 } else { -1.0 }
}
