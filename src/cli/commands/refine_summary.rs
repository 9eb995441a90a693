//! Summary of a refinement on the terminal.

use crate::cli::output::{Terminal, duration_text};
use crate::files::printed;
use crate::refine::{
    CalibrationReport, FrameFlag, FrameReport, OtherReadings, Photometry, ReadoutEstimate,
    RefineReport,
};
use crate::report::{REFINEMENT_FILE, SECTIONS_FILE};
use std::path::Path;

/// Prints what was done, how good it is, and warnings about frames; with `verbose` also the table
/// of global solves and the time of each stage.
pub fn print_summary(report: &RefineReport, verbose: bool, terminal: &Terminal) {
    if let OtherReadings::Fit(found) = &report.readings {
        terminal.warn(found.sentence());
    }
    print_work(report, terminal);
    if verbose {
        print_solves(report, terminal);
        print_stages(report, terminal);
    }
    print_quality(report, terminal);
    if let Some(calibration) = &report.calibration {
        print_calibration(calibration, terminal);
    }
    print_findings(report, terminal);
    warn_of_frames(report, terminal);
}

/// Prints what was done and how long it took.
fn print_work(report: &RefineReport, terminal: &Terminal) {
    let seconds = report.timings.iter().map(|time| time.seconds).sum();
    let joint = match report.levels.last() {
        Some(level) if level.joint => ", the last one jointly with the wall",
        _ => "",
    };
    terminal.say(format!(
        "refined {} frames in {}: {} solves of all frames together{joint}",
        report.frames.len(),
        duration_text(seconds),
        report.levels.len(),
    ));
}

/// Prints the table of global solves, and why the last one stopped.
fn print_solves(report: &RefineReport, terminal: &Terminal) {
    terminal.say("  samples/px  steps        cost: start → end      observations  noise (grey)");
    for level in &report.levels {
        let solve = &level.solve;
        terminal.say(format!(
            "  {:>10}  {:>5}  {:>12.4e} → {:>11.4e}  {:>12}  {:>12.2}{}",
            level.samples_per_pixel,
            solve.iterations,
            solve.cost_start,
            solve.cost_end,
            solve.observations,
            solve.sigma,
            match (level.joint, level.pixel_px()) {
                (true, _) => "  jointly with the wall".to_owned(),
                (false, 1) => String::new(),
                (false, size) => format!("  pixels of size {size}"),
            }
        ));
    }
    terminal.say(format!("  stopped: {}", report.stopped_because));
}

/// Prints the time of each stage.
fn print_stages(report: &RefineReport, terminal: &Terminal) {
    let stages = report.timings.iter();
    let stages: Vec<String> = stages
        .map(|time| format!("{} {:.2} s", time.stage, time.seconds))
        .collect();
    terminal.say(format!("  {}", stages.join(", ")));
}

/// Prints the number of photometric frames and their σ.
fn print_quality(report: &RefineReport, terminal: &Terminal) {
    let mean = |value: &dyn Fn(&FrameReport) -> f64| {
        report.frames.iter().map(value).sum::<f64>() / report.frames.len() as f64
    };
    terminal.say(format!(
        "  {} of {} frames are photometric; mean 1-σ on the wall {:.2} mm ({:.3} px), rotation \
         {:.4}°, translation {:.2} mm",
        report.verdict.photometric,
        report.verdict.frames,
        1e3 * mean(&|f| f.sigma.wall_m),
        mean(&|f| f.sigma.wall_px),
        mean(&|f| f.sigma.rotation_deg),
        1e3 * mean(&|f| f.sigma.translation_m),
    ));
}

/// Prints what the tests of the residuals and of the prior have found.
fn print_findings(report: &RefineReport, terminal: &Terminal) {
    if let Some(rows) = report.rolling_shutter.filter(|rows| rows.systematic) {
        terminal.warn(rolling_shutter_warning(&rows));
    }
    for mount in &report.mounts {
        terminal.say(format!("  {}", mount.sentence()));
    }
    for finding in &report.prior_test.findings {
        terminal.warn(format!("  {finding}"));
    }
    if let Some(found) = &report.model_error {
        terminal.say(format!(
            "  residuals go together over {:.2} m of the wall, more than by noise: σ includes \
             errors of lens, shape or light as far as they show",
            found.patch_m
        ));
    }
}

/// Prints what was found about light and wall, and the files that were written into `out`.
pub fn print_outputs(report: &RefineReport, out: &Path, files: &[String], terminal: &Terminal) {
    if report.photometry == Photometry::Normalised {
        terminal.say(
            "  frames were compared by their contrast, normalised locally: the light is not that \
             of a model with gain, bias and one shading for all",
        );
    }
    if let Some([x, y, z]) = report.lamp_m {
        terminal.say(format!(
            "  the light is that of a lamp at ({x:.2}, {y:.2}, {z:.2}) m in the camera's frame \
             (x right, y down, z ahead)"
        ));
    }
    print_wall(report, out, terminal);
    terminal.say(format!("  {}", report.scale.sentence()));
    terminal.say(format!("wrote {}: {}", printed(out), files.join(", ")));
    if report.calibration.is_some() {
        terminal.say(format!(
            "{0} is a survey with the refined calibration: tunnelstitch stitch {0} --poses {1} \
             --out panorama.png",
            printed(out),
            printed(&out.join("poses.tum"))
        ));
    }
}

/// Prints what was found about the wall.
fn print_wall(report: &RefineReport, out: &Path, terminal: &Terminal) {
    if let Some(points) = &report.points {
        terminal.say(format!("  {}", points.sentence()));
    }
    if let Some(bend) = &report.bend {
        terminal.say(format!(
            "  the tunnel bends towards {:.0}° with a radius of {:.0} ± {:.0} m (1-σ); poses and \
             chainage are along the bend",
            bend.towards_deg, bend.radius_m, bend.radius_sigma_m
        ));
    }
    let shape = report
        .shape
        .as_ref()
        .filter(|shape| !shape.scales.is_empty());
    if let Some(shape) = shape.filter(|_| out.join(SECTIONS_FILE).is_file()) {
        terminal.say(format!(
            "  the wall deviates from the given shape by {:.1} mm (root mean square): {} has its \
             sections, `tunnelstitch report` draws them",
            shape.rms_mm,
            printed(&out.join(SECTIONS_FILE))
        ));
    }
    let none_above_mm = report.shape.as_ref().and_then(|s| s.none_above_mm());
    if let Some(none_above_mm) = none_above_mm {
        terminal.say(format!(
            "  no deformation of the wall is seen; {none_above_mm:.2} mm (root mean square) would \
             be"
        ));
    }
    for band in &report.hidden_bands {
        terminal.warn(format!("  {}", band.sentence()));
    }
    if let Some(masked) = report.masked.as_ref().filter(|masked| masked.area_m2 > 0.0) {
        terminal.say(format!(
            "  most frames show something else than the wall on {:.2} m² ({:.2} %): left out, \
             listed in {REFINEMENT_FILE}, drawn by stitch --maps",
            masked.area_m2,
            100.0 * masked.share
        ));
    }
}

/// Prints the estimated parameters of the self-calibration.
fn print_calibration(calibration: &CalibrationReport, terminal: &Terminal) {
    terminal.say("  calibration              given     estimate          1-σ   (prior 1-σ)");
    for unknown in &calibration.unknowns {
        let unit = match unknown.unit {
            "1" => "",
            unit => unit,
        };
        terminal.say(format!(
            "  {:<13} {:>3} {:>12.5} {:>12.5} {:>12.5}   ({:.5}){}",
            unknown.name,
            unit,
            unknown.initial,
            unknown.estimate,
            unknown.sigma,
            unknown.prior_sigma,
            if unknown.observed {
                ""
            } else {
                "   not observable"
            },
        ));
    }
    for unknown in &calibration.unknowns {
        if let Some(reason) = &unknown.reason {
            let name = unknown.name;
            terminal.warn(format!("  {name} keeps its given value: {reason}"));
        }
    }
}

/// Warning about a residual that grows along the rows, with the remedy.
fn rolling_shutter_warning(rows: &ReadoutEstimate) -> String {
    let remedy = if rows.given_ms == 0.0 {
        format!(
            "if the camera has a rolling shutter, give [camera] readout_ms = {:.1} in survey.toml",
            rows.estimate_ms
        )
    } else {
        format!(
            "not {} ms as given; check [camera] readout_ms and the times of the initial poses",
            rows.given_ms
        )
    };
    format!(
        "rolling-shutter test: all frames have the same systematic residual along the rows, \
         {:.1} px from the first row to the last, equal to a readout time of {:.1} ms (1-σ {:.2}): \
         {remedy}",
        rows.shift_px, rows.estimate_ms, rows.sigma_ms
    )
}

/// Warns of the frames that are rejected.
fn warn_of_frames(report: &RefineReport, terminal: &Terminal) {
    let all = report.frames.len();
    let uncertain = report.count_flagged(FrameFlag::Uncertain);
    if uncertain > 0 {
        terminal.warn(format!(
            "{uncertain} of {all} frames are refined less exactly than asked for:"
        ));
    }
    if report.frames_on_prior > 0 {
        terminal.warn(format!(
            "{} of {all} frames are rejected, so their poses rest on the prior:",
            report.frames_on_prior,
        ));
    }
    let contradicts = report.prior_test.contradicting_scale().is_some();
    if report.frames_on_prior == report.frames.len() && !contradicts {
        terminal.warn(explain_failure(report));
    }
    warn_of_rejected_frames(report, terminal);
}

/// The finding where no frame is photometric. It proposes nothing that was not tried.
fn explain_failure(report: &RefineReport) -> &'static str {
    if 2 * report.count_flagged(FrameFlag::Ambiguous) > report.frames.len() {
        "  no frame is photometric: the wall repeats itself, and [prior] does not tell its \
         repetitions apart"
    } else {
        match report.readings {
            OtherReadings::NoneFits => {
                "  no frame is photometric; other readings were tried (convention, axes, order and \
                 unit of the poses, poses of other frames, radius, turned and mirrored pictures, \
                 focal length and lens), and neighbouring frames agree better with none of them"
            }
            OtherReadings::Untried | OtherReadings::Fit(_) => "  no frame is photometric",
        }
    }
}

/// Largest number of warnings about rejected frames.
const MAX_REJECTION_WARNINGS: usize = 24;

/// Warns of rejected frames with the reason; consecutive frames with the same reason share a line.
fn warn_of_rejected_frames(report: &RefineReport, terminal: &Terminal) {
    let frames = report.frames.iter();
    let rejected: Vec<(&FrameReport, &str)> = frames
        .filter(|frame| frame.flag != FrameFlag::Photometric)
        .filter_map(|frame| Some((frame, frame.reason.as_deref()?)))
        .collect();
    let mut runs =
        rejected.chunk_by(|(a, reason), (b, next)| b.index == a.index + 1 && reason == next);
    for run in runs.by_ref().take(MAX_REJECTION_WARNINGS) {
        match run {
            [] => {}
            [(frame, reason)] => {
                terminal.warn(format!(
                    "  frame {} ({}): {reason}",
                    frame.index, frame.file
                ));
            }
            [(first, reason), .., (last, _)] => terminal.warn(format!(
                "  frames {} to {} ({} to {}), each: {reason}",
                first.index, last.index, first.file, last.file
            )),
        }
    }
    let left: usize = runs.map(<[_]>::len).sum();
    if left > 0 {
        terminal.warn(format!(
            "  … and {left} more; refine.json has the reason of each"
        ));
    }
}
