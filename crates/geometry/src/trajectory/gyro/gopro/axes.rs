//! The axes of a GoPro's sensors in the camera.
//!
//! The camera's axes are X to the left, seen from behind, Y out of the back and Z up, which are
//! Gyroflow's left, backwards and up. `ORIN` names the axes along which the three numbers of a
//! sensor lie, small letters the opposite directions; `MTRX` converts the numbers to the axes of
//! `ORIO`, or `ZXY`. A HERO5 has neither, and neither have a HERO6 and a Fusion, whose axes are
//! documented; but the accelerations of HERO6 are in two orders, by their firmware.
//!
//! Source: the figure "IMU Orientation" and the tables of sensors in the README of
//! <https://github.com/gopro/gpmf-parser>; its issue 56; its samples of a HERO6, whose gravity is
//! in the first or in the last number.

use super::klv::KlvList;
use nalgebra::Matrix3;

/// Largest deviation of `MTRX` from an orthogonal matrix, in an element of its square.
const MAX_SKEW: f64 = 0.05;
/// Axes of cameras that do not state them, by the name of the device and the key of the sensor.
const KNOWN_AXES: [(&str, &[u8; 4], &str); 5] = [
    ("Camera", b"GYRO", "ZXY"),
    ("Camera", b"ACCL", "ZXY"),
    ("Hero6 Black", b"GYRO", "YxZ"),
    ("Fusion", b"GYRO", "yXZ"),
    ("Fusion", b"ACCL", "yXZ"),
];

/// The matrix from the three numbers of a sensor to up, left and backwards, if it is known; `key`
/// is that of the sensor, `stream` are the values beside its own.
///
/// # Errors
/// Axes that are no three different ones; a matrix that is no rotation or reflection.
pub fn sensor_axes(
    key: [u8; 4],
    stream: KlvList,
    device_name: Option<&str>,
) -> Result<Option<Matrix3<f64>>, String> {
    let (mut stated, mut output, mut matrix) = (None, None, None);
    for klv in stream {
        let klv = klv?;
        match &klv.key {
            b"ORIN" => stated = Some(from_letters("ORIN", &klv.text())?),
            b"ORIO" => output = Some(from_letters("ORIO", &klv.text())?),
            b"MTRX" => matrix = Some(from_numbers(&klv.rows()?.concat())?),
            _ => {}
        }
    }
    if let Some(axes) = stated {
        return Ok(Some(axes));
    }
    if let Some(matrix) = matrix {
        return Ok(Some(output.unwrap_or_else(Matrix3::identity) * matrix));
    }
    let mut known = KNOWN_AXES.iter();
    let known = known.find(|(name, own, _)| Some(*name) == device_name && **own == key);
    known
        .map(|(name, _, word)| from_letters(name, word))
        .transpose()
}

/// The matrix of three letters to up (Z), left (X) and backwards (Y).
fn from_letters(key: &str, word: &str) -> Result<Matrix3<f64>, String> {
    let mut axes = Matrix3::zeros();
    for (column, letter) in word.chars().enumerate().take(3) {
        let row = match letter.to_ascii_lowercase() {
            'z' => 0,
            'x' => 1,
            'y' => 2,
            _ => continue,
        };
        let is_positive = letter.is_ascii_uppercase();
        axes[(row, column)] = if is_positive { 1.0 } else { -1.0 };
    }
    if word.len() == 3 && axes.determinant() != 0.0 {
        return Ok(axes);
    }
    Err(format!(
        "its {key} is `{}`; it must be three letters such as ZXY, each of x, y and z once",
        word.escape_debug()
    ))
}

/// The matrix of nine numbers, row by row.
fn from_numbers(numbers: &[f64]) -> Result<Matrix3<f64>, String> {
    if numbers.len() == 9 {
        let matrix = Matrix3::from_row_slice(numbers);
        let square = matrix * matrix.transpose() - Matrix3::identity();
        if square.iter().all(|skew| skew.abs() < MAX_SKEW) {
            return Ok(matrix);
        }
    }
    Err(format!(
        "its MTRX is {numbers:?}; it must be nine numbers of a rotation or reflection"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// gpmf-parser's outputs 0, 1, 2 of a HERO7 are its inputs 2, −1, 0.
    #[test]
    fn the_documented_letters_are_those_of_a_hero7() {
        let axes = from_letters("ORIN", "YxZ").unwrap();
        let expected = Vector3::new(3.0, -2.0, 1.0);
        assert_eq!(axes * Vector3::new(1.0, 2.0, 3.0), expected);
        assert_eq!(from_letters("ORIN", "ZXY").unwrap(), Matrix3::identity());
        for wrong in ["", "ZX", "ZXYZ", "ZXX", "ABC", "ÄX"] {
            assert!(from_letters("ORIN", wrong).is_err(), "{wrong}");
        }
    }

    /// The numbers of a GoPro Max: they agree with its letters.
    #[test]
    fn letters_and_matrix_of_a_max_agree() {
        let matrix = [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        let stated = from_letters("ORIN", "XzY").unwrap();
        assert_eq!(from_numbers(&matrix).unwrap(), stated);
        assert!(from_numbers(&matrix[1..]).is_err());
        assert!(from_numbers(&[1.0; 9]).is_err() && from_numbers(&[f64::NAN; 9]).is_err());
    }
}
