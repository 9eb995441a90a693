//! `tunnelstitch check`: checks a survey in seconds.

use crate::check::{self, Check, MaskCheck, PosesCheck};
use crate::cli::arguments::PoseReadingArguments;
use crate::cli::output::{Failure, Terminal, json};
use std::path::PathBuf;

/// Checks a survey in seconds: frames, overlap, expected jitter, texture, and the time and memory
/// that refine needs.
///
/// Exits with code 3 if anything would make refine or stitch fail. Warnings name what needs
/// attention, and the remedy.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  tunnelstitch check my-survey")]
pub struct CheckArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    #[command(flatten)]
    reading: PoseReadingArguments,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// Everything that makes the survey unusable.
pub fn run(arguments: &CheckArguments, terminal: &Terminal) -> Result<(), Failure> {
    let survey = arguments.reading.open_quietly(&arguments.survey)?;
    let check = check::check(&survey)?;
    if arguments.json {
        json::print(&check)?;
    } else {
        terminal.say(summary(&check));
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

/// Shares of the image that the mask hides and of the wall that is ignored, if there are any.
fn mask_text(masks: &MaskCheck) -> Option<String> {
    let image = format!("{:.1} % of every frame", 100.0 * masks.hidden_share);
    let wall = format!(
        "{:.1} % of the wall in {} part{}",
        100.0 * masks.ignored_share,
        masks.ignored,
        if masks.ignored == 1 { "" } else { "s" }
    );
    match (masks.hidden_share > 0.0, masks.ignored > 0) {
        (true, true) => Some(format!("{image} hidden, {wall} ignored")),
        (true, false) => Some(format!("{image} hidden")),
        (false, true) => Some(format!("{wall} ignored")),
        (false, false) => None,
    }
}

/// Summary of a check, one row per subject.
fn summary(check: &Check) -> String {
    let (poses, overlap, pictures, effort) =
        (&check.poses, &check.overlap, &check.pictures, &check.effort);
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let rows = [
        (
            "frames",
            Some(format!(
                "{} of {} × {} px, {:.0} px per metre of wall",
                check.frames, check.size_px[0], check.size_px[1], check.px_per_metre
            )),
        ),
        ("masks", mask_text(&check.masks)),
        ("poses", Some(poses_text(poses))),
        (
            "overlap",
            Some(format!(
                "neighbours {} (least {} after frame {}), turns {}",
                percent(overlap.neighbours),
                percent(overlap.least_neighbours),
                overlap.least_after,
                percent(overlap.turns)
            )),
        ),
        (
            "expected jitter",
            Some(format!(
                "{:.1} px (1-σ) between neighbours, {} of their overlap",
                check.jitter.sigma_px,
                percent(check.jitter.share_of_overlap)
            )),
        ),
        (
            "texture",
            Some(format!(
                "gradient {:.2} grey levels per px, noise {:.1}: a frame can be registered to \
                 {:.4} px at best",
                pictures.slope_grey_per_px, pictures.noise_grey, pictures.sigma_px
            )),
        ),
        (
            "exposure",
            Some(format!(
                "mean grey level {:.0}, {} saturated ({} frames decoded)",
                pictures.grey,
                percent(pictures.clipped),
                pictures.decoded
            )),
        ),
        (
            "refine takes about",
            Some(format!(
                "{}, {} MiB",
                duration(effort.refine_s),
                effort.refine_bytes >> 20
            )),
        ),
        (
            "panorama",
            Some(format!(
                "{} × {} px at the frames' own resolution",
                effort.panorama_px[0], effort.panorama_px[1]
            )),
        ),
    ];
    let lines = rows
        .into_iter()
        .filter_map(|(name, text)| Some(format!("  {name:<22}{}", text?)));
    lines.collect::<Vec<_>>().join("\n")
}

fn poses_text(poses: &PosesCheck) -> String {
    format!(
        "chainage {:.2} to {:.2} m, steps of {:.3} m and {:.1}°, up to {:.2} m off the axis{}",
        poses.chainage_m[0],
        poses.chainage_m[1],
        poses.step_m,
        poses.step_deg,
        poses.off_axis_m,
        if poses.truth {
            ", true poses known"
        } else {
            ""
        }
    )
}

/// A duration in the unit that suits it.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{s:.0} s"),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}
