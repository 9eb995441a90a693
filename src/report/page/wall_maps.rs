//! Section about residuals and overlap on the wall, and about each frame's photometric fit.

use super::map_strip::{MapStrip, scale_legend};
use super::page_data::PageData;
use super::trajectory::mark_entry;
use crate::refine::FrameReport;
use crate::report::chart::{Chart, CurveStyle, Series, Vertical, legend};
use crate::report::error::ReportError;
use crate::report::heat_map::ColourScale;
use crate::report::model::WallMaps;
use crate::report::quantity::short;
use maud::{Markup, html};
use tunnelstitch_core::colour_map::Palette;

/// Draws the section.
///
/// # Errors
/// [`ReportError::Encode`].
pub fn section(data: &PageData) -> Result<Markup, ReportError> {
    let maps = &data.report.wall;
    let residual = residual_scale(maps);
    let frames: Vec<Option<f64>> = maps
        .refined_frames
        .iter()
        .map(|n| (*n > 0.0).then_some(*n))
        .collect();
    let most = maps.refined_frames.iter().copied().fold(1.0, f64::max);
    let overlap = ColourScale {
        palette: Palette::Cividis,
        range: [0.0, most],
        logarithmic: false,
    };
    Ok(html! {
        p {
            "The wall in " (maps.around) " × " (maps.along)
            " cells, chainage to the right, clock position upwards. The residual is the root mean \
             square difference of two frames at a point of the wall, in grey levels of 255. With \
             correct poses it is the sensor noise and the change of light; pose errors make it \
             much larger."
        }
        (strip("Residual, baseline", maps, &maps.baseline_grey, &residual)?)
        (strip("Residual, refined", maps, &maps.refined_grey, &residual)?)
        @if let Some(truth) = &maps.true_grey {
            (strip("Residual, true poses", maps, truth, &residual)?)
        }
        (scale_legend("grey levels, logarithmic; blank: no two frames overlap", &residual))
        (strip("Overlap, refined", maps, &frames, &overlap)?)
        (scale_legend("number of frames that see the wall; blank: none", &overlap))
        @if let Some(refinement) = &data.report.refinement {
            h3 { "Photometric fit of the frames" }
            p { "Frames that overlap others in the last solve." }
            (legend(&[("frame", CurveStyle::Refined)], &mark_entry(data)))
            div.charts {
                @for quantity in QUANTITIES { (frame_chart(data, &refinement.frames, quantity)) }
            }
        }
    })
}

/// A quantity of the photometric fit of a frame.
struct FrameQuantity {
    title: &'static str,
    unit: &'static str,
    vertical: Vertical,
    value: fn(&FrameReport) -> f64,
}

/// Quantities that have a chart.
const QUANTITIES: [FrameQuantity; 5] = [
    FrameQuantity {
        title: "Residual",
        unit: "grey",
        vertical: Vertical::FromZero,
        value: |frame| frame.residual,
    },
    FrameQuantity {
        title: "Outliers",
        unit: "%",
        vertical: Vertical::FromZero,
        value: |frame| 100.0 * (1.0 - frame.inlier_share),
    },
    FrameQuantity {
        title: "Samples of the wall",
        unit: "thousands",
        vertical: Vertical::FromZero,
        value: |frame| 1e-3 * frame.points as f64,
    },
    FrameQuantity {
        title: "Gain",
        unit: "",
        vertical: Vertical::Linear,
        value: |frame| frame.gain,
    },
    FrameQuantity {
        title: "Bias",
        unit: "grey",
        vertical: Vertical::Linear,
        value: |frame| frame.bias,
    },
];

/// Chart of a quantity over the frames that overlap others.
fn frame_chart(data: &PageData, frames: &[FrameReport], quantity: FrameQuantity) -> Markup {
    let has_samples = |frame: &&FrameReport| frame.points > 0;
    let value = |k: usize| frames.get(k).filter(has_samples).map(quantity.value);
    Chart {
        title: quantity.title.to_owned(),
        unit: quantity.unit.to_owned(),
        along: data.axis(),
        vertical: quantity.vertical,
        series: vec![Series::new(
            "frame",
            CurveStyle::Refined,
            data.points(value),
        )],
        marks: data.marks(),
    }
    .draw()
}

/// Scale from the 1st to the 99th percentile of the residuals.
fn residual_scale(maps: &WallMaps) -> ColourScale {
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
    ColourScale {
        palette: Palette::Cividis,
        range: [low, high.max(1.5 * low)],
        logarithmic: true,
    }
}

/// A map with its axes.
fn strip(
    title: &str,
    maps: &WallMaps,
    values: &[Option<f64>],
    scale: &ColourScale,
) -> Result<Markup, ReportError> {
    let mut known: Vec<f64> = values.iter().copied().flatten().collect();
    known.sort_unstable_by(f64::total_cmp);
    let middle = known.get(known.len() / 2);
    MapStrip {
        title,
        size: [maps.around, maps.along],
        chainage_m: maps.chainage_m,
        reading: middle.map(|middle| format!("median {}", short(*middle))),
    }
    .draw(values, scale)
}
