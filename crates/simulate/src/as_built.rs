//! Options of a lining as built.

use crate::error::{SimulateError, check_option};
use serde::Serialize;
use std::f64::consts::TAU;
use std::path::PathBuf;

/// Deviation of a straight round lining from its radius: the sum of all that is given.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AsBuilt {
    /// Amplitude of the ovality, a second harmonic along all of the tunnel, millimetres.
    pub ovality_mm: f64,
    /// Undulation, root mean square, millimetres.
    pub undulation_mm: f64,
    /// Length ℓ of the undulation's correlation `exp(−x²/2ℓ²)`, metres.
    pub undulation_length_m: f64,
    /// Segments of which the lining is built, if any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segments: Option<Segments>,
    /// A shape.json whose displacement the lining has, if any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shape_file: Option<PathBuf>,
}

impl Default for AsBuilt {
    fn default() -> Self {
        Self {
            ovality_mm: 0.0,
            undulation_mm: 0.0,
            undulation_length_m: 0.5,
            segments: None,
            shape_file: None,
        }
    }
}

/// Rings of precast segments. Every other ring is turned by half a segment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Segments {
    /// Number of segments around a ring.
    pub count: u32,
    /// Length of a ring along the tunnel, metres.
    pub ring_length_m: f64,
    /// 1-σ of the radial position of a segment, independent of the others, millimetres.
    pub step_mm: f64,
    /// Width of the dark joints between segments, millimetres; 0 if they are invisible.
    pub joint_mm: f64,
}

/// Segments around a ring at the most.
const MAX_SEGMENTS: u32 = 64;
/// Largest 1-σ of the steps, share of the radius.
const MAX_STEP_SHARE: f64 = 0.01;
/// Largest width of a joint, share of the shorter side of a segment.
const MAX_JOINT_SHARE: f64 = 0.2;

impl AsBuilt {
    /// Validates every value for a tunnel of the given radius, metres.
    ///
    /// # Errors
    /// [`SimulateError::Option`] with the name of the first impossible option.
    pub(super) fn validate(&self, radius_m: f64) -> Result<(), SimulateError> {
        let deviates = |mm: f64| (0.0..=50.0 * radius_m).contains(&mm);
        check_option(
            deviates(self.ovality_mm) && deviates(self.undulation_mm),
            "the lining may deviate by no more than a twentieth of the radius",
        )?;
        check_option(
            self.undulation_mm == 0.0 || self.undulation_length_m >= 0.02 * radius_m,
            "the undulation must be at least a fiftieth of the radius long",
        )?;
        self.segments
            .map_or(Ok(()), |segments| segments.validate(radius_m))
    }
}

impl Segments {
    /// Validates every value for a tunnel of the given radius, metres.
    fn validate(&self, radius_m: f64) -> Result<(), SimulateError> {
        check_option(
            (1..=MAX_SEGMENTS).contains(&self.count),
            "a ring must have 1 to 64 segments",
        )?;
        check_option(
            (0.1 * radius_m..=100.0 * radius_m).contains(&self.ring_length_m),
            "a ring of segments must be a tenth of the radius to a hundred radii long",
        )?;
        check_option(
            (0.0..=1e3 * MAX_STEP_SHARE * radius_m).contains(&self.step_mm),
            "the steps between segments (1-σ) must be 0 to a hundredth of the radius",
        )?;
        let side_m = self
            .ring_length_m
            .min(TAU * radius_m / f64::from(self.count));
        check_option(
            (0.0..=1e3 * MAX_JOINT_SHARE * side_m).contains(&self.joint_mm),
            "the joints must be 0 to a fifth of a segment's shorter side wide",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RING: Segments = Segments {
        count: 6,
        ring_length_m: 1.5,
        step_mm: 3.0,
        joint_mm: 8.0,
    };

    #[test]
    fn impossible_segments_are_refused_by_name() {
        let wrong = [
            (Segments { count: 0, ..RING }, "1 to 64"),
            (Segments { count: 65, ..RING }, "1 to 64"),
            (
                Segments {
                    ring_length_m: 0.0,
                    ..RING
                },
                "ring",
            ),
            (
                Segments {
                    ring_length_m: f64::NAN,
                    ..RING
                },
                "ring",
            ),
            (
                Segments {
                    step_mm: -1.0,
                    ..RING
                },
                "steps",
            ),
            (
                Segments {
                    step_mm: f64::NAN,
                    ..RING
                },
                "steps",
            ),
            (
                Segments {
                    step_mm: 31.0,
                    ..RING
                },
                "steps",
            ),
            (
                Segments {
                    joint_mm: f64::INFINITY,
                    ..RING
                },
                "joints",
            ),
        ];
        let as_built = |segments| AsBuilt {
            segments: Some(segments),
            ..AsBuilt::default()
        };
        as_built(RING).validate(3.0).unwrap();
        for (segments, part) in wrong {
            let message = as_built(segments).validate(3.0).unwrap_err().to_string();
            assert!(message.contains(part), "{segments:?}: {message}");
        }
    }
}
