//! Lists of distortion coefficients in the order of OpenCV.

use super::error::ParseError;
use crate::camera::brown_conrady::{BrownCoefficients, BrownConrady};
use crate::camera::kannala_brandt::KannalaBrandt;
use crate::camera::lens::Lens;

/// Reads OpenCV's `k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4 [τx τy]]]]`, of which the last six must
/// be 0.
pub fn brown_conrady(d: &[f64]) -> Result<Lens, ParseError> {
    if !matches!(d.len(), 0 | 2 | 4 | 5 | 8 | 12 | 14) {
        return Err(ParseError::new(format!(
            "there are {} distortion coefficients; OpenCV's model has 4, 5 or 8 (k1 k2 p1 p2 k3 \
             k4 k5 k6)",
            d.len()
        )));
    }
    finite(d)?;
    if d.iter().skip(8).any(|c| *c != 0.0) {
        return Err(ParseError::new(
            "a thin prism or a tilted sensor (coefficients 9 to 14) is not supported; calibrate \
             with 8 coefficients",
        ));
    }
    let at = |k: usize| d.get(k).copied().unwrap_or(0.0);
    Ok(Lens::BrownConrady(BrownConrady::new(BrownCoefficients {
        k: [at(0), at(1), at(4), at(5), at(6), at(7)],
        p: [at(2), at(3)],
    })))
}

/// Reads `k1 k2 k3 k4` of a fisheye; missing ones at the end are 0.
pub fn kannala_brandt(d: &[f64]) -> Result<Lens, ParseError> {
    if d.len() > 4 {
        return Err(ParseError::new(format!(
            "there are {} distortion coefficients; a fisheye (equidistant, Kannala–Brandt) has 4",
            d.len()
        )));
    }
    finite(d)?;
    let mut k = [0.0; 4];
    k[..d.len()].copy_from_slice(d);
    Ok(Lens::KannalaBrandt(KannalaBrandt::new(k)))
}

fn finite(d: &[f64]) -> Result<(), ParseError> {
    match d.iter().position(|c| !c.is_finite()) {
        None => Ok(()),
        Some(k) => Err(ParseError::new(format!(
            "distortion coefficient {} is {}; it must be a number",
            k + 1,
            d[k]
        ))),
    }
}
