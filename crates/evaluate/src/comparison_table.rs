//! Text table of a comparison.

use crate::compare::{Comparison, Scores};
use crate::error_statistics::ErrorStatistics;
use std::fmt;

/// Line of the table of a comparison.
#[derive(Clone, Debug, PartialEq)]
pub struct ComparisonRow {
    /// Name of the measure.
    pub measure: &'static str,
    /// Unit of the values; empty for pure numbers.
    pub unit: &'static str,
    /// Value of the initial poses, as text.
    pub baseline: Option<String>,
    /// Value of the refined poses, as text.
    pub refined: Option<String>,
}

/// Function that formats a measure of one set of poses.
type Measure = fn(&Scores) -> Option<String>;

/// Measures in the order of the table: name, unit, value.
const MEASURES: [(&str, &str, Measure); 16] = [
    ("rotation RMSE", "deg", |s| rotation(s, |e| e.rms)),
    ("rotation median", "deg", |s| rotation(s, |e| e.median)),
    ("rotation max", "deg", |s| rotation(s, |e| e.max)),
    ("translation RMSE", "mm", |s| translation(s, |e| e.rms)),
    ("translation median", "mm", |s| translation(s, |e| e.median)),
    ("translation max", "mm", |s| translation(s, |e| e.max)),
    ("wall error RMS", "mm", |s| {
        format_number(s.wall.as_ref()?.mm.rms)
    }),
    ("wall error median", "mm", |s| {
        format_number(s.wall.as_ref()?.mm.median)
    }),
    ("wall error max", "mm", |s| {
        format_number(s.wall.as_ref()?.mm.max)
    }),
    ("wall error RMS", "px", |s| {
        format_number(s.wall.as_ref()?.px.rms)
    }),
    ("wall error median", "px", |s| {
        format_number(s.wall.as_ref()?.px.median)
    }),
    ("wall error max", "px", |s| {
        format_number(s.wall.as_ref()?.px.max)
    }),
    ("worst frame RMS", "px", |s| {
        let wall = s.wall.as_ref()?;
        let rms = format_number(wall.worst_frame_rms_px)?;
        Some(format!("{rms} (#{})", wall.worst_frame))
    }),
    ("PSNR", "dB", |s| match s.image?.psnr_db {
        Some(psnr) => Some(format!("{psnr:.2}")),
        None if s.image?.pixels > 0 => Some("equal".to_owned()),
        None => None,
    }),
    ("SSIM", "", |s| Some(format!("{:.4}", s.image?.ssim?))),
    ("seam residual", "grey", |s| {
        Some(format!("{:.2}", s.seam?.rms_grey))
    }),
];

/// Formats a statistic of the rotation errors, degrees.
fn rotation(scores: &Scores, pick: fn(&ErrorStatistics) -> f64) -> Option<String> {
    format_number(pick(&scores.trajectory.as_ref()?.rotation_deg))
}

/// Formats a statistic of the translation errors, millimetres.
fn translation(scores: &Scores, pick: fn(&ErrorStatistics) -> f64) -> Option<String> {
    format_number(pick(&scores.trajectory.as_ref()?.translation_m.scaled(1e3)))
}

/// Formats a value with four digits after the point if it is small, fewer if it is large.
fn format_number(value: f64) -> Option<String> {
    Some(match value {
        v if v < 1.0 => format!("{v:.4}"),
        v if v < 100.0 => format!("{v:.2}"),
        v => format!("{v:.1}"),
    })
}

impl Comparison {
    /// The lines of the measures that at least one set of poses has.
    pub fn rows(&self) -> Vec<ComparisonRow> {
        MEASURES
            .iter()
            .map(|(measure, unit, value)| ComparisonRow {
                measure,
                unit,
                baseline: value(&self.baseline),
                refined: value(&self.refined),
            })
            .filter(|row| row.baseline.is_some() || row.refined.is_some())
            .collect()
    }
}

impl fmt::Display for Comparison {
    /// The table with aligned columns, without a line break at its end.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:<20} {:<5} {:>14} {:>14}",
            "", "", "baseline", "refined"
        )?;
        for row in self.rows() {
            let shown = |value: &Option<String>| value.clone().unwrap_or_else(|| "–".to_owned());
            write!(
                f,
                "\n{:<20} {:<5} {:>14} {:>14}",
                row.measure,
                row.unit,
                shown(&row.baseline),
                shown(&row.refined)
            )?;
        }
        if let Some(seam) = self.truth.as_ref().and_then(|truth| truth.seam) {
            write!(
                f,
                "\nThe seam residual of the true poses is {:.2} grey levels.",
                seam.rms_grey
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image_metrics::ImageMetrics;
    use crate::seam_residual::SeamResidual;
    use tunnelstitch_render::Canvas;

    fn scores(rms_grey: f64) -> Scores {
        Scores {
            coverage: 1.0,
            seam: Some(SeamResidual {
                rms_grey,
                points: 10,
                frames_per_point: 2.0,
            }),
            trajectory: None,
            unaligned: None,
            wall: None,
            image: None,
        }
    }

    #[test]
    fn columns_are_aligned_and_missing_measures_left_out() {
        let mut comparison = Comparison {
            frames: 3,
            canvas: Canvas {
                columns: 1,
                rows: 1,
                px_per_metre: 1.0,
                h_start_m: 0.0,
            },
            baseline: scores(23.456),
            refined: scores(2.5),
            truth: None,
        };
        comparison.refined.image = Some(ImageMetrics {
            psnr_db: Some(31.0),
            ssim: None,
            pixels: 5,
        });
        let text = comparison.to_string();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 3, "{text}");
        assert!(lines[1].starts_with("PSNR ") && lines[1].ends_with("31.00"));
        assert!(lines[2].contains("23.46") && lines[2].ends_with("2.50"));
        let width = lines[0].chars().count();
        assert!(lines.iter().all(|line| line.chars().count() == width));
    }
}
