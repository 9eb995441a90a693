//! Section about the deformation of the wall: its map, sections, and figures along the chainage.

use super::map_strip::{MapStrip, scale_legend};
use super::page_data::PageData;
use super::section_plot::{Exaggeration, section_plot};
use crate::evaluate::deformation::{DeviationGrid, SectionDeformation, clock_position};
use crate::refine::ShapeReport;
use crate::report::chart::{Axis, Chart, ChartElement, CurveStyle, Series, Vertical, legend};
use crate::report::deformation::Deformation;
use crate::report::error::ReportError;
use crate::report::heat_map::ColourScale;
use crate::report::quantity::{fixed, short};
use maud::{Markup, html};
use tunnelstitch_core::colour_map::Palette;

/// Draws the section; None if it is not known whether the wall is deformed.
///
/// # Errors
/// [`ReportError::Encode`].
pub fn section(data: &PageData) -> Result<Option<Markup>, ReportError> {
    let report = data.report;
    match &report.deformation {
        Some(deformation) => Ok(Some(draw(deformation, report.survey.perimeter_m)?)),
        None => Ok(report.refinement.as_ref().map(|refinement| {
            html! { p { (without_deformation(refinement.shape.as_ref())) } }
        })),
    }
}

/// Words about a wall without a deformation; `shape`: that was estimated, if one was looked for.
fn without_deformation(shape: Option<&ShapeReport>) -> String {
    let Some(shape) = shape else {
        return "No deformation was looked for: the wall is taken as given.".to_owned();
    };
    let none = "No deformation was found: as far as the frames show, the wall is as given.";
    match shape.none_above_mm() {
        Some(mm) => {
            format!("{none} One of {mm:.2} mm (root mean square) would have been seen.")
        }
        None => none.to_owned(),
    }
}

fn draw(deformation: &Deformation, perimeter_m: f64) -> Result<Markup, ReportError> {
    let sections = &deformation.sections;
    let is_round =
        (sections.iter()).any(|section| section.ovality_mm.or(section.radius_m).is_some());
    let reference = if is_round || sections.is_empty() {
        "the best-fit circle of its section"
    } else {
        "the nominal section"
    };
    let deviation = scale(Palette::BlueRed, deformation.map.size_mm());
    let sigma = scale(Palette::Cividis, deformation.map.sigma_size_mm());
    Ok(html! {
        p {
            "Deviation of the wall from " (reference)
            ", estimated with the poses; outwards is positive. The unrolled wall is seen from \
             inside, chainage to the right, clock position upwards; it is " (short(perimeter_m))
            " m around. Blank: the frames do not determine it."
        }
        (strip("Deviation", &deformation.map, &deformation.map.deviation_mm, &deviation)?)
        (scale_legend("mm; blue: inwards, red: outwards", &deviation))
        @if deformation.map.sigma_mm.iter().any(Option::is_some) {
            (strip("1-σ of the deviation", &deformation.map, &deformation.map.sigma_mm, &sigma)?)
            (scale_legend("mm", &sigma))
        }
        @if !deformation.profiles.is_empty() { (plots(deformation)) }
        @if sections.len() > 1 {
            h3 { "Along the tunnel" }
            p {
                "Lengths are relative to the nominal section, which sets the scale: no picture \
                 shows it. Convergence is a negative change of a chord. All sections are in "
                code { "sections.csv" } "."
            }
            (charts(sections))
        }
    })
}

/// Scale of a map up to `most`: symmetric about zero for either sign, from zero for amounts.
fn scale(palette: Palette, most: f64) -> ColourScale {
    let low = match palette {
        Palette::BlueRed => -most,
        Palette::Cividis => 0.0,
    };
    ColourScale {
        palette,
        range: [low, most],
        logarithmic: false,
    }
}

fn strip(
    title: &str,
    map: &DeviationGrid,
    values: &[Option<f64>],
    scale: &ColourScale,
) -> Result<Markup, ReportError> {
    let known: Vec<f64> = values.iter().copied().flatten().collect();
    let square: f64 = known.iter().map(|value| value * value).sum();
    let rms = (square / known.len() as f64).sqrt();
    MapStrip {
        title,
        size: [map.around, map.along],
        chainage_m: map.chainage_m,
        reading: (!known.is_empty()).then(|| format!("RMS {} mm", short(rms))),
    }
    .draw(values, scale)
}

/// Plots of the chosen sections.
fn plots(deformation: &Deformation) -> Markup {
    let exaggeration = Exaggeration::new(&deformation.profiles);
    let find = |chainage_m: f64| {
        let sections = deformation.sections.iter();
        let mut here = sections.filter(|section| section.chainage_m == Some(chainage_m));
        here.next()
    };
    html! {
        h3 { "Sections" }
        p {
            "Seen towards increasing chainage. Deviations are drawn " (exaggeration.words())
            " from the dashed reference; the bar is " (exaggeration.bar_mm()) " mm."
        }
        div.sections {
            @for profile in &deformation.profiles {
                figure.section {
                    (section_plot(profile, &exaggeration))
                    figcaption {
                        b { (fixed(profile.chainage_m, 2)) " m" }
                        @if let Some(section) = find(profile.chainage_m) { (words(section)) }
                    }
                }
            }
        }
    }
}

/// Figures of a section in words.
fn words(section: &SectionDeformation) -> Markup {
    let with_sigma = |value: f64, sigma: Option<f64>| match sigma {
        Some(sigma) => format!("{} ± {} mm", fixed(value, 2), fixed(sigma, 2)),
        None => format!("{} mm", fixed(value, 2)),
    };
    html! {
        @if let Some(change_mm) = section.radius_change_mm {
            br; "radius less nominal " (with_sigma(change_mm, section.radius_sigma_mm))
        }
        @if let Some(ovality_mm) = section.ovality_mm {
            br; "ovality " (with_sigma(ovality_mm, section.ovality_sigma_mm))
            @if let Some(angle_deg) = section.max_diameter_deg {
                br; "widest at " (clock_position(angle_deg))
                @if let Some(sigma_deg) = section.max_diameter_sigma_deg {
                    " ± " (fixed(sigma_deg, 1)) "°"
                }
            }
        }
        @if let Some(rms_mm) = section.deviation_rms_mm {
            br; "deviation RMS " (fixed(rms_mm, 2)) " mm"
        }
    }
}

/// A number of a section with its 1-σ.
type Figure = fn(&SectionDeformation) -> [Option<f64>; 2];

/// A curve: its name and number.
type Curve = (&'static str, Figure);

const CHORDS: [Curve; 4] = [
    ("9–3 o\u{2019}clock", |s| {
        [s.horizontal_change_mm, s.horizontal_sigma_mm]
    }),
    ("6–12", |s| [s.vertical_change_mm, s.vertical_sigma_mm]),
    ("7:30–1:30", |s| [s.rising_change_mm, s.rising_sigma_mm]),
    ("10:30–4:30", |s| {
        [s.falling_change_mm, s.falling_sigma_mm]
    }),
];

/// A chart of curves over the sections; empty if none has a value.
fn chart(
    sections: &[SectionDeformation],
    title: &str,
    vertical: Vertical,
    curves: &[Curve],
) -> Markup {
    let series = curves.iter().enumerate().map(|(k, (name, figure))| {
        let style = match curves {
            [_] => CurveStyle::Refined,
            _ => CurveStyle::Ordered(k),
        };
        curve(sections, name, style, *figure)
    });
    let series: Vec<Series> = series.collect();
    if series.iter().all(|curve| curve.points.is_empty()) {
        return Markup::default();
    }
    Chart {
        title: title.to_owned(),
        unit: "mm".to_owned(),
        along: axis(sections),
        vertical,
        series,
        marks: Vec::new(),
    }
    .draw()
}

const CENTRE: [Curve; 2] = [
    ("centre towards 3 o\u{2019}clock", |s| {
        [s.centre_x_mm, s.centre_x_sigma_mm]
    }),
    ("towards 12", |s| [s.centre_z_mm, s.centre_z_sigma_mm]),
];

/// Charts along the chainage.
fn charts(sections: &[SectionDeformation]) -> Markup {
    let entries = |curves: &[Curve]| -> Vec<(&str, CurveStyle)> {
        let names = curves.iter().map(|(name, _)| *name);
        names.zip((0..).map(CurveStyle::Ordered)).collect()
    };
    let has_centre = sections.iter().any(|section| section.centre_x_mm.is_some());
    html! {
        @if has_centre { (legend(&entries(&CENTRE), &[ChartElement::Band])) }
        div.charts {
            (chart(sections, "Best-fit radius, minus nominal", Vertical::Linear, &[
                ("radius", |s| [s.radius_change_mm, s.radius_sigma_mm]),
            ]))
            (chart(sections, "Centre of the best-fit circle", Vertical::Linear, &CENTRE))
            (chart(sections, "Ovality: D max − D min", Vertical::FromZero, &[
                ("ovality", |s| [s.ovality_mm, s.ovality_sigma_mm]),
            ]))
            (chart(sections, "Deviation, root mean square", Vertical::FromZero, &[
                ("deviation", |s| [s.deviation_rms_mm, None]),
            ]))
        }
        (legend(&entries(&CHORDS), &[ChartElement::Band]))
        div.charts { (chart(sections, "Chords, minus nominal", Vertical::Linear, &CHORDS)) }
    }
}

/// A curve over the sections that have its number.
fn curve(sections: &[SectionDeformation], name: &str, style: CurveStyle, of: Figure) -> Series {
    let known = sections.iter().filter_map(|section| {
        let [value, sigma] = of(section);
        Some(([section.chainage_m?, value?], sigma))
    });
    let (points, sigmas): (Vec<[f64; 2]>, Vec<Option<f64>>) = known.unzip();
    Series::new(name, style, points).with_sigma(sigmas.into_iter())
}

fn axis(sections: &[SectionDeformation]) -> Axis {
    let chainages = sections.iter().filter_map(|section| section.chainage_m);
    let low = chainages.clone().fold(f64::INFINITY, f64::min);
    let high = chainages.fold(f64::NEG_INFINITY, f64::max);
    Axis {
        name: "chainage (m)".to_owned(),
        range: if low <= high { [low, high] } else { [0.0, 1.0] },
        whole: false,
    }
}
