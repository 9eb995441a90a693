//! Masked normalised cross-correlation of an unwrapped frame with the reference mosaic, over all
//! shifts at once.
//!
//! Both are compared by their local contrast ([`tunnelstitch_core::frames::local_contrast`]),
//! normalised over the samples that both show: with masks m,
//!
//! `c(d) = Σ A(x) W(x+d) / √(Σ A²(x) m_W(x+d) · Σ m_A(x) W²(x+d))`.
//!
//! Source: J. P. Lewis, "Fast normalized cross-correlation", 1995 (correlation by transform); D.
//! Padfield, "Masked object registration in the Fourier domain", IEEE Trans. Image Processing
//! 21(5), 2012 (masks).

use crate::comparison::unwrapped_frame::UnwrappedFrame;
use crate::tracking::reference_mosaic::ReferenceMosaic;
use nalgebra::Vector2;
use tunnelstitch_geometry::numerics::spectrum::{Spectrum, Transform};
use tunnelstitch_geometry::trajectory::Pose;

/// A local maximum of the correlation over shifts.
pub struct CorrelationMaximum {
    /// Shift, samples.
    pub shift: Vector2<f64>,
    /// Correlation there.
    pub correlation: f64,
    /// Samples that both show.
    pub samples: f64,
}

/// The spectra of the mosaic, with which frames are correlated over shifts up to a reach.
pub struct Correlator {
    transform: Transform,
    /// Largest shifts along s and h, samples.
    reach: (usize, usize),
    contrast: Spectrum,
    square: Spectrum,
    mask: Spectrum,
}

impl Correlator {
    /// Transforms the mosaic, for shifts up to `reach` samples along s and h.
    pub fn new(mosaic: &ReferenceMosaic, reach: (usize, usize)) -> Self {
        let grid = &mosaic.grid;
        // Padded by the reach, so that nothing wraps around from the other end.
        let transform = Transform::at_least(grid.columns + reach.0, grid.rows + reach.1);
        let spectrum = |value: fn(f32) -> f32| {
            let raster = pad_raster(&transform, grid.columns, &mosaic.contrast, value);
            transform.forward(raster)
        };
        Self {
            contrast: spectrum(|v| v),
            square: spectrum(|v| v * v),
            mask: spectrum(|_| 1.0),
            transform,
            reach,
        }
    }

    /// The local maxima of the correlation of the frame at `pose` over shifts.
    pub fn find_maxima(
        &self,
        mosaic: &ReferenceMosaic,
        unwrapped: &UnwrappedFrame,
        pose: &Pose,
    ) -> Vec<CorrelationMaximum> {
        let contrast = unwrapped.contrast_at(pose, &mosaic.origin);
        let values: Vec<f32> = mosaic
            .points
            .iter()
            .zip(&mosaic.is_resolved)
            .map(|(point, is_resolved)| {
                if *is_resolved {
                    contrast(point).unwrap_or(f32::NAN)
                } else {
                    f32::NAN
                }
            })
            .collect();
        let transform = &self.transform;
        let columns = mosaic.grid.columns;
        let spectrum = |value: fn(f32) -> f32| {
            transform.forward(pad_raster(transform, columns, &values, value))
        };
        let (contrast, square, mask) = (spectrum(|v| v), spectrum(|v| v * v), spectrum(|_| 1.0));
        let (reach_s, reach_h) = (self.reach.0 as i64, self.reach.1 as i64);
        // A maximum is compared with the shifts around it.
        let shifts = -reach_h - 1..reach_h + 2;
        let correlate = |a, b| transform.correlate(a, b, shifts.clone());
        let product = correlate(&contrast, &self.contrast);
        let frame_energy = correlate(&square, &self.mask);
        let mosaic_energy = correlate(&mask, &self.square);
        let samples = correlate(&mask, &self.mask);
        let width = transform.columns as i64;
        let index = |ds: i64, dh: i64| ((dh + reach_h + 1) * width + ds.rem_euclid(width)) as usize;
        let correlation = |ds: i64, dh: i64| -> f32 {
            let k = index(ds, dh);
            let energy = (frame_energy[k] * mosaic_energy[k]).max(0.0).sqrt();
            if samples[k] < 1.0 || energy <= 0.0 {
                -1.0
            } else {
                product[k] / energy
            }
        };
        let mut maxima = Vec::new();
        for dh in -reach_h..=reach_h {
            for ds in -reach_s..=reach_s {
                let c = correlation(ds, dh);
                let is_maximum = c > 0.0
                    && (-1..=1).all(|y| {
                        (-1..=1).all(|x| (x, y) == (0, 0) || correlation(ds + x, dh + y) <= c)
                    });
                if is_maximum {
                    maxima.push(CorrelationMaximum {
                        shift: Vector2::new(ds as f64, dh as f64),
                        correlation: f64::from(c),
                        samples: f64::from(samples[index(ds, dh)]),
                    });
                }
            }
        }
        maxima
    }
}

/// Copies the values of a grid into a raster of the transform's size; 0 where there is none.
fn pad_raster(
    transform: &Transform,
    columns: usize,
    values: &[f32],
    value: fn(f32) -> f32,
) -> Vec<f32> {
    let mut raster = vec![0.0; transform.columns * transform.rows];
    let rows = raster.chunks_exact_mut(transform.columns);
    for (row, values) in rows.zip(values.chunks_exact(columns)) {
        for (cell, v) in row.iter_mut().zip(values) {
            if !v.is_nan() {
                *cell = value(*v);
            }
        }
    }
    raster
}
