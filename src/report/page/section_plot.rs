//! Plot of one section with its deviations exaggerated.

use crate::evaluate::deformation::SectionProfile;
use crate::report::quantity::short;
use maud::{Markup, html};

/// Side of the drawing, its own units.
const SIDE: f64 = 220.0;
/// Space around the section for its labels.
const MARGIN: f64 = 34.0;
/// Largest deviation in the drawing, share of the section's half height.
const MAX_SHARE: f64 = 0.16;

/// Exaggeration of deviations that several plots have in common.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Exaggeration {
    /// Drawn length over true length, of deviations relative to the section.
    factor: f64,
    /// Deviation that the bar shows, millimetres.
    bar_mm: f64,
    /// Farthest point of the sections from their middle, metres.
    size_m: f64,
}

impl Exaggeration {
    /// The largest round factor (1, 2 or 5 times a power of ten) at which all deviations stay small
    /// beside the section; deviations are never made smaller.
    pub(super) fn new(profiles: &[SectionProfile]) -> Self {
        let points = profiles.iter().flat_map(|profile| &profile.outline_m);
        let size_m = points.map(|[x, z]| x.hypot(*z)).fold(0.1, f64::max);
        let deviations = profiles.iter().flat_map(|profile| &profile.deviation_mm);
        let most_mm = deviations.flatten().map(|d| d.abs()).fold(1e-3, f64::max);
        Self {
            factor: round_down(MAX_SHARE * size_m / (1e-3 * most_mm)).max(1.0),
            bar_mm: round_down(most_mm),
            size_m,
        }
    }

    /// The factor in words.
    pub(super) fn words(&self) -> String {
        format!("{} times exaggerated", self.factor)
    }

    /// Deviation that the bar shows, millimetres.
    pub(super) fn bar_mm(&self) -> f64 {
        self.bar_mm
    }

    /// Units of the drawing per metre of the section.
    fn scale(&self) -> f64 {
        (0.5 * SIDE - MARGIN) / self.size_m
    }

    /// Point (x, z) of a section, metres, moved along its normal, in the drawing.
    fn place(&self, [x, z]: [f64; 2], [nx, nz]: [f64; 2], deviation_mm: f64) -> [f64; 2] {
        let moved_m = 1e-3 * deviation_mm * self.factor;
        let scale = self.scale();
        [
            0.5 * SIDE + scale * (x + nx * moved_m),
            0.5 * SIDE - scale * (z + nz * moved_m),
        ]
    }
}

/// The largest of 1, 2 and 5 times a power of ten that is no more than a positive value.
fn round_down(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    let steps = [5.0, 2.0, 1.0].map(|step| step * power);
    let fitting = steps.into_iter().find(|step| *step <= value * (1.0 + 1e-9));
    fitting.unwrap_or(power)
}

/// Draws a section: the reference dashed, the wall solid where it is determined.
pub(super) fn section_plot(profile: &SectionProfile, exaggeration: &Exaggeration) -> Markup {
    let count = profile.outline_m.len();
    let place = |k: usize, deviation_mm: f64| {
        exaggeration.place(profile.outline_m[k], profile.normals[k], deviation_mm)
    };
    let text = |points: &[[f64; 2]]| {
        let pairs = points.iter().map(|[x, y]| format!("{x:.1},{y:.1}"));
        pairs.collect::<Vec<_>>().join(" ")
    };
    let reference: Vec<[f64; 2]> = (0..count).map(|k| place(k, 0.0)).collect();
    // Once around and back to the first point, in pieces that are determined.
    let wall: Vec<Option<[f64; 2]>> = (0..=count)
        .map(|k| profile.deviation_mm[k % count].map(|mm| place(k % count, mm)))
        .collect();
    let pieces = wall.split(Option::is_none);
    let pieces: Vec<Vec<[f64; 2]>> = pieces
        .map(|piece| piece.iter().copied().flatten().collect::<Vec<_>>())
        .filter(|piece| piece.len() > 1)
        .collect();
    let hours = [("12", 0), ("3", 1), ("6", 2), ("9", 3)];
    let bar = exaggeration.scale() * 1e-3 * exaggeration.bar_mm * exaggeration.factor;
    let (left, right) = (0.5 * (SIDE - bar), 0.5 * (SIDE + bar));
    let middle = 0.5 * SIDE;
    html! {
        svg role="img" viewBox=(format!("0 0 {SIDE} {SIDE}"))
            aria-label=(format!("Section at chainage {} m", short(profile.chainage_m)))
        {
            polygon.curve.initial points=(text(&reference)) {}
            @for piece in &pieces { polyline.curve.refined points=(text(piece)) {} }
            @for (hour, quarter) in hours {
                @let [x, y] = label_place(&reference, quarter);
                text.tick x=(format!("{x:.1}")) y=(format!("{y:.1}")) dy="0.35em"
                    text-anchor="middle" { (hour) }
            }
            line.bar x1=(format!("{left:.1}")) x2=(format!("{right:.1}")) y1=(middle) y2=(middle) {}
            line.bar x1=(format!("{left:.1}")) x2=(format!("{left:.1}"))
                y1=(middle - 3.0) y2=(middle + 3.0) {}
            line.bar x1=(format!("{right:.1}")) x2=(format!("{right:.1}"))
                y1=(middle - 3.0) y2=(middle + 3.0) {}
            text.tick x=(middle) y=(middle + 16.0) text-anchor="middle" {
                (exaggeration.bar_mm) " mm"
            }
        }
    }
}

/// Place of an hour's label: inside of the reference.
fn label_place(reference: &[[f64; 2]], quarter: usize) -> [f64; 2] {
    let middle = 0.5 * SIDE;
    let at = reference.get(quarter * reference.len() / 4);
    let [x, y] = at.copied().unwrap_or([middle; 2]);
    [middle + 0.72 * (x - middle), middle + 0.72 * (y - middle)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A circle of 3 m with 12 mm outwards at three o'clock, a quarter of it unknown.
    fn profile() -> SectionProfile {
        let angle = |k: usize| (2.0 * k as f64).to_radians();
        let normals: Vec<[f64; 2]> = (0..180).map(|k| [angle(k).sin(), angle(k).cos()]).collect();
        SectionProfile {
            chainage_m: 1.5,
            outline_m: normals.iter().map(|n| n.map(|c| 3.0 * c)).collect(),
            normals,
            deviation_mm: (0..180)
                .map(|k| (k < 135).then_some(if k == 45 { 12.0 } else { 0.0 }))
                .collect(),
        }
    }

    #[test]
    fn the_exaggeration_is_round_and_leaves_the_section_a_section() {
        let exaggeration = Exaggeration::new(&[profile()]);
        assert_eq!((exaggeration.factor, exaggeration.bar_mm), (20.0, 10.0));
        assert_eq!(
            [0.9, 1.0, 4.99, 51.0].map(round_down),
            [0.5, 1.0, 2.0, 50.0]
        );
        let nothing = Exaggeration::new(&[]);
        assert!(nothing.factor.is_finite() && nothing.bar_mm > 0.0);
    }

    #[test]
    fn what_is_not_determined_is_not_drawn() {
        let profile = profile();
        let exaggeration = Exaggeration::new(std::slice::from_ref(&profile));
        let text = section_plot(&profile, &exaggeration).into_string();
        assert_eq!(text.matches("curve refined").count(), 1);
        // Three o'clock: 76 units from the middle, and 20 · 12 mm of 3 m more.
        assert!(text.contains("192.1,110.0"), "{text}");
    }
}
