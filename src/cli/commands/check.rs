//! `tunnelstitch check`: checks a survey in seconds.

use crate::check::{self, Check, DeformationCheck, MaskCheck, PosesCheck};
use crate::cli::arguments::PoseReadingArguments;
use crate::cli::output::{Failure, Terminal, duration_text, json};
use crate::frames::{PictureFormat, write_picture};
use std::path::{Path, PathBuf};

/// Checks a survey in seconds: frames, overlap, expected jitter, texture, and the time and memory
/// that refine needs.
///
/// Exits with code 3 if anything would make refine or stitch fail. Warnings name what needs
/// attention, and the remedy; with --strict, any of them makes the exit code 4.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    tunnelstitch check my-survey\n  \
    tunnelstitch check my-survey --strict && tunnelstitch refine my-survey --out refined\n  \
    tunnelstitch check my-survey --write-mask my-survey/mask.png")]
pub struct CheckArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    #[command(flatten)]
    reading: PoseReadingArguments,
    /// Exit with code 4 if there is any warning.
    #[arg(long)]
    strict: bool,
    /// Write a mask that hides what does not move with the wall, such as burnt-in text, logos and
    /// dirt on the lens, and what the survey's own mask hides: black where the wall is never seen.
    #[arg(long, value_name = "FILE.png")]
    write_mask: Option<PathBuf>,
    /// Replace an existing file of --write-mask.
    #[arg(long, requires = "write_mask")]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// Everything that makes the survey unusable; with --strict, any warning.
pub fn run(arguments: &CheckArguments, terminal: &Terminal) -> Result<(), Failure> {
    if let Some(path) = &arguments.write_mask {
        refuse_existing(path, arguments.force)?;
    }
    let survey = arguments.reading.open_quietly(&arguments.survey)?;
    let check = check::check(&survey)?;
    if terminal.is_json() {
        json::print(&check)?;
    } else {
        terminal.say(summary(&check));
        for warning in &check.warnings {
            terminal.warn(warning);
        }
    }
    if let Some(path) = &arguments.write_mask {
        terminal.say(write_mask(&check, path)?);
    }
    conclude(&check, arguments.strict)
}

/// Fails if anything would make refine or stitch fail or, with `strict`, if there is any warning.
fn conclude(check: &Check, strict: bool) -> Result<(), Failure> {
    if !check.faults.is_empty() {
        return Err(Failure::input(check.faults.join("\nerror: ")));
    }
    if strict && !check.warnings.is_empty() {
        return Err(Failure::quality(format!(
            "--strict: warnings that need attention: {}",
            check.warnings.len()
        )));
    }
    Ok(())
}

/// Refuses a mask in place of an existing file, or of another format than PNG.
fn refuse_existing(path: &Path, force: bool) -> Result<(), Failure> {
    let is_png = path
        .extension()
        .is_some_and(|end| end.eq_ignore_ascii_case("png"));
    if !is_png {
        return Err(Failure::usage(format!(
            "--write-mask {}: a mask is a PNG file; let its name end in .png",
            path.display()
        )));
    }
    if path.exists() && !force {
        return Err(Failure::input(format!(
            "{}: exists already; --force replaces it",
            path.display()
        )));
    }
    Ok(())
}

/// Writes the proposed mask, if there is one; returns a sentence about it.
fn write_mask(check: &Check, path: &Path) -> Result<String, Failure> {
    let Some(mask) = &check.proposed_mask else {
        return Ok("all pixels show the wall: no mask was written".to_owned());
    };
    write_picture(path, &mask.picture().into(), PictureFormat::Png)?;
    Ok(format!(
        "wrote {}, which hides {:.1} % of the picture; use it by [frames] mask in survey.toml",
        path.display(),
        100.0 * mask.masked_fraction()
    ))
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
        ("overlay", check.overlay.sentence()),
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
                "gradient {:.2} grey levels per px, noise {:.1}: {}",
                pictures.slope_grey_per_px,
                pictures.noise_grey,
                pictures.describe_registration(4)
            )),
        ),
        (
            "deformation",
            (check.deformation.as_ref()).map(DeformationCheck::sentence),
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
                duration_text(effort.refine_s),
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
