//! The line of a section on the map.

use super::network_file::{Network, Section};
use crate::jobs::error::JobError;
use crate::surface::Centreline;
use crate::survey::{Survey, SurveyError, SurveyFile, toml_path};
use std::path::Path;

/// Largest distance of vertices along a centreline, metres: a chord is then less than 5 mm off a
/// bend of 25 m.
const MAX_STEP_M: f64 = 1.0;

/// The line of a section on the map: vertices by their chainage, between which it is straight.
#[derive(Clone, Debug, PartialEq)]
pub struct SectionLine {
    /// Chainage, and position (east and north), metres. Chainage increases.
    vertices: Vec<(f64, [f64; 2])>,
}

impl SectionLine {
    /// The line of a section: straight from manhole to manhole with the bends between them, or the
    /// centreline of its survey, whose world is then the plane of the map.
    ///
    /// # Errors
    /// A survey.toml or a centreline that cannot be read; a section with neither.
    pub fn of(network: &Network, section: &Section) -> Result<Self, JobError> {
        if let Some(ends) = &section.ends {
            let [from, to] = [&ends.from, &ends.to].map(|id| network.position_m(id));
            let bends = ends.via_m.iter().copied();
            let points = from.into_iter().chain(bends).chain(to);
            return Ok(Self::through(points, ends.start_chainage_m));
        }
        let file = toml_path(&section.survey);
        let line = centreline(&file).map_err(|source| JobError::Survey {
            section: section.id.clone(),
            source,
        })?;
        line.as_ref().map(Self::along).ok_or_else(|| {
            let what = format!(
                "section {} has no place on the map: give the manholes at its ends (from, to), \
                 since its survey has no centreline",
                section.id
            );
            network.error_at(section.place, what)
        })
    }

    /// The straight line through points (metres), of which the first has a given chainage.
    fn through(points: impl Iterator<Item = [f64; 2]>, start_chainage_m: f64) -> Self {
        let mut vertices: Vec<(f64, [f64; 2])> = Vec::new();
        for point in points {
            let h_m = match vertices.last() {
                Some((h_m, last)) => h_m + (point[0] - last[0]).hypot(point[1] - last[1]),
                None => start_chainage_m,
            };
            vertices.push((h_m, point));
        }
        Self { vertices }
    }

    /// The line along a centreline.
    fn along(line: &Centreline) -> Self {
        let length_m = line.length_m();
        let steps = (length_m / MAX_STEP_M).ceil().max(1.0) as usize;
        let vertex = |k: usize| {
            let h_m = length_m * k as f64 / steps as f64;
            let point = line.at(h_m).point;
            (h_m, [point.x, point.y])
        };
        Self {
            vertices: (0..=steps).map(vertex).collect(),
        }
    }

    /// Positions of the vertices (east and north), metres.
    pub fn points_m(&self) -> Vec<[f64; 2]> {
        self.vertices.iter().map(|(_, point)| *point).collect()
    }

    /// The position (east and north, metres) at a chainage, metres; beyond its ends the line
    /// continues straight.
    pub fn at(&self, h_m: f64) -> [f64; 2] {
        let last = self.vertices.len() - 1;
        let after = self.vertices.partition_point(|(at_m, _)| *at_m < h_m);
        let after = after.clamp(1, last);
        let [(from_m, from), (to_m, to)] = [self.vertices[after - 1], self.vertices[after]];
        let share = (h_m - from_m) / (to_m - from_m);
        [0, 1].map(|k| from[k] + share * (to[k] - from[k]))
    }
}

/// The centreline of a survey, from its survey.toml; None if it is straight along its y axis.
fn centreline(file: &Path) -> Result<Option<Centreline>, SurveyError> {
    let SurveyFile { tunnel, .. } = Survey::read_file(file)?;
    let section = tunnel.section().map_err(|what| SurveyError::Value {
        path: file.to_owned(),
        what: format!("tunnel: {what}"),
    })?;
    let folder = file.parent().unwrap_or(Path::new(""));
    tunnel.centreline(folder, section.as_ref())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::CentrePoint;
    use nalgebra::Vector3;

    #[test]
    fn places_are_found_along_the_line_and_beyond_its_ends() {
        let points = [[100.0, 200.0], [103.0, 204.0], [103.0, 214.0]];
        let line = SectionLine::through(points.into_iter(), 2.0);
        assert_eq!(line.points_m(), points);
        for (h_m, expected) in [
            (2.0, points[0]),
            (4.5, [101.5, 202.0]),
            (7.0, points[1]),
            (17.0, points[2]),
            (18.0, [103.0, 215.0]),
            (-3.0, [97.0, 196.0]),
        ] {
            let place = line.at(h_m);
            let off_m = (place[0] - expected[0]).hypot(place[1] - expected[1]);
            assert!(off_m < 1e-12, "{h_m}: {place:?}");
        }
    }

    #[test]
    fn a_centreline_is_followed_in_plan() {
        let (radius_m, centre) = (25.0, [2_600_000.0, 1_200_000.0]);
        let on_arc = |angle: f64| {
            let (sin, cos) = angle.sin_cos();
            [centre[0] + radius_m * cos, centre[1] + radius_m * sin]
        };
        let points: Vec<CentrePoint> = (0..=60)
            .map(|k| on_arc(0.02 * f64::from(k)))
            .map(|[x, y]| CentrePoint {
                point: Vector3::new(x, y, 400.0),
                radius_m: None,
            })
            .collect();
        let line = SectionLine::along(&Centreline::through(&points, 1.0, 1.0).unwrap());
        for h_m in [0.0, 7.3, 29.9] {
            let [place, expected] = [line.at(h_m), on_arc(h_m / radius_m)];
            let off_m = (place[0] - expected[0]).hypot(place[1] - expected[1]);
            assert!(off_m < 0.006, "{h_m}: {off_m}");
        }
    }
}
