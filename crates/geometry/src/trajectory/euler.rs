//! Rotations as angles about three axes (Euler and Cardan angles).

use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// The order of rotations about the axes x, y and z, as SciPy's `Rotation.from_euler` names it.
///
/// Capitals are rotations about the axes that the earlier ones have turned: `ZYX` is
/// `R = R_z(yaw) R_y(pitch) R_x(roll)`. Small letters are rotations about fixed axes: `xyz` is the
/// same `R`. Each axis is there once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct EulerSequence {
    /// The axes in the order of the factors of R, 0 for x.
    factors: [usize; 3],
}

const LETTERS: [char; 3] = ['X', 'Y', 'Z'];

impl EulerSequence {
    /// `R = R_z R_y R_x`: yaw, pitch and roll of robotics, of ROS and of vehicles.
    pub const ZYX: Self = Self { factors: [2, 1, 0] };
    /// `R = R_x R_y R_z`: omega, phi and kappa of photogrammetry.
    pub const XYZ: Self = Self { factors: [0, 1, 2] };

    /// The reverse order.
    #[must_use]
    pub fn reversed(mut self) -> Self {
        self.factors.reverse();
        self
    }

    /// The rotation by the angles about x, y and z, radians.
    pub fn rotation(self, angles_rad: [f64; 3]) -> UnitQuaternion<f64> {
        let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
        let about = |axis: usize| UnitQuaternion::from_axis_angle(&axes[axis], angles_rad[axis]);
        let [first, second, third] = self.factors.map(about);
        first * second * third
    }
}

impl FromStr for EulerSequence {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let fail = || {
            format!(
                "`{text}` is no order of rotations; it has X, Y and Z once each, as \"ZYX\" for R \
                 = Rz(yaw) Ry(pitch) Rx(roll), or in small letters for rotations about fixed axes"
            )
        };
        let is_intrinsic = text.chars().all(|c| c.is_ascii_uppercase());
        if !is_intrinsic && !text.chars().all(|c| c.is_ascii_lowercase()) {
            return Err(fail());
        }
        let axis = |c: char| {
            LETTERS
                .iter()
                .position(|letter| *letter == c.to_ascii_uppercase())
        };
        let axes: Option<Vec<usize>> = text.chars().map(axis).collect();
        let mut factors: [usize; 3] = axes
            .and_then(|axes| axes.try_into().ok())
            .ok_or_else(fail)?;
        if (0..3).any(|axis| !factors.contains(&axis)) {
            return Err(fail());
        }
        if !is_intrinsic {
            factors.reverse();
        }
        Ok(Self { factors })
    }
}

impl fmt::Display for EulerSequence {
    fn fmt(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str(
            &self
                .factors
                .map(|axis| LETTERS[axis])
                .iter()
                .collect::<String>(),
        )
    }
}

impl TryFrom<String> for EulerSequence {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<EulerSequence> for String {
    fn from(sequence: EulerSequence) -> Self {
        sequence.to_string()
    }
}

/// Unit of angles in files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AngleUnit {
    /// Degrees.
    Deg,
    /// Radians.
    Rad,
}

impl AngleUnit {
    /// All units.
    pub const ALL: [Self; 2] = [Self::Deg, Self::Rad];

    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Deg => "deg",
            Self::Rad => "rad",
        }
    }

    /// True for a symbol or a name of the unit, in lower case.
    pub(super) fn is_called(self, word: &str) -> bool {
        let symbols: &[&str] = match self {
            Self::Deg => &["deg", "°", "degree", "degrees"],
            Self::Rad => &["rad", "radian", "radians"],
        };
        symbols.contains(&word)
    }

    /// An angle of this unit in radians.
    pub(super) fn radians(self, angle: f64) -> f64 {
        match self {
            Self::Deg => angle.to_radians(),
            Self::Rad => angle,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// nalgebra's roll, pitch and yaw are rotations about fixed axes.
    #[test]
    fn yaw_pitch_and_roll_are_those_of_robotics() {
        let angles = [0.3, -0.4, 2.1];
        let expected = UnitQuaternion::from_euler_angles(0.3, -0.4, 2.1);
        for text in ["ZYX", "xyz"] {
            let rotation = text.parse::<EulerSequence>().unwrap().rotation(angles);
            assert!(rotation.angle_to(&expected) < 1e-12, "{text}");
        }
        let other = EulerSequence::XYZ.rotation(angles);
        assert!(other.angle_to(&expected) > 0.1);
    }

    /// SciPy 1.17: `Rotation.from_euler("YXZ", [40, 20, -70], degrees=True).as_quat()`.
    #[test]
    fn orders_are_those_of_scipy() {
        let sequence: EulerSequence = "YXZ".parse().unwrap();
        let angles = [20.0, 40.0, -70.0].map(f64::to_radians);
        let rotation = sequence.rotation(angles);
        let expected = [
            -0.05952847933950117,
            0.3695039985589459,
            -0.5794475452755768,
            0.7239915037281759,
        ];
        let distance = (0..4)
            .map(|k| (rotation.coords[k] - expected[k]).abs())
            .fold(0.0, f64::max);
        assert!(distance < 1e-9, "{rotation:?}");
    }

    #[test]
    fn names_come_back_and_others_are_refused() {
        for text in ["XYZ", "ZYX", "YXZ"] {
            assert_eq!(text.parse::<EulerSequence>().unwrap().to_string(), text);
        }
        assert_eq!("zyx".parse::<EulerSequence>().unwrap().to_string(), "XYZ");
        for text in ["", "ZY", "ZYXX", "ZXZ", "Zyx", "rpy", "ABC"] {
            assert!(
                text.parse::<EulerSequence>()
                    .unwrap_err()
                    .contains("once each"),
                "{text}"
            );
        }
    }
}
