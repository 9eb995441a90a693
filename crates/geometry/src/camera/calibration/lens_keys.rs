//! The keys of lenses in the program's own calibration format.

use super::coefficients::{double_sphere, eucm, fov, mei};
use super::error::ParseError;
use crate::camera::brown_conrady::{BrownCoefficients, BrownConrady};
use crate::camera::kannala_brandt::KannalaBrandt;
use crate::camera::lens::Lens;
use crate::camera::ocam::{OCAM_COEFFICIENTS, Ocam};
use crate::camera::thin_prism::{ThinPrismCoefficients, ThinPrismFisheye};
use serde::{Deserialize, Serialize};

/// Names of the lens models.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Model {
    /// Pinhole; coefficients of [`Model::BrownConrady`] are accepted.
    #[default]
    Pinhole,
    /// [`crate::camera::BrownConrady`].
    BrownConrady,
    /// [`crate::camera::KannalaBrandt`].
    #[serde(alias = "fisheye", alias = "equidistant")]
    KannalaBrandt,
    /// [`crate::camera::Mei`].
    Mei,
    /// [`crate::camera::DoubleSphere`].
    DoubleSphere,
    /// [`crate::camera::Eucm`].
    Eucm,
    /// [`crate::camera::Fov`].
    Fov,
    /// [`crate::camera::ThinPrismFisheye`].
    ThinPrismFisheye,
    /// [`crate::camera::Ocam`].
    Ocam,
}

impl Model {
    /// The keys of the model and their description, for messages.
    fn keys(self) -> (&'static [&'static str], &'static str) {
        match self {
            Self::Pinhole | Self::BrownConrady => (
                &["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"],
                "a pinhole or brown-conrady lens has k1 to k6, p1 and p2",
            ),
            Self::KannalaBrandt => (
                &["k1", "k2", "k3", "k4"],
                "a kannala-brandt lens has k1 to k4",
            ),
            Self::Mei => (
                &["xi", "k1", "k2", "p1", "p2"],
                "a mei lens has xi, k1, k2, p1 and p2",
            ),
            Self::DoubleSphere => (&["xi", "alpha"], "a double-sphere lens has xi and alpha"),
            Self::Eucm => (&["alpha", "beta"], "an eucm lens has alpha and beta"),
            Self::Fov => (&["omega"], "a fov lens has omega"),
            Self::ThinPrismFisheye => (
                &["k1", "k2", "k3", "k4", "p1", "p2", "sx1", "sy1"],
                "a thin-prism-fisheye lens has k1 to k4, p1, p2, sx1 and sy1",
            ),
            Self::Ocam => (
                &["polynomial", "c", "d", "e"],
                "an ocam lens has polynomial, c, d and e",
            ),
        }
    }
}

/// The parameters of a lens by their keys.
#[derive(Clone, Debug, Default)]
pub struct LensKeys {
    /// The model.
    pub model: Model,
    /// k1 to k6.
    pub k: [f64; 6],
    /// p1, p2.
    pub p: [f64; 2],
    /// sx1, sy1.
    pub s: [f64; 2],
    /// ξ.
    pub xi: Option<f64>,
    /// α.
    pub alpha: Option<f64>,
    /// β.
    pub beta: Option<f64>,
    /// ω, radians.
    pub omega: Option<f64>,
    /// a2, a3 and so on of an [`Ocam`].
    pub polynomial: Option<Vec<f64>>,
    /// c, d, e.
    pub affine: [Option<f64>; 3],
}

impl LensKeys {
    /// The keys of a lens.
    pub fn of(lens: &Lens) -> Self {
        let none = Self::default();
        let with = |k: &[f64]| std::array::from_fn(|at| k.get(at).copied().unwrap_or(0.0));
        match lens {
            Lens::BrownConrady(lens) => {
                let BrownCoefficients { k, p } = *lens.coefficients();
                let model = if lens.is_distortion_free() {
                    Model::Pinhole
                } else {
                    Model::BrownConrady
                };
                Self {
                    model,
                    k,
                    p,
                    ..none
                }
            }
            Lens::KannalaBrandt(lens) => Self {
                model: Model::KannalaBrandt,
                k: with(lens.coefficients()),
                ..none
            },
            Lens::Mei(lens) => Self {
                model: Model::Mei,
                xi: Some(lens.xi()),
                k: with(&lens.k()),
                p: lens.p(),
                ..none
            },
            Lens::DoubleSphere(lens) => {
                let [xi, alpha] = lens.parameters().map(Some);
                let model = Model::DoubleSphere;
                Self {
                    model,
                    xi,
                    alpha,
                    ..none
                }
            }
            Lens::Eucm(lens) => {
                let [alpha, beta] = lens.parameters().map(Some);
                let model = Model::Eucm;
                Self {
                    model,
                    alpha,
                    beta,
                    ..none
                }
            }
            Lens::Fov(lens) => Self {
                model: Model::Fov,
                omega: Some(lens.omega()),
                ..none
            },
            Lens::ThinPrismFisheye(lens) => {
                let ThinPrismCoefficients { k, p, s } = *lens.coefficients();
                let (model, k) = (Model::ThinPrismFisheye, with(&k));
                Self {
                    model,
                    k,
                    p,
                    s,
                    ..none
                }
            }
            Lens::Ocam(lens) => {
                let polynomial = lens.polynomial();
                let last = polynomial.iter().rposition(|a| *a != 0.0).unwrap_or(0);
                Self {
                    model: Model::Ocam,
                    polynomial: Some(polynomial[..=last].to_vec()),
                    affine: lens.affine().map(Some),
                    ..none
                }
            }
        }
    }

    /// The lens.
    ///
    /// # Errors
    /// A key that the model does not have, a missing one, and a value out of its range.
    pub fn lens(&self) -> Result<Lens, ParseError> {
        self.reject_foreign_keys()?;
        let [k1, k2, k3, k4, ..] = self.k;
        let needed = |name: &str, value: Option<f64>| {
            let (_, description) = self.model.keys();
            value.ok_or_else(|| ParseError::new(format!("{description}; {name} is missing")))
        };
        match self.model {
            Model::Pinhole | Model::BrownConrady => {
                self.reject_infinite_coefficients()?;
                let (k, p) = (self.k, self.p);
                let lens = BrownConrady::new(BrownCoefficients { k, p });
                Ok(Lens::BrownConrady(lens))
            }
            Model::KannalaBrandt => {
                self.reject_infinite_coefficients()?;
                let lens = KannalaBrandt::new([k1, k2, k3, k4]);
                Ok(Lens::KannalaBrandt(lens))
            }
            Model::Mei => mei(&[needed("xi", self.xi)?, k1, k2, self.p[0], self.p[1]]),
            Model::DoubleSphere => {
                double_sphere(&[needed("xi", self.xi)?, needed("alpha", self.alpha)?])
            }
            Model::Eucm => eucm(&[needed("alpha", self.alpha)?, needed("beta", self.beta)?]),
            Model::Fov => fov(&[needed("omega", self.omega)?]),
            Model::ThinPrismFisheye => {
                let (k, p, s) = ([k1, k2, k3, k4], self.p, self.s);
                let lens = ThinPrismFisheye::new(ThinPrismCoefficients { k, p, s })?;
                Ok(Lens::ThinPrismFisheye(lens))
            }
            Model::Ocam => self.ocam(),
        }
    }

    fn ocam(&self) -> Result<Lens, ParseError> {
        let given = self.polynomial.as_deref().unwrap_or_default();
        if given.is_empty() || given.len() > OCAM_COEFFICIENTS {
            return Err(ParseError::new(format!(
                "an ocam lens has polynomial, a list of 1 to {OCAM_COEFFICIENTS} numbers (a2, a3, \
                 … in focal lengths), not of {}",
                given.len()
            )));
        }
        let mut polynomial = [0.0; OCAM_COEFFICIENTS];
        polynomial[..given.len()].copy_from_slice(given);
        let [c, d, e] = self.affine;
        let affine = [c.unwrap_or(1.0), d.unwrap_or(0.0), e.unwrap_or(0.0)];
        Ok(Lens::Ocam(Ocam::new(polynomial, affine)?))
    }

    /// Names and values of the coefficients that are 0 if missing.
    fn coefficients(&self) -> impl Iterator<Item = (&'static str, f64)> {
        let names = ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "sx1", "sy1"];
        let values = self.k.into_iter().chain(self.p).chain(self.s);
        names.into_iter().zip(values)
    }

    /// Names of the keys that have a value.
    fn given(&self) -> impl Iterator<Item = &'static str> {
        let [c, d, e] = self.affine;
        let others = [
            ("xi", self.xi.is_some()),
            ("alpha", self.alpha.is_some()),
            ("beta", self.beta.is_some()),
            ("omega", self.omega.is_some()),
            ("polynomial", self.polynomial.is_some()),
            ("c", c.is_some()),
            ("d", d.is_some()),
            ("e", e.is_some()),
        ];
        let coefficients = self
            .coefficients()
            .map(|(name, value)| (name, value != 0.0));
        let all = coefficients.chain(others);
        all.filter(|(_, is_given)| *is_given).map(|(name, _)| name)
    }

    fn reject_foreign_keys(&self) -> Result<(), ParseError> {
        let (keys, description) = self.model.keys();
        match self.given().find(|name| !keys.contains(name)) {
            None => Ok(()),
            Some(name) => Err(ParseError::new(format!("{description} only, not {name}"))),
        }
    }

    fn reject_infinite_coefficients(&self) -> Result<(), ParseError> {
        match self.coefficients().find(|(_, value)| !value.is_finite()) {
            None => Ok(()),
            Some((name, value)) => Err(ParseError::new(format!(
                "{name} is {value}; it must be a number"
            ))),
        }
    }
}
