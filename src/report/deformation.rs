//! Deformation of the wall in the report.

use super::error::ReportError;
use super::refined_files::RefinedFiles;
use crate::evaluate::deformation::{
    DeviationGrid, DeviationMap, SectionDeformation, SectionProfile,
};
use crate::survey::Survey;
use serde::{Deserialize, Serialize};

/// Largest number of sections that are drawn.
const MAX_PROFILES: usize = 6;

/// Deformation of the wall against the best-fit circles of its sections, or against the nominal
/// section if it is no circle.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Deformation {
    /// The deviation over the wall.
    pub map: DeviationGrid,
    /// Sections along the tunnel, as in `sections.csv`; empty if that is missing.
    pub sections: Vec<SectionDeformation>,
    /// Outlines of some sections.
    pub profiles: Vec<SectionProfile>,
}

/// Gathers the deformation of a survey's wall; None if it has none.
///
/// # Errors
/// A shape file that cannot be read.
pub fn gather_deformation(
    survey: &Survey,
    refined: &RefinedFiles,
) -> Result<Option<Deformation>, ReportError> {
    let Some(map) = DeviationMap::of_survey(survey)? else {
        return Ok(None);
    };
    let Some(grid) = DeviationGrid::new(&map) else {
        return Ok(None);
    };
    let sections = refined.sections.clone().unwrap_or_default();
    let nominal = survey.nominal.as_ref();
    let chosen = choose(&sections, MAX_PROFILES);
    let profiles =
        chosen.filter_map(|section| Some(SectionProfile::new(nominal, &map, section.chainage_m?)));
    Ok(Some(Deformation {
        profiles: profiles.collect(),
        map: grid,
        sections,
    }))
}

/// At most `most` sections, evenly from the first to the last.
fn choose(
    sections: &[SectionDeformation],
    most: usize,
) -> impl Iterator<Item = &SectionDeformation> {
    let count = sections.len().min(most);
    let at = move |k: usize| {
        let gaps = count.saturating_sub(1).max(1);
        (k * sections.len().saturating_sub(1)) / gaps
    };
    (0..count).map(move |k| &sections[at(k)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chosen_sections_reach_from_the_first_to_the_last() {
        let sections = vec![SectionDeformation::default(); 20];
        let places = |count: usize, most: usize| -> Vec<usize> {
            let all = &sections[..count];
            let place = |section: &SectionDeformation| {
                all.iter().position(|other| std::ptr::eq(other, section))
            };
            choose(all, most).filter_map(place).collect()
        };
        assert_eq!(places(20, 4), [0, 6, 12, 19]);
        assert_eq!(places(3, 6), [0, 1, 2]);
        assert_eq!(places(1, 6), [0]);
        assert!(places(0, 6).is_empty());
    }
}
