//! Deformation of the wall that a survey can measure.

use super::pictures::PictureCheck;
use crate::refine::{DeformationBound, PictureTexture, RefineError, deformation_bound};
use crate::survey::Survey;
use serde::Serialize;

/// Share of what is known of the deformation beforehand that must be left of its 1-σ for another
/// advance per turn to be worth a warning.
const MAX_SHARE_OF_PRIOR: f64 = 0.5;
/// Largest 1-σ with half the advance per turn, as a share of that of the survey, for advising it.
const MAX_SHARE_OF_ADVICE: f64 = 0.7;

/// The least uncertainty of the wall's deformation, 1-σ against the circle or section that fits
/// best, millimetres.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DeformationCheck {
    /// Distance of the nodes of deformation, metres.
    pub node_m: f64,
    /// Of a node between the first and the last camera, in the median.
    pub node_sigma_mm: f64,
    /// That of a node before any frame is seen.
    pub prior_sigma_mm: f64,
    /// Of the amplitudes of cos mθ and sin mθ over the survey, m = 2 (ovality) to 5.
    pub harmonic_sigma_mm: Vec<f64>,
    /// Of a node if the camera advanced half as much per turn; None in bends.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub half_advance_sigma_mm: Option<f64>,
}

impl DeformationCheck {
    /// The bound for pictures with the texture of `pictures` at the initial poses; None if the wall
    /// is said to be exact, or if there is no texture or no overlap.
    pub(super) fn of(
        survey: &Survey,
        pictures: &PictureCheck,
    ) -> Result<Option<Self>, RefineError> {
        if pictures.sigma_px.is_none() {
            return Ok(None);
        }
        let texture = PictureTexture {
            slope_grey_per_px: pictures.slope_grey_per_px,
            noise_grey: pictures.noise_grey.max(super::pictures::MIN_NOISE_GREY),
        };
        Ok(deformation_bound(survey, &texture)?.map(Self::from))
    }

    /// The bound in words.
    pub fn sentence(&self) -> String {
        let [node, ovality] = [
            self.node_sigma_mm,
            self.harmonic_sigma_mm.first().copied().unwrap_or(f64::NAN),
        ]
        .map(millimetres);
        format!(
            "to ± {node} mm at nodes {:.2} m apart, ovality to ± {ovality} mm, at best (1-σ)",
            self.node_m
        )
    }

    /// A warning if the frames hardly tell the deformation, with what would help.
    pub(super) fn warning(&self) -> Option<String> {
        if self.node_sigma_mm <= MAX_SHARE_OF_PRIOR * self.prior_sigma_mm {
            return None;
        }
        let mut text = format!(
            "the frames hardly tell the wall's deformation (± {} mm of ± {} mm that are assumed): \
             where only one turn sees the wall, all frames see it from the same side",
            millimetres(self.node_sigma_mm),
            millimetres(self.prior_sigma_mm)
        );
        let better = self.half_advance_sigma_mm;
        if let Some(better) = better.filter(|b| *b < MAX_SHARE_OF_ADVICE * self.node_sigma_mm) {
            text += &format!(
                "; with half the advance per turn, so that turns overlap more, it would be ± {} mm",
                millimetres(better)
            );
        }
        Some(text)
    }
}

impl From<DeformationBound> for DeformationCheck {
    fn from(bound: DeformationBound) -> Self {
        let sigmas_m = bound.harmonic_sigma_m.iter();
        Self {
            node_m: bound.node_m,
            node_sigma_mm: 1e3 * bound.node_sigma_m,
            prior_sigma_mm: 1e3 * bound.prior_sigma_m,
            harmonic_sigma_mm: sigmas_m.map(|sigma_m| 1e3 * sigma_m).collect(),
            half_advance_sigma_mm: bound.half_advance_sigma_m.map(|sigma_m| 1e3 * sigma_m),
        }
    }
}

/// Millimetres with two significant digits.
fn millimetres(value: f64) -> String {
    let decimals = (1.0 - value.abs().max(1e-6).log10().floor()).clamp(0.0, 4.0);
    format!("{value:.0$}", decimals as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(node_sigma_mm: f64, half_advance_sigma_mm: f64) -> DeformationCheck {
        DeformationCheck {
            node_m: 0.6,
            node_sigma_mm,
            prior_sigma_mm: 10.0,
            harmonic_sigma_mm: vec![0.034],
            half_advance_sigma_mm: Some(half_advance_sigma_mm),
        }
    }

    #[test]
    fn half_the_advance_is_advised_where_it_helps() {
        assert_eq!(check(0.2, 0.1).warning(), None);
        let helps = check(8.0, 0.32).warning().unwrap();
        assert!(helps.contains("± 8.0 mm of ± 10 mm"), "{helps}");
        assert!(helps.contains("with half the advance per turn"), "{helps}");
        assert!(helps.ends_with("± 0.32 mm"), "{helps}");
        let useless = check(8.0, 7.0).warning().unwrap();
        assert!(!useless.contains("half the advance"), "{useless}");
    }

    #[test]
    fn figures_have_two_digits() {
        let said = check(0.2, 0.1).sentence();
        assert!(said.contains("± 0.20 mm at nodes 0.60 m apart"), "{said}");
        assert!(said.contains("ovality to ± 0.034 mm"), "{said}");
    }
}
