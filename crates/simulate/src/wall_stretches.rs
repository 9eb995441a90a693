//! Stretches of wall that are painted for a camera that sees far: coarser with distance.
//!
//! At a distance D along the tunnel, a pixel is D/f wide on the wall. So texels may grow with the
//! distance: those of level l have 2^l times the size of the finest, from 2^(l+1) radii on.

/// Distance along the tunnel up to which the wall has the finest texels, radii.
const NEAR_RADII: f64 = 4.0;
/// Coarsest level.
const MAX_LEVEL: u32 = 4;

/// Stretch of wall of one level of detail.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct WallStretch {
    /// Level l, negative where the wall lies at lower chainages than the camera.
    pub zone: i32,
    /// Minimum and maximum chainage, metres.
    pub h_m: [f64; 2],
}

impl WallStretch {
    /// A stretch of the finest texels.
    pub fn near(h_m: [f64; 2]) -> Self {
        Self { zone: 0, h_m }
    }

    /// Size of a texel relative to the finest.
    pub fn coarseness(&self) -> usize {
        1 << self.zone.unsigned_abs()
    }
}

/// The stretches from chainage `seen_h_m[0]` to `seen_h_m[1]` for a camera at `camera_h_m` in a
/// tunnel of the given mean radius (all metres), in ascending order and without gaps.
pub(super) fn stretches_of_view(
    seen_h_m: [f64; 2],
    camera_h_m: f64,
    radius_m: f64,
) -> Vec<WallStretch> {
    let last = MAX_LEVEL as i32;
    // Distance at which the wall of a level begins, and infinity beyond the last.
    let start_m = |level: i32| match level {
        level if level > last => f64::INFINITY,
        level => NEAR_RADII * radius_m * f64::from(1 << (level - 1)),
    };
    let stretch = |zone: i32| {
        let level = zone.abs();
        let [from_m, to_m] = if zone == 0 {
            [-start_m(1), start_m(1)]
        } else if zone > 0 {
            [start_m(level), start_m(level + 1)]
        } else {
            [-start_m(level + 1), -start_m(level)]
        };
        let h_m = [
            (camera_h_m + from_m).max(seen_h_m[0]),
            (camera_h_m + to_m).min(seen_h_m[1]),
        ];
        (h_m[0] < h_m[1]).then_some(WallStretch { zone, h_m })
    };
    (-last..=last).filter_map(stretch).collect()
}

/// Unites stretches of the same zone: each zone of the result holds those of both.
pub(super) fn unite(a: &[WallStretch], b: &[WallStretch]) -> Vec<WallStretch> {
    let mut united = a.to_vec();
    for stretch in b {
        match united.iter_mut().find(|other| other.zone == stretch.zone) {
            Some(WallStretch { h_m, .. }) => {
                *h_m = [h_m[0].min(stretch.h_m[0]), h_m[1].max(stretch.h_m[1])];
            }
            None => united.push(*stretch),
        }
    }
    united
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_cover_the_view_without_gaps_and_coarser_with_distance() {
        let stretches = stretches_of_view([-7.0, 190.0], 10.0, 3.0);
        assert_eq!(stretches[0].h_m[0], -7.0);
        assert_eq!(stretches.last().unwrap().h_m[1], 190.0);
        for pair in stretches.windows(2) {
            assert_eq!(pair[0].h_m[1], pair[1].h_m[0]);
        }
        let zones: Vec<i32> = stretches.iter().map(|stretch| stretch.zone).collect();
        assert_eq!(zones, [-1, 0, 1, 2, 3, 4]);
        // Texels are at most half as large, relative to the distance, as they may be.
        for stretch in &stretches {
            let nearest_m = if stretch.zone < 0 {
                10.0 - stretch.h_m[1]
            } else {
                stretch.h_m[0] - 10.0
            };
            let allowed = (0.5 * nearest_m / 3.0).max(1.0);
            assert!(stretch.coarseness() as f64 <= allowed + 1e-9);
        }
    }

    #[test]
    fn united_stretches_hold_both() {
        let [a, b] = [0.0, 2.0].map(|h_m| stretches_of_view([h_m, h_m + 20.0], h_m, 3.0));
        let united = unite(&a, &b);
        assert_eq!(united.len(), 2);
        assert_eq!(united[0].h_m, [0.0, 14.0]);
        assert_eq!(united[1].h_m, [12.0, 22.0]);
    }
}
