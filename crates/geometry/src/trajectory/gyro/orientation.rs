//! Orientation of a sensor in its camera, in Gyroflow's notation.

use nalgebra::Matrix3;

/// An IMU orientation of Gyroflow, such as `YxZ`: the sensor's axes that lie along Gyroflow's axes
/// up, left, and backwards out of the image; small letters denote opposite directions. `YxZ` stands
/// for a sensor with x right, y up and z backwards.
///
/// There are 48. Half of them are reflections, of sensors with left-handed axes; each axis still
/// has its rate by the right-hand rule, so rates are mapped axis by axis, as in Gyroflow.
///
/// Source: Gyroflow's documentation of the gcsv format and the way its integrators and its
/// `frame_transform` use the axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orientation {
    /// Rotation from the sensor's to Gyroflow's axes.
    to_own: Matrix3<f64>,
}

impl Orientation {
    /// Reads the three letters.
    ///
    /// # Errors
    /// Anything but one of x, y and z each, in capitals or not.
    pub fn parse(text: &str) -> Result<Self, String> {
        let fail = || {
            format!(
                "`{text}` is not an orientation; it must be three letters such as YxZ, each of x, \
                 y and z once, in capitals or not"
            )
        };
        let letters: Vec<char> = text.chars().collect();
        let letters = <[char; 3]>::try_from(letters).map_err(|_| fail())?;
        let mut to_own = Matrix3::zeros();
        for (row, letter) in letters.into_iter().enumerate() {
            let column = match letter.to_ascii_lowercase() {
                'x' => 0,
                'y' => 1,
                'z' => 2,
                _ => return Err(fail()),
            };
            to_own[(row, column)] = if letter.is_ascii_uppercase() {
                1.0
            } else {
                -1.0
            };
        }
        if to_own.determinant() == 0.0 {
            Err(fail())
        } else {
            Ok(Self { to_own })
        }
    }

    /// The orientation of a matrix from the sensor's axes to Gyroflow's.
    pub(super) fn from_matrix(to_own: Matrix3<f64>) -> Self {
        Self { to_own }
    }

    /// The matrix from the sensor's axes to the camera's (x right, y down, z forward):
    /// `(−y, −x, −z)` of Gyroflow's.
    pub fn to_camera(&self) -> Matrix3<f64> {
        let own_to_camera = Matrix3::new(0.0, -1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, -1.0);
        own_to_camera * self.to_own
    }

    /// True if the sensor's axes are left-handed.
    pub fn is_mirror(&self) -> bool {
        self.to_own.determinant() < 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use std::collections::HashSet;

    #[test]
    fn of_all_words_of_three_letters_48_are_orientations_and_half_of_them_mirrors() {
        let letters = ["X", "Y", "Z", "x", "y", "z"];
        let (mut valid, mut mirrors) = (HashSet::new(), 0);
        for a in letters {
            for b in letters {
                for c in letters {
                    let word = format!("{a}{b}{c}");
                    let distinct: HashSet<char> = word.to_lowercase().chars().collect();
                    let orientation = Orientation::parse(&word);
                    assert_eq!(orientation.is_ok(), distinct.len() == 3, "{word}");
                    let Ok(orientation) = orientation else {
                        continue;
                    };
                    let m = orientation.to_camera();
                    assert_eq!(m * m.transpose(), Matrix3::identity());
                    assert_eq!(orientation.is_mirror(), m.determinant() < 0.0);
                    valid.insert(m.map(|v| v as i8).as_slice().to_vec());
                    mirrors += usize::from(orientation.is_mirror());
                }
            }
        }
        assert_eq!((valid.len(), mirrors), (48, 24));
        for wrong in ["", "XY", "XYZX", "XYQ", "XXY", "xyX", "ÄYZ"] {
            assert!(Orientation::parse(wrong).is_err(), "{wrong}");
        }
    }

    /// The documentation's figure: a sensor with x right, y up, z backwards.
    #[test]
    fn the_documented_orientation_is_that_of_opengl() {
        let to_camera = Orientation::parse("YxZ").unwrap().to_camera();
        assert_eq!(
            to_camera * Vector3::new(1.0, 2.0, 3.0),
            Vector3::new(1.0, -2.0, -3.0)
        );
    }
}
