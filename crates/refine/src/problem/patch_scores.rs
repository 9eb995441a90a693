//! Scores of patches of the wall: the gradients that the pixels of each patch contribute.

use crate::parameters::calibration::Kappa;
use crate::parameters::frame_estimate::FrameStep;
use crate::problem::linearisation::BlockGradient;
use crate::problem::photometric_problem::PhotometricProblem;
use std::collections::BTreeMap;

/// The scores of square patches of blocks, by row and column of the patch.
#[derive(Clone, Debug, Default)]
pub struct PatchScores(BTreeMap<(i64, i64), PatchScore>);

/// The score of one patch.
#[derive(Clone, Debug, PartialEq)]
pub struct PatchScore {
    /// The slots that it concerns, ascending, with their gradients.
    pub slots: Vec<(usize, FrameStep)>,
    /// Gradient of the shared parameters.
    pub shared: Kappa,
}

impl PatchScores {
    /// Number of patches.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// The scores, in a fixed order.
    pub fn iter(&self) -> impl Iterator<Item = &PatchScore> {
        self.0.values()
    }

    /// The scores of patches twice as wide and high.
    pub fn doubled(&self) -> Self {
        let mut doubled = Self::default();
        for ((row, column), score) in &self.0 {
            let slots = score.slots.iter().map(|(slot, gradient)| (*slot, gradient));
            doubled.add(
                (row.div_euclid(2), column.div_euclid(2)),
                slots,
                &score.shared,
            );
        }
        doubled.fit();
        doubled
    }

    /// Gives back memory that is not used; scores are large for what they are.
    fn fit(&mut self) {
        self.0
            .values_mut()
            .for_each(|score| score.slots.shrink_to_fit());
    }

    /// Adds gradients to those of a patch.
    fn add<'g>(
        &mut self,
        patch: (i64, i64),
        slots: impl Iterator<Item = (usize, &'g FrameStep)>,
        shared: &Kappa,
    ) {
        let score = self.0.entry(patch).or_insert_with(|| PatchScore {
            slots: Vec::new(),
            shared: Kappa::zeros(),
        });
        for (slot, gradient) in slots {
            match score.slots.binary_search_by_key(&slot, |(slot, _)| *slot) {
                Ok(place) => score.slots[place].1 += gradient,
                Err(place) => score.slots.insert(place, (slot, *gradient)),
            }
        }
        score.shared += shared;
    }
}

impl PhotometricProblem<'_> {
    /// The scores of patches of 2 × 2 blocks by the gradients of blocks, scaled as the gradient of
    /// the cost is.
    pub fn patch_scores(&self, gradients: &[BlockGradient]) -> PatchScores {
        let calibration = &self.context.calibration;
        let mut scores = PatchScores::default();
        let information = self.information();
        let free = Kappa::from_fn(|k, _| {
            if calibration.free[k] {
                information
            } else {
                0.0
            }
        });
        for block in gradients {
            let gradients = block.slot_gradients.iter();
            let gradients: Vec<FrameStep> = gradients.map(|g| g * information).collect();
            let shared = block
                .shared
                .unwrap_or_else(Kappa::zeros)
                .component_mul(&free);
            let (row, column) = block.block;
            let patch = (row.div_euclid(2), column.div_euclid(2));
            scores.add(patch, block.slots.iter().copied().zip(&gradients), &shared);
        }
        scores.fit();
        scores
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::test_ring::Ring;

    /// Scores of all patches add up to the gradient without the prior, whatever their size.
    #[test]
    fn scores_add_up_to_the_gradient() {
        let ring = Ring::new(1e-4);
        let problem = ring.problem();
        let at = problem.linearise(&ring.estimates).unwrap();
        let mut scores = problem.patch_scores(&at.block_gradients);
        let mut prior = crate::linear::normal_equations::NormalEquations::zeros(problem.pattern());
        let unknowns = problem.unknowns_of(&ring.estimates);
        problem.add_prior(&unknowns, problem.pattern(), &mut prior, None);
        for _ in 0..3 {
            let mut sums = vec![FrameStep::zeros(); ring.estimates.len()];
            for score in scores.iter() {
                for (slot, gradient) in &score.slots {
                    sums[*slot] += gradient;
                }
            }
            for (k, sum) in sums.iter().enumerate() {
                let expected = at.normal.gradient[k] - prior.gradient[k];
                assert!(
                    (sum - expected).norm() < 1e-9 * expected.norm().max(1.0),
                    "{k}"
                );
            }
            scores = scores.doubled();
        }
    }
}
