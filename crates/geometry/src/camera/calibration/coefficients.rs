//! Lists of the parameters of lenses, distortion coefficients in the order of OpenCV.

use super::error::ParseError;
use crate::camera::brown_conrady::{BrownCoefficients, BrownConrady};
use crate::camera::double_sphere::DoubleSphere;
use crate::camera::eucm::Eucm;
use crate::camera::fov::Fov;
use crate::camera::kannala_brandt::KannalaBrandt;
use crate::camera::lens::Lens;
use crate::camera::mei::Mei;
use crate::camera::thin_prism::{ThinPrismCoefficients, ThinPrismFisheye};

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

/// Reads `xi k1 k2 p1 p2`; missing coefficients at the end are 0.
pub fn mei(d: &[f64]) -> Result<Lens, ParseError> {
    let [xi, coefficients @ ..] = d else {
        return Err(ParseError::new("`xi` is missing"));
    };
    if !matches!(coefficients.len(), 0 | 2 | 4) {
        return Err(ParseError::new(format!(
            "there are {} distortion coefficients; the omnidirectional model has 4 (k1 k2 p1 p2)",
            coefficients.len()
        )));
    }
    let at = |k: usize| coefficients.get(k).copied().unwrap_or(0.0);
    let lens = Mei::new(*xi, [at(0), at(1)], [at(2), at(3)])?;
    Ok(Lens::Mei(lens))
}

/// Reads `xi alpha` of a double sphere.
pub fn double_sphere(d: &[f64]) -> Result<Lens, ParseError> {
    let [xi, alpha] = numbers(d, "a double sphere has xi and alpha")?;
    Ok(Lens::DoubleSphere(DoubleSphere::new(xi, alpha)?))
}

/// Reads `alpha beta` of an enhanced unified camera model.
pub fn eucm(d: &[f64]) -> Result<Lens, ParseError> {
    let [alpha, beta] = numbers(d, "an EUCM has alpha and beta")?;
    Ok(Lens::Eucm(Eucm::new(alpha, beta)?))
}

/// Reads `omega` of a field-of-view model.
pub fn fov(d: &[f64]) -> Result<Lens, ParseError> {
    let [omega] = numbers(d, "the FOV model has one coefficient")?;
    Ok(Lens::Fov(Fov::new(omega)?))
}

/// Reads COLMAP's `k1 k2 p1 p2 k3 k4 sx1 sy1`.
pub fn thin_prism_fisheye(d: &[f64]) -> Result<Lens, ParseError> {
    let [k1, k2, p1, p2, k3, k4, sx1, sy1] = numbers(d, "a thin-prism fisheye has 8")?;
    let lens = ThinPrismFisheye::new(ThinPrismCoefficients {
        k: [k1, k2, k3, k4],
        p: [p1, p2],
        s: [sx1, sy1],
    })?;
    Ok(Lens::ThinPrismFisheye(lens))
}

/// Exactly as many parameters as the model has.
fn numbers<const N: usize>(d: &[f64], model: &str) -> Result<[f64; N], ParseError> {
    d.try_into().map_err(|_| {
        ParseError::new(format!(
            "there are {} parameters of the lens; {model}",
            d.len()
        ))
    })
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
