//! A mark of a defect: a GeoJSON feature, and its validation.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// Maximum characters of a text in a mark.
const MAX_CHARACTERS: usize = 10_000;

/// Mark of a defect, a GeoJSON feature.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    #[serde(rename = "type")]
    kind: FeatureKind,
    /// Identifier of the mark: letters, digits, `-`.
    pub id: String,
    /// Point, or line between two points.
    pub geometry: Geometry,
    /// Attributes of the defect.
    pub properties: Properties,
    /// Members of other programs (RFC 7946, section 6.1), kept as they are.
    #[serde(flatten)]
    foreign: Map<String, Value>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum FeatureKind {
    Feature,
}

/// Position on the unrolled wall: chainage and arc length, metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", content = "coordinates")]
pub enum Geometry {
    /// A point.
    Point([f64; 2]),
    /// A measured line. Arc lengths may exceed the perimeter, so that the line takes the shorter
    /// way around.
    LineString([[f64; 2]; 2]),
}

impl Geometry {
    /// The point, or both ends of the line.
    fn places(&self) -> &[[f64; 2]] {
        match self {
            Self::Point(place) => std::slice::from_ref(place),
            Self::LineString(places) => places,
        }
    }
}

/// Attributes of a defect and its position in an inspector's terms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Properties {
    /// Defect code, as of EN 13508-2 (`BAB` for a crack), or any text.
    pub class: String,
    /// Severity, 1 (slight) to 5 (severe).
    pub severity: u8,
    /// A remark.
    pub note: String,
    /// Chainage, metres.
    pub chainage_m: f64,
    /// Clock position, hours and minutes.
    pub clock: String,
    /// Angle θ, degrees.
    pub theta_deg: f64,
    /// World coordinate x, metres.
    pub x_m: f64,
    /// World coordinate y, metres.
    pub y_m: f64,
    /// World coordinate z, metres.
    pub z_m: f64,
    /// Chainage of the other end, metres.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub end_chainage_m: Option<f64>,
    /// Clock position of the other end.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub end_clock: Option<String>,
    /// Length along the wall, metres.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub length_m: Option<f64>,
    /// Width of a crack, millimetres.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub width_mm: Option<f64>,
    /// The layer in which it was marked.
    pub layer: String,
    /// Time of creation, RFC 3339.
    pub created: String,
    /// Attributes of other programs, kept as they are.
    #[serde(flatten)]
    foreign: Map<String, Value>,
}

/// Two versions of a mark, of which none may be lost.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MarkVersions {
    /// Sentence about what happened.
    pub error: &'static str,
    /// The mark in the file; None if it has been removed.
    pub saved: Option<Mark>,
    /// The mark that was to be saved; None if it was to be removed.
    pub sent: Option<Mark>,
}

/// Largest difference of a coordinate and the chainage that it is, metres.
const CHAINAGE_TOLERANCE_M: f64 = 1e-6;

impl Mark {
    /// The mark with chainage before arc length. Those of version 0.1 have arc length first, which
    /// their chainages tell.
    pub(super) fn with_chainage_first(mut self) -> Self {
        let is_at = |axis: usize| {
            let of_point = |(place, chainage_m): (&[f64; 2], Option<f64>)| {
                chainage_m.is_none_or(|h_m| (place[axis] - h_m).abs() <= CHAINAGE_TOLERANCE_M)
            };
            let chainages = [
                Some(self.properties.chainage_m),
                self.properties.end_chainage_m,
            ];
            self.geometry.places().iter().zip(chainages).all(of_point)
        };
        if is_at(1) && !is_at(0) {
            match &mut self.geometry {
                Geometry::Point(place) => place.reverse(),
                Geometry::LineString(places) => places.iter_mut().for_each(|p| p.reverse()),
            }
        }
        self
    }

    /// Validates the mark.
    ///
    /// # Errors
    /// A description of the first invalid value.
    pub fn validate(&self) -> Result<(), &'static str> {
        let p = &self.properties;
        let name = |c: char| c.is_ascii_alphanumeric() || c == '-';
        let numbers = [p.chainage_m, p.theta_deg, p.x_m, p.y_m, p.z_m];
        let optional = [p.end_chainage_m, p.length_m, p.width_mm];
        let places = self.geometry.places();
        let all = numbers
            .into_iter()
            .chain(optional.into_iter().flatten())
            .chain(places.iter().flatten().copied());
        let texts = [&p.class, &p.note, &p.clock, &p.layer, &p.created];
        let wrong = [
            (
                !(1..=64).contains(&self.id.len()) || !self.id.chars().all(name),
                "its id must be 1 to 64 letters, digits or -",
            ),
            (
                !(1..=5).contains(&p.severity),
                "its severity must be 1 to 5",
            ),
            (
                all.into_iter().any(|v| !v.is_finite()),
                "a number of it is not finite",
            ),
            (
                texts
                    .into_iter()
                    .chain(&p.end_clock)
                    .any(|text| text.chars().count() > MAX_CHARACTERS),
                "a text of it is too long",
            ),
        ];
        match wrong.iter().find(|(wrong, _)| *wrong) {
            Some((_, what)) => Err(what),
            None => Ok(()),
        }
    }
}
