//! Observations of wall points and their rows of the linear equation.

use super::robust_weights::{RobustWeights, median};
use nalgebra::Vector2;
use std::ops::Range;
use tunnelstitch_core::frames::{LAMP_TERMS, SHADING_TERMS, shading_terms};

/// Grey values of a frame, of 255, that determine a factor: a darker one is mostly bias and noise,
/// a brighter one may be clipped.
const USABLE_GREY: Range<f32> = 4.0..250.0;
/// Smallest share of a value that remains when the bias is taken off.
const MIN_VALUE_SHARE: f64 = 0.1;

/// Unknowns of the light that all frames share: coefficients of the shading, then the lamp's.
pub const LIGHT_TERMS: usize = SHADING_TERMS + LAMP_TERMS;

/// Unknowns of a frame: α, β.
pub const FRAME_UNKNOWNS: usize = 2;

/// One frame's observation of a wall point. A point has at most one of every frame.
#[derive(Clone, Copy, Debug)]
pub struct Observation {
    /// The frame, counted from 0 among those calibrated.
    pub frame: usize,
    /// The pixel at which the point appears, of the frame's full size.
    pixel: [f32; 2],
    /// `z`, the value without the known bias and the known factor.
    value: f32,
    /// `f`, the known part of gain and light.
    factor: f32,
    /// Derivatives of the logarithm of the light by the lamp's unknowns.
    lamp: [f32; LAMP_TERMS],
}

impl Observation {
    /// The pixel at which the point appears, of the frame's full size.
    pub fn pixel(&self) -> Vector2<f64> {
        Vector2::from(self.pixel).cast()
    }

    /// An observation of the value `z = (I − bias)/f`; `None` if the frame is too dark there to
    /// determine a factor or so bright that it may be clipped.
    pub fn new(frame: usize, pixel: [f32; 2], value: f32, factor: f32) -> Option<Self> {
        USABLE_GREY.contains(&(value * factor)).then_some(Self {
            frame,
            pixel,
            value,
            factor,
            lamp: [0.0; LAMP_TERMS],
        })
    }

    /// The observation with the derivatives of the logarithm of the light by the lamp's unknowns
    /// ([`tunnelstitch_core::frames::Lamp::log_falloff`]); without, there is no lamp.
    pub fn with_lamp(self, terms: [f64; LAMP_TERMS]) -> Self {
        Self {
            lamp: terms.map(|term| term as f32),
            ..self
        }
    }

    /// The observation as one of another frame.
    pub fn in_frame(self, frame: usize) -> Self {
        Self { frame, ..self }
    }

    /// The observation in a light whose logarithm `log_light` there is known, too.
    pub fn in_light(self, log_light: f64) -> Self {
        let light = log_light.exp();
        Self {
            value: (f64::from(self.value) / light) as f32,
            factor: (f64::from(self.factor) * light) as f32,
            ..self
        }
    }

    /// Regressors of the light: `B_k`, then the lamp's.
    fn terms(&self, size: (usize, usize)) -> [f64; LIGHT_TERMS] {
        let shading = shading_terms(&self.pixel(), size);
        std::array::from_fn(|k| match k.checked_sub(SHADING_TERMS) {
            Some(lamp) => f64::from(self.lamp[lamp]),
            None => shading[k],
        })
    }
}

/// The unknowns of all frames and of the light.
#[derive(Clone, Debug)]
pub struct Unknowns {
    /// `α_i, β_i`.
    pub frames: Vec<[f64; FRAME_UNKNOWNS]>,
    /// `c_k`: coefficients of the shading, then the lamp's unknowns.
    pub light: [f64; LIGHT_TERMS],
}

impl Unknowns {
    /// Nothing missing from what is known.
    pub fn zeros(frames: usize) -> Self {
        Self {
            frames: vec![[0.0; FRAME_UNKNOWNS]; frames],
            light: [0.0; LIGHT_TERMS],
        }
    }
}

/// One observation's row of the linear equation.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// The frame.
    pub frame: usize,
    /// Regressors of α and β: `1, 1/(f m)`.
    pub own: [f64; FRAME_UNKNOWNS],
    /// Regressors of the light's unknowns: `B_k`, then the lamp's.
    pub terms: [f64; LIGHT_TERMS],
    /// `ln(z − β/f) + β/(f m)` with the bias β of the solution so far: `ln z` to first order.
    pub log: f64,
}

/// A wall point, linearised at the solution so far.
pub struct LinearisedPoint {
    /// A row for each observation.
    pub rows: Vec<Row>,
    /// Their weights, and their residuals in grey levels of the frame.
    pub robust: RobustWeights,
}

impl LinearisedPoint {
    /// Linearises the equation of at least two observations in pictures of `size` pixels at the
    /// solution so far; `variance`: that of the residuals, grey levels².
    ///
    /// Each observation reads the wall as `s_i = ln(z_i − β_i/f_i) − α_i − Σ c_k B_k`. Their median
    /// gives a first model value, the residuals in grey levels and the weights; their weighted mean
    /// s gives the model value `m_i = exp(s + α_i + Σ c_k B_k)` of the regressors. With the weights
    /// of the inverse variance, the noise of s has the same covariance with that of every
    /// observation, so that it is independent of what is left once s is eliminated.
    pub fn new(point: &[Observation], size: (usize, usize), x: &Unknowns, variance: f64) -> Self {
        let readings = point.iter().map(|one| WallReading::new(one, size, x));
        let readings: Vec<WallReading> = readings.collect();
        let logs: Vec<f64> = readings.iter().map(WallReading::log_wall).collect();
        let middle = median(&logs);
        let greys = readings.iter().map(|reading| reading.model_grey(middle));
        let greys: Vec<f64> = greys.collect();
        let robust = RobustWeights::of(&logs, middle, &greys, variance);
        let weighted = logs.iter().zip(&robust.weights);
        let wall = if robust.total > 0.0 {
            weighted.map(|(s, w)| w * s).sum::<f64>() / robust.total
        } else {
            middle
        };
        let rows = readings.iter().map(|reading| reading.row(wall)).collect();
        Self { rows, robust }
    }
}

/// An observation's reading of the wall by the solution so far.
struct WallReading {
    frame: usize,
    terms: [f64; LIGHT_TERMS],
    factor: f64,
    /// `ln(z − β/f)`.
    log: f64,
    /// `α + Σ c_k B_k`.
    light: f64,
    /// β.
    bias: f64,
}

impl WallReading {
    fn new(observation: &Observation, size: (usize, usize), x: &Unknowns) -> Self {
        let terms = observation.terms(size);
        let [log_gain, bias] = x.frames[observation.frame];
        let (value, factor) = (f64::from(observation.value), f64::from(observation.factor));
        let light: f64 = terms.iter().zip(&x.light).map(|(t, c)| t * c).sum();
        Self {
            frame: observation.frame,
            light: log_gain + light,
            terms,
            factor,
            log: (value - bias / factor).max(MIN_VALUE_SHARE * value).ln(),
            bias,
        }
    }

    /// `s_i`: the logarithm of the wall as this observation reads it.
    fn log_wall(&self) -> f64 {
        self.log - self.light
    }

    /// `f m`, grey levels of the frame, for a wall whose logarithm is `wall`; also the derivative
    /// of the grey value with respect to that logarithm.
    fn model_grey(&self, wall: f64) -> f64 {
        self.factor * (wall + self.light).exp()
    }

    /// The row of the equation for a wall whose logarithm is `wall`.
    fn row(&self, wall: f64) -> Row {
        let bias_regressor = 1.0 / self.model_grey(wall);
        Row {
            frame: self.frame,
            own: [1.0, bias_regressor],
            terms: self.terms,
            log: self.log + bias_regressor * self.bias,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (64, 48);
    /// Grey value of the wall.
    const WALL: f64 = 100.0;

    /// The exact equation: `ln(S exp(α + Σ c B) + β/f)`.
    fn exact_log(observation: &Observation, wall: f64, x: &Unknowns) -> f64 {
        let terms = observation.terms(SIZE);
        let light: f64 = terms.iter().zip(&x.light).map(|(t, c)| t * c).sum();
        let [log_gain, bias] = x.frames[observation.frame];
        (wall * (log_gain + light).exp() + bias / f64::from(observation.factor)).ln()
    }

    fn without_bias() -> (Unknowns, [([f32; 2], f32); 2]) {
        let mut x = Unknowns::zeros(2);
        x.frames = vec![[0.1, 0.0], [-0.2, 0.0]];
        x.light = std::array::from_fn(|k| 0.05 * (k as f64).cos());
        (x, [([10.0, 40.0], 0.5), ([50.0, 20.0], 1.5)])
    }

    /// Observations of a wall point by two frames.
    fn point(wall: f64, x: &Unknowns, places: [([f32; 2], f32); 2]) -> Vec<Observation> {
        let seen = (0..).zip(places).map(|(frame, (pixel, factor))| {
            let seen = Observation::new(frame, pixel, 60.0, factor).unwrap();
            let mut seen = seen.with_lamp([0.4, -0.3, frame as f64]);
            seen.value = exact_log(&seen, wall, x).exp() as f32;
            seen
        });
        seen.collect()
    }

    #[test]
    fn regressors_are_the_derivatives_of_the_exact_equation() {
        let (x, places) = without_bias();
        let point = point(WALL, &x, places);
        let rows = LinearisedPoint::new(&point, SIZE, &x, 1.0).rows;
        let step = 1e-4;
        for (row, seen) in rows.iter().zip(&point) {
            let slope = |change: &dyn Fn(&mut Unknowns, f64)| {
                let [plus, minus] = [step, -step].map(|step| {
                    let mut x = x.clone();
                    change(&mut x, step);
                    exact_log(seen, WALL, &x)
                });
                (plus - minus) / (2.0 * step)
            };
            for (k, regressor) in row.own.iter().enumerate() {
                let expected = slope(&|x, step| x.frames[seen.frame][k] += step);
                assert!(
                    (regressor - expected).abs() < 1e-7,
                    "{regressor} {expected}"
                );
            }
            for (k, regressor) in row.terms.iter().enumerate() {
                let expected = slope(&|x, step| x.light[k] += step);
                assert!(
                    (regressor - expected).abs() < 1e-7,
                    "{regressor} {expected}"
                );
            }
            assert!((row.log - exact_log(seen, WALL, &x)).abs() < 1e-6);
        }
    }

    /// The bias of the solution so far is no part of the model value.
    #[test]
    fn regressors_are_taken_at_the_value_without_bias() {
        let (mut x, places) = without_bias();
        for (own, bias) in x.frames.iter_mut().zip([4.0, -3.0]) {
            own[1] = bias;
        }
        let point = point(WALL, &x, places);
        let linearised = LinearisedPoint::new(&point, SIZE, &x, 1.0);
        for (row, seen) in linearised.rows.iter().zip(&point) {
            let bias = x.frames[seen.frame][1] / f64::from(seen.factor);
            let expected = 1.0 / (f64::from(seen.factor) * (f64::from(seen.value) - bias));
            assert!((row.own[1] - expected).abs() < 1e-6 * expected);
        }
    }

    #[test]
    fn dark_and_clipped_values_are_not_observed() {
        let seen = |value, factor| Observation::new(0, [0.0; 2], value, factor).is_some();
        assert!(seen(100.0, 1.0) && seen(300.0, 0.5));
        assert!(!seen(3.0, 1.0) && !seen(6.0, 0.5) && !seen(252.0, 1.0) && !seen(200.0, 1.3));
    }
}
