//! Outline of a section with its deviation, to be drawn.

use super::deviation::DeviationMap;
use super::outline::SectionOutline;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::surface::Surface;

/// Degrees between the points of a profile.
const STEP_DEG: usize = 2;

/// Outline of a section and the wall's deviation from it: point by point from twelve o'clock
/// towards three, as seen towards increasing chainage, x to the right and z upwards.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SectionProfile {
    /// Chainage, metres.
    pub chainage_m: f64,
    /// Points (x, z) of the nominal section, about their mean, metres.
    pub outline_m: Vec<[f64; 2]>,
    /// Unit normals, outwards.
    pub normals: Vec<[f64; 2]>,
    /// Deviation from the best-fit circle, or from the nominal section if it is no circle,
    /// millimetres; None where it is not determined.
    pub deviation_mm: Vec<Option<f64>>,
}

impl SectionProfile {
    /// The section of a nominal wall at a chainage, metres, with the deviations of a map.
    pub fn new(nominal: &dyn Surface, map: &DeviationMap, h_m: f64) -> Self {
        let SectionOutline {
            walls,
            points,
            normals,
            ..
        } = SectionOutline::new(nominal, h_m);
        let centre = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
        let quarter = points.len() / 4;
        let up = (points[0] - points[2 * quarter]).normalize();
        let right = points[quarter] - points[3 * quarter];
        let right = (right - up * right.dot(&up)).normalize();
        let across = |vector: &Vector3<f64>| [vector.dot(&right), vector.dot(&up)];
        let deviation_mm = walls.iter().step_by(STEP_DEG).map(|wall| {
            let deviation = map.at(*wall);
            deviation.map(|deviation| 1e3 * deviation.value_m)
        });
        Self {
            chainage_m: h_m,
            outline_m: points
                .iter()
                .step_by(STEP_DEG)
                .map(|point| across(&(point - centre)))
                .collect(),
            normals: normals.iter().step_by(STEP_DEG).map(across).collect(),
            deviation_mm: deviation_mm.collect(),
        }
    }
}
