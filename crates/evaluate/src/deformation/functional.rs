//! Linear functions of the displacements at points of a section, with their uncertainty.

use tunnelstitch_geometry::surface::{RadialField, WallPoint};

/// `L = L_0 + Σ_k w_k δ_k`.
#[derive(Clone, Debug)]
pub(super) struct Functional {
    /// L_0.
    pub(super) offset: f64,
    /// w, one for each point of the section.
    pub(super) weights: Vec<f64>,
}

/// Value of a linear function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Measured {
    /// The value, in the unit of the function.
    pub(super) value: f64,
    /// 1-σ of the value; None if it is unknown.
    pub(super) sigma: Option<f64>,
}

/// Displacements at the points of a section, and draws of their errors.
#[derive(Clone, Debug)]
pub(super) struct SectionSamples {
    /// δ at each point, metres.
    pub(super) delta_m: Vec<f64>,
    /// Draws of its errors, metres, point by point.
    draws_m: Vec<Vec<f64>>,
}

/// Smallest 1-σ, metres: a function whose draws are less is not expressed by the shape.
const MIN_SIGMA_M: f64 = 1e-9;

impl Functional {
    /// The function with the given weights at some points of `count`, and `offset`.
    pub(super) fn sparse(
        count: usize,
        offset: f64,
        terms: impl IntoIterator<Item = (usize, f64)>,
    ) -> Self {
        let mut weights = vec![0.0; count];
        for (point, weight) in terms {
            weights[point % count] += weight;
        }
        Self { offset, weights }
    }

    /// The function `scale · self + other_scale · other`.
    pub(super) fn combined(&self, scale: f64, other: &Self, other_scale: f64) -> Self {
        let pairs = self.weights.iter().zip(&other.weights);
        Self {
            offset: scale * self.offset + other_scale * other.offset,
            weights: pairs.map(|(a, b)| scale * a + other_scale * b).collect(),
        }
    }
}

impl SectionSamples {
    /// Evaluates the field and the draws of its errors at points of one chainage, metres.
    pub(super) fn new(field: &RadialField, draws: &[RadialField], walls: &[WallPoint]) -> Self {
        let s_m: Vec<f64> = walls.iter().map(|wall| wall.s_m).collect();
        let h_m = walls.first().map_or(0.0, |wall| wall.h_m);
        let at = |field: &RadialField| field.grid(&s_m, &[h_m]);
        Self {
            delta_m: at(field),
            draws_m: draws.iter().map(at).collect(),
        }
    }

    /// Value and 1-σ of a function; None if errors are known and the shape's functions do not
    /// express a change of it, so that its value is none that was measured.
    pub(super) fn measure_expressed(&self, function: &Functional) -> Option<Measured> {
        let measured = self.measure(function);
        (self.draws_m.is_empty() || measured.sigma.is_some()).then_some(measured)
    }

    /// Value and 1-σ of a function.
    pub(super) fn measure(&self, function: &Functional) -> Measured {
        let dot = |values: &[f64]| -> f64 {
            let terms = values.iter().zip(&function.weights);
            terms.map(|(value, weight)| value * weight).sum()
        };
        let square: f64 = self.draws_m.iter().map(|draw| dot(draw).powi(2)).sum();
        let sigma = (square / self.draws_m.len() as f64).sqrt();
        Measured {
            value: function.offset + dot(&self.delta_m),
            sigma: (sigma > MIN_SIGMA_M).then_some(sigma),
        }
    }
}
