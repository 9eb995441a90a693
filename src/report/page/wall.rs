//! Where on the wall frames agree, how many see it, and how each frame fits.

use super::trajectory::marks_key;
use super::{View, data_uri};
use crate::refine::FrameReport;
use crate::report::chart::{Chart, Series, Style, Vertical, legend};
use crate::report::heat::{self, Scale};
use crate::report::quantity::short;
use crate::report::{ReportError, WallMaps, ticks};
use maud::{Markup, html};

/// The section.
///
/// # Errors
/// [`ReportError::Encode`].
pub fn section(view: &View) -> Result<Markup, ReportError> {
    let maps = &view.report.wall;
    let residual = residual_scale(maps);
    let frames: Vec<Option<f64>> = maps
        .refined_frames
        .iter()
        .map(|n| (*n > 0.0).then_some(*n))
        .collect();
    let most = maps.refined_frames.iter().copied().fold(1.0, f64::max);
    let overlap = Scale {
        range: [0.0, most],
        logarithmic: false,
    };
    Ok(html! {
        p { "The same stretch of wall in " (maps.around) " × " (maps.along)
            " cells, chainage to the right, the clock upwards. The residual is the root mean square difference of two frames "
            "at the same place of the wall, in grey levels of 255: noise and light where the poses are right, much more where they are not." }
        (strip("Residual, baseline", maps, &maps.baseline_grey, &residual)?)
        (strip("Residual, refined", maps, &maps.refined_grey, &residual)?)
        @if let Some(truth) = &maps.true_grey {
            (strip("Residual, true poses", maps, truth, &residual)?)
        }
        (scale("grey levels, equal steps of colour are equal ratios; blank: no two frames overlap", &residual))
        (strip("Overlap, refined", maps, &frames, &overlap)?)
        (scale("frames that see a place; blank: none", &overlap))
        @if let Some(refinement) = &view.report.refinement {
            h3 { "Frame by frame" }
            p { "Frames that were compared with others in the last solve." }
            (legend(&[("frame", Style::Refined)], &marks_key(view)))
            div.charts {
                @for (title, unit, value) in [
                    ("Residual against the wall", "grey", (|f| f.residual) as fn(&FrameReport) -> f64),
                    ("Pixels rejected as outliers", "%", |f| 100.0 * (1.0 - f.inlier_share)),
                    ("Wall samples compared", "thousands", |f| 1e-3 * f.points as f64),
                    ("Gain", "", |f| f.gain),
                    ("Bias", "grey", |f| f.bias),
                ] {
                    (Chart {
                        title: title.to_owned(),
                        unit: unit.to_owned(),
                        along: view.axis(),
                        vertical: match title { "Gain" | "Bias" => Vertical::Linear, _ => Vertical::FromZero },
                        series: vec![Series::new("frame", Style::Refined, view.points(|k| refinement.frames.get(k).filter(|f| f.points > 0).map(value)))],
                        marks: view.marks(),
                    }.draw())
                }
            }
        }
    })
}

/// From the lowest to the highest residual, but for the extreme hundredth at either end.
fn residual_scale(maps: &WallMaps) -> Scale {
    let of_truth = maps.true_grey.iter().flatten();
    let all = maps
        .baseline_grey
        .iter()
        .chain(&maps.refined_grey)
        .chain(of_truth);
    let mut values: Vec<f64> = all.copied().flatten().filter(|v| *v > 0.0).collect();
    values.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| {
        let last = values.len().saturating_sub(1);
        values.get((share * last as f64) as usize).copied()
    };
    let (low, high) = (at(0.01).unwrap_or(1.0), at(0.99).unwrap_or(10.0));
    Scale {
        range: [low, high.max(1.5 * low)],
        logarithmic: true,
    }
}

/// One map with its axes.
fn strip(
    title: &str,
    maps: &WallMaps,
    values: &[Option<f64>],
    scale: &Scale,
) -> Result<Markup, ReportError> {
    let png = heat::png(title, [maps.around, maps.along], values, scale)?;
    let [from_m, to_m] = maps.chainage_m;
    let mut known: Vec<f64> = values.iter().copied().flatten().collect();
    known.sort_unstable_by(f64::total_cmp);
    let middle = known.get(known.len() / 2).copied();
    let words = match middle {
        Some(middle) => format!("{title}: median {} over the wall", short(middle)),
        None => format!("{title}: no values"),
    };
    Ok(html! {
        figure.strip {
            figcaption { span { (title) } @if let Some(middle) = middle { span.reading { "median " (short(middle)) } } }
            div.side aria-hidden="true" {
                @for (top, text) in [(0, "12"), (25, "9"), (50, "6"), (75, "3"), (100, "12")] {
                    span style=(format!("top:{top}%")) { (text) }
                }
            }
            img src=(data_uri("image/png", &png)) alt=(words) width=(maps.along) height=(maps.around);
            div.below aria-hidden="true" {
                @for (h_m, text) in ticks::linear(from_m, to_m, 6) {
                    span style=(format!("left:{:.2}%", 100.0 * (h_m - from_m) / (to_m - from_m))) { (text) " m" }
                }
            }
        }
    })
}

/// What the colours mean.
fn scale(words: &str, scale: &Scale) -> Markup {
    let [low, high] = scale.range;
    html! {
        p.scale {
            span { (short(low)) }
            span.bar style=(format!("background:{}", heat::gradient())) {}
            span { (short(high)) }
            span.words { (words) }
        }
    }
}
