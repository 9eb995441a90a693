//! `tunnelstitch check`: a survey, looked over in seconds.

use super::poses::ReadingArguments;
use super::{Failure, Terminal, json};
use crate::check::{self, Check, MaskCheck};
use std::path::PathBuf;

/// Looks a survey over in seconds: frames, overlap, jitter, texture, and what refining will take.
///
/// Exits with code 3 if anything would make refine or stitch fail. Warnings say what asks for
/// attention, and what to do.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  tunnelstitch check my-survey")]
pub struct CheckArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    #[command(flatten)]
    reading: ReadingArguments,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// Whatever keeps the survey from being used.
pub fn run(arguments: &CheckArguments, terminal: &Terminal) -> Result<(), Failure> {
    let survey = arguments.reading.open_quietly(&arguments.survey)?;
    let check = check::check(&survey)?;
    if arguments.json {
        json::print(&check)?;
    } else {
        terminal.say(text(&check));
        for warning in &check.warnings {
            terminal.warn(warning);
        }
    }
    if check.faults.is_empty() {
        Ok(())
    } else {
        Err(Failure::input(check.faults.join("\nerror: ")))
    }
}

/// What of pictures and wall is left out, if anything.
fn masks(masks: &MaskCheck) -> Option<String> {
    let picture = format!("{:.1} % of every picture", 100.0 * masks.hidden_share);
    let wall = format!(
        "{:.1} % of the wall in {} part{}",
        100.0 * masks.ignored_share,
        masks.ignored,
        if masks.ignored == 1 { "" } else { "s" }
    );
    match (masks.hidden_share > 0.0, masks.ignored > 0) {
        (true, true) => Some(format!("{picture} hidden, {wall} ignored")),
        (true, false) => Some(format!("{picture} hidden")),
        (false, true) => Some(format!("{wall} ignored")),
        (false, false) => None,
    }
}

fn text(check: &Check) -> String {
    let (poses, overlap, pictures, effort) =
        (&check.poses, &check.overlap, &check.pictures, &check.effort);
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let row = |name: &str, value: String| format!("  {name:<22}{value}\n");
    let seconds = effort.refine_s;
    let time = match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    };
    [
        row(
            "frames",
            format!(
                "{} of {} × {} px, {:.0} px per metre of wall",
                check.frames, check.size_px[0], check.size_px[1], check.px_per_metre
            ),
        ),
        masks(&check.masks).map_or_else(String::new, |masks| row("masks", masks)),
        row(
            "poses",
            format!(
                "chainage {:.2} to {:.2} m, steps of {:.3} m and {:.1}°, up to {:.2} m off the axis{}",
                poses.chainage_m[0],
                poses.chainage_m[1],
                poses.step_m,
                poses.step_deg,
                poses.off_axis_m,
                if poses.truth { ", true poses known" } else { "" }
            ),
        ),
        row(
            "overlap",
            format!(
                "neighbours {} (least {} after frame {}), turns {}",
                percent(overlap.neighbours),
                percent(overlap.least_neighbours),
                overlap.least_after,
                percent(overlap.turns)
            ),
        ),
        row(
            "expected jitter",
            format!(
                "{:.1} px (1-σ) between neighbours, {} of their overlap",
                check.jitter.sigma_px,
                percent(check.jitter.share_of_overlap)
            ),
        ),
        row(
            "texture",
            format!(
                "{:.2} grey levels a pixel over a noise of {:.1}: a frame is placed to {:.4} px at best",
                pictures.slope_grey_per_px, pictures.noise_grey, pictures.sigma_px
            ),
        ),
        row(
            "exposure",
            format!(
                "mean grey level {:.0}, {} clipped ({} frames decoded)",
                pictures.grey,
                percent(pictures.clipped),
                pictures.decoded
            ),
        ),
        row(
            "refine takes about",
            format!("{time}, {} MiB", effort.refine_bytes >> 20),
        ),
        row(
            "panorama",
            format!(
                "{} × {} px at the frames' own resolution",
                effort.panorama_px[0], effort.panorama_px[1]
            ),
        ),
    ]
    .concat()
    .trim_end()
    .to_owned()
}
