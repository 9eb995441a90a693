//! Cross-sections of the simulated tunnel, by equations independent of
//! [`tunnelstitch_geometry::surface`].
//!
//! Each cross-section is the set `G = 1` of a convex function that grows in proportion to the
//! distance from the axis. Nothing is shared with [`tunnelstitch_geometry::surface`], so that a
//! simulated survey can judge it.

use std::f64::consts::{FRAC_PI_2, TAU};
use tunnelstitch_core::survey::Shape;

/// Outline of the tunnel across its axis.
#[derive(Clone, Debug)]
pub(super) struct CrossSection {
    shape: Shape,
    /// Half the width and the height above the axis, metres.
    half: [f64; 2],
    /// Depth of the floor below the axis, metres.
    floor_m: f64,
    /// Arc length of an ellipse up to equal steps of its parameter, metres; empty otherwise.
    lengths_m: Vec<f64>,
    perimeter_m: f64,
}

/// Steps of the parameter over which the arc length of an ellipse is summed.
const ELLIPSE_STEPS: usize = 1 << 16;

impl CrossSection {
    /// A section of validated sizes, metres; a circle has equal width and height.
    pub fn new(shape: Shape, width_m: f64, height_m: f64) -> Self {
        let mut section = Self {
            shape,
            half: [0.5 * width_m, 0.5 * height_m],
            floor_m: 0.5 * height_m,
            lengths_m: Vec::new(),
            perimeter_m: 2.0 * (width_m + height_m),
        };
        if shape == Shape::Horseshoe {
            section.half[1] = 0.5 * width_m;
            section.floor_m = height_m - 0.5 * width_m;
            section.perimeter_m = FRAC_PI_2 * width_m + 2.0 * section.floor_m + width_m;
        }
        if matches!(shape, Shape::Circle | Shape::Ellipse) {
            let [a, b] = section.half;
            let mut length_m = 0.0;
            section.lengths_m.push(0.0);
            for k in 0..ELLIPSE_STEPS {
                let (sin, cos) = (TAU * (k as f64 + 0.5) / ELLIPSE_STEPS as f64).sin_cos();
                length_m += (a * cos).hypot(b * sin) * TAU / ELLIPSE_STEPS as f64;
                section.lengths_m.push(length_m);
            }
            section.perimeter_m = length_m;
        }
        section
    }

    /// Length of the outline, metres.
    pub fn perimeter_m(&self) -> f64 {
        self.perimeter_m
    }

    /// Minimum distance of the wall from the axis, metres.
    pub fn nearest_m(&self) -> f64 {
        self.half[0].min(self.half[1]).min(self.floor_m)
    }

    /// Maximum distance of the wall from the axis, metres.
    pub fn farthest_m(&self) -> f64 {
        let [a, b] = self.half;
        match self.shape {
            Shape::Circle | Shape::Ellipse => a.max(b),
            Shape::Box => a.hypot(b),
            Shape::Horseshoe => a.hypot(self.floor_m),
        }
    }

    /// G at a point of the section (metres): below 1 inside, 1 on the wall.
    pub fn g(&self, x: f64, z: f64) -> f64 {
        let [a, b] = self.half;
        match self.shape {
            Shape::Box => (x / a).abs().max((z / b).abs()),
            Shape::Horseshoe if z < 0.0 => (x / a).abs().max(-z / self.floor_m),
            _ => (x / a).hypot(z / b),
        }
    }

    /// Arc length of a point of the outline as an angle: 2π once around, from z towards x.
    pub fn angle_of(&self, x: f64, z: f64) -> f64 {
        let [a, b] = self.half;
        let floor_m = self.floor_m;
        let s_m = match self.shape {
            Shape::Box if z >= 0.0 && (z / b) >= (x / a).abs() => x,
            Shape::Box if (x / a) >= (z / b).abs() => a + (b - z),
            Shape::Box if (-z / b) >= (x / a).abs() => a + 2.0 * b + (a - x),
            Shape::Box => 3.0 * a + 2.0 * b + (z + b),
            Shape::Horseshoe if z >= 0.0 && x >= 0.0 => a * x.atan2(z),
            Shape::Horseshoe if z >= 0.0 => self.perimeter_m + a * x.atan2(z),
            Shape::Horseshoe if -z / floor_m >= (x / a).abs() => a * FRAC_PI_2 + floor_m + (a - x),
            Shape::Horseshoe if x >= 0.0 => a * FRAC_PI_2 - z,
            Shape::Horseshoe => a * FRAC_PI_2 + 2.0 * floor_m + 2.0 * a + z,
            _ => {
                let t = (x / a).atan2(z / b).rem_euclid(TAU) / TAU * ELLIPSE_STEPS as f64;
                let k = (t as usize).min(ELLIPSE_STEPS - 1);
                let (from, to) = (self.lengths_m[k], self.lengths_m[k + 1]);
                from + (to - from) * (t - k as f64)
            }
        };
        TAU * (s_m / self.perimeter_m).rem_euclid(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Once around in small steps, the angle grows by the length of each step.
    #[test]
    fn angles_are_arc_lengths() {
        for (shape, width_m, height_m) in [
            (Shape::Circle, 6.0, 6.0),
            (Shape::Ellipse, 5.0, 3.0),
            (Shape::Box, 4.0, 3.0),
            (Shape::Horseshoe, 5.0, 4.0),
        ] {
            let section = CrossSection::new(shape, width_m, height_m);
            let point = |k: usize| {
                let (x, z) = (TAU * k as f64 / 5000.0).sin_cos();
                let g = section.g(x, z);
                (x / g, z / g)
            };
            let mut length_m = 0.0;
            for k in 0..5000 {
                let (from, to) = (point(k), point(k + 1));
                let step_m = (to.0 - from.0).hypot(to.1 - from.1);
                let moved = section.angle_of(to.0, to.1) - section.angle_of(from.0, from.1);
                let moved_m = (moved / TAU).rem_euclid(1.0) * section.perimeter_m();
                // Corners are cut, a little.
                assert!(
                    (moved_m - step_m).abs() < 0.3 * step_m + 1e-9,
                    "{shape:?} {k}"
                );
                length_m += step_m;
                let far = from.0.hypot(from.1);
                assert!(far >= section.nearest_m() - 1e-9 && far <= section.farthest_m() + 1e-9);
            }
            assert!((length_m / section.perimeter_m() - 1.0).abs() < 1e-4);
            assert!(section.angle_of(1e-12, section.half[1]) < 1e-6);
        }
    }
}
