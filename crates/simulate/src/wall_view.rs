//! The wall as one frame sees it: rasters of one or more levels of detail.

use crate::wall_raster::{BATCH_POINTS, WallRaster};
use crate::wall_stretches::WallStretch;
use nalgebra::Vector3;

/// Rasters of the wall from which some frames are cast, one for each zone.
pub(super) struct WallRasters(Vec<(i32, WallRaster)>);

impl WallRasters {
    /// Paints the stretches of wall.
    pub fn new(stretches: &[WallStretch], paint: impl Fn(&WallStretch) -> WallRaster) -> Self {
        let rasters = stretches.iter();
        Self(
            rasters
                .map(|stretch| (stretch.zone, paint(stretch)))
                .collect(),
        )
    }

    /// The rasters of one zone after the other that a frame with these stretches sees, in ascending
    /// order.
    pub fn view(&self, stretches: &[WallStretch]) -> WallView<'_> {
        let raster = |stretch: &WallStretch| {
            let (_, raster) = self.0.iter().find(|(zone, _)| *zone == stretch.zone)?;
            Some((stretch.h_m[1], raster))
        };
        WallView {
            parts: stretches.iter().filter_map(raster).collect(),
        }
    }
}

/// Rasters of ascending chainage, each with the chainage up to which it is used, metres.
pub(super) struct WallView<'a> {
    parts: Vec<(f64, &'a WallRaster)>,
}

impl<'a> WallView<'a> {
    /// A wall of one raster.
    #[cfg(test)]
    pub fn of(raster: &'a WallRaster) -> Self {
        Self {
            parts: vec![(f64::INFINITY, raster)],
        }
    }

    /// The raster that holds all the given chainages, if there is one.
    #[inline(always)]
    fn common_raster(&self, h_m: &[f64]) -> Option<&WallRaster> {
        if let [(_, raster)] = &self.parts[..] {
            return Some(raster);
        }
        let low_m = h_m.iter().copied().fold(f64::INFINITY, f64::min);
        let high_m = h_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let last = self.parts.len() - 1;
        let first_beyond = |h_m: f64| self.parts[..last].iter().position(|part| h_m < part.0);
        let (low, high) = (first_beyond(low_m), first_beyond(high_m));
        (low == high).then(|| self.parts[low.unwrap_or(last)].1)
    }

    /// Samples grey levels and adds the specular reflections of wet patches.
    ///
    /// The rays of directions `d` meet the wall at angles θ (in `[0, 2π)`) and chainages h (metres,
    /// within the view), at most [`BATCH_POINTS`] of them; NaN gives 0.
    #[inline(always)]
    pub fn sample(
        &self,
        theta: &[f64],
        h_m: &[f64],
        d: impl Fn(usize) -> Vector3<f64>,
        values: &mut [f32],
    ) {
        if let Some(raster) = self.common_raster(h_m) {
            raster.sample(theta, h_m, values);
            raster.add_glints(theta, h_m, d, values);
            return;
        }
        let mut from_m = f64::NEG_INFINITY;
        for (k, (to_m, raster)) in self.parts.iter().enumerate() {
            let is_last = k + 1 == self.parts.len();
            let is_own = |h_m: f64| h_m >= from_m && (h_m < *to_m || is_last);
            if h_m.iter().any(|h_m| is_own(*h_m)) {
                // Points of other rasters are sampled at an end of this one, and dropped.
                let mut own = [f64::NAN; BATCH_POINTS];
                for (own, h_m) in own.iter_mut().zip(h_m) {
                    *own = if is_own(*h_m) { *h_m } else { f64::NAN };
                }
                let mut theta_own = [f64::NAN; BATCH_POINTS];
                for (k, theta) in theta.iter().enumerate() {
                    theta_own[k] = if own[k].is_nan() { f64::NAN } else { *theta };
                }
                let (own, theta_own) = (&own[..h_m.len()], &theta_own[..h_m.len()]);
                let mut sampled = [0.0; BATCH_POINTS];
                raster.sample(theta_own, own, &mut sampled);
                raster.add_glints(theta_own, own, &d, &mut sampled);
                for (k, own) in own.iter().enumerate() {
                    if !own.is_nan() {
                        values[k] = sampled[k];
                    }
                }
            }
            from_m = *to_m;
        }
    }
}
