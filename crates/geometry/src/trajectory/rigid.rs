//! Conversion between matrices and rigid motions.

use super::pose::Pose;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

/// Largest deviation of an element of `R Rᵀ` from the identity; numbers with three digits pass.
const MAX_ORTHOGONALITY_ERROR: f64 = 2e-3;

/// The motion `[R t]` of a matrix of three rows, or of four if the last is `0 0 0 1`.
///
/// R is replaced by the rotation nearest to it, `U Vᵀ` with `U Σ Vᵀ = R`, which undoes the rounding
/// of its digits.
///
/// # Errors
/// Another size; a number that is not finite; another last row than `0 0 0 1`; an R that is scaled,
/// a reflection or otherwise no rotation.
pub fn from_rows(rows: &[[f64; 4]]) -> Result<Pose, String> {
    let [a, b, c] = match rows {
        [a, b, c] => [a, b, c],
        [a, b, c, last] => {
            let off = last.iter().zip([0.0, 0.0, 0.0, 1.0]);
            if !off
                .into_iter()
                .all(|(value, should)| (value - should).abs() <= 1e-9)
            {
                return Err(format!("the last row is {last:?}, not 0 0 0 1"));
            }
            [a, b, c]
        }
        _ => {
            return Err(format!(
                "{} rows where a rigid motion has 4, or 3",
                rows.len()
            ));
        }
    };
    let t = Vector3::new(a[3], b[3], c[3]);
    let r = Matrix3::new(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]);
    if !r.iter().chain(t.iter()).all(|value| value.is_finite()) {
        return Err("not all of its numbers are finite".to_owned());
    }
    let square = r * r.transpose();
    let scale = (square.trace() / 3.0).sqrt();
    let is_rotation =
        |square: Matrix3<f64>| (square - Matrix3::identity()).amax() <= MAX_ORTHOGONALITY_ERROR;
    if !is_rotation(square) {
        return Err(if scale > 0.0 && is_rotation(square / (scale * scale)) {
            format!("its rotation is scaled by {scale:.6}; poses are rigid, in metres")
        } else {
            "its first three columns are not a rotation (they must be perpendicular and of length \
             1)"
            .to_owned()
        });
    }
    if r.determinant() < 0.0 {
        return Err("its rotation is a reflection (determinant −1)".to_owned());
    }
    let svd = r.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return Err("its rotation cannot be determined".to_owned());
    };
    let nearest = Rotation3::from_matrix_unchecked(u * v_t);
    Ok(Pose::new(UnitQuaternion::from_rotation_matrix(&nearest), t))
}

/// The rows `[R t]` of a motion.
pub fn to_rows(pose: &Pose) -> [[f64; 4]; 3] {
    let (r, t) = (pose.r_wc.to_rotation_matrix(), &pose.t_wc);
    [0, 1, 2].map(|k| [r[(k, 0)], r[(k, 1)], r[(k, 2)], t[k]])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::so3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rows_and_back(
            x in -4.0f64..4.0, y in -4.0f64..4.0, z in -4.0f64..4.0, h in -1e4f64..1e4,
        ) {
            let pose = Pose::new(so3::exp(&Vector3::new(x, y, z)), Vector3::new(x, h, z));
            let back = from_rows(&to_rows(&pose)).unwrap();
            prop_assert_eq!(back.t_wc, pose.t_wc);
            prop_assert!(back.r_wc.angle_to(&pose.r_wc) < 1e-14);
        }
    }

    #[test]
    fn what_is_not_rigid_is_named() {
        let row = |k: usize, value: f64| {
            let mut row = [0.0; 4];
            row[k] = value;
            row
        };
        let last = row(3, 1.0);
        for (rows, expected) in [
            (
                vec![row(0, 2.0), row(1, 2.0), row(2, 2.0), last],
                "scaled by 2",
            ),
            (
                vec![row(0, 1.0), row(1, -1.0), row(2, 1.0), last],
                "reflection",
            ),
            (
                vec![row(0, 1.0), row(0, 1.0), row(2, 1.0)],
                "not a rotation",
            ),
            (
                vec![row(0, 0.0), row(0, 0.0), row(2, 0.0)],
                "not a rotation",
            ),
            (
                vec![row(0, 1.0), row(1, 1.0), row(2, 1.0), row(3, 2.0)],
                "last row",
            ),
            (vec![row(0, f64::NAN), row(1, 1.0), row(2, 1.0)], "finite"),
            (vec![row(0, 1.0)], "1 rows"),
        ] {
            let message = from_rows(&rows).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}
