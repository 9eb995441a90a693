//! Summary of a panorama.

use crate::cli::output::Terminal;
use crate::files::printed;
use crate::render::{Budget, FrameExposure, Gap, Layout, RenderOptions};
use serde::Serialize;
use std::path::Path;

/// Description of a panorama.
#[derive(Serialize)]
pub struct StitchReport<'a> {
    /// The file.
    pub out: &'a Path,
    /// Its width, pixels.
    pub width: u32,
    /// Its height, pixels.
    pub height: u32,
    /// Its resolution.
    pub px_per_metre: f64,
    /// Direction of its axes.
    pub layout: Layout,
    /// Chainage of its ends, metres.
    pub chainage_m: [f64; 2],
    /// Share that some frame sees, 0–1.
    pub coverage: f64,
    /// Wall that no frame sees.
    pub gaps: Vec<Gap>,
    /// Number of frames.
    pub frames: usize,
    /// Options of drawing.
    pub render: RenderOptions,
    /// Exposure of every frame.
    pub exposure: &'a [FrameExposure],
    /// Memory, bytes.
    pub memory: Budget,
}

/// Largest number of gaps that the summary lists.
const MAX_LISTED_GAPS: usize = 5;

/// Prints size, coverage and gaps of the panorama.
pub fn print_summary(report: &StitchReport, terminal: &Terminal) {
    let say = |text: String| terminal.say(text);
    let [from_m, to_m] = report.chainage_m;
    say(format!(
        "{}: {} × {} px, {:.2} px per metre, chainage {from_m:.3} to {to_m:.3} m, {:.1} % covered \
         by {} frames",
        printed(report.out),
        report.width,
        report.height,
        report.px_per_metre,
        100.0 * report.coverage,
        report.frames
    ));
    let inner: Vec<&Gap> = report.gaps.iter().filter(|gap| !gap.at_the_end).collect();
    for gap in inner.iter().take(MAX_LISTED_GAPS) {
        say(format!(
            "  not covered: chainage {:.3} to {:.3} m, {:.1}° to {:.1}° ({:.4} m²)",
            gap.chainage_from_m,
            gap.chainage_to_m,
            gap.angle_from_deg,
            gap.angle_to_deg,
            gap.area_m2
        ));
    }
    if inner.len() > MAX_LISTED_GAPS {
        say(format!(
            "  and {} more gaps; --maps lists all of them",
            inner.len() - MAX_LISTED_GAPS
        ));
    }
}
