//! Vectors of [`LANES`] values, in plain arrays that the compiler keeps in registers.

use crate::tiles::grid::LANES;

/// A value in each lane.
pub type Lanes = [f32; LANES];

/// The values of `array` from index `k` on.
#[inline(always)]
pub fn load<const N: usize>(array: &[f32; N], k: usize) -> Lanes {
    let mut lanes = [0.0; LANES];
    lanes.copy_from_slice(&array[k..k + LANES]);
    lanes
}

/// Writes the values of `array` from index `k` on.
#[inline(always)]
pub fn store<const N: usize>(array: &mut [f32; N], k: usize, lanes: Lanes) {
    array[k..k + LANES].copy_from_slice(&lanes);
}

/// A value computed lane by lane.
#[inline(always)]
pub fn lanewise(value: impl Fn(usize) -> f32) -> Lanes {
    let mut lanes = [0.0; LANES];
    for (lane, v) in lanes.iter_mut().enumerate() {
        *v = value(lane);
    }
    lanes
}
