//! Wall points of many pixels of frames: the file that `locate --points` reads, and the one that it
//! writes.

use crate::cli::output::{Failure, Terminal, is_stream, json, refuse_two_results};
use crate::files::printed;
use crate::persist::atomic;
use crate::render::{hit_of_pixel, place_frames};
use crate::survey::{FramePixel, FramePixels, Survey};
use crate::trajectory::Pose;
use serde::Serialize;
use std::path::Path;

/// Columns that the output has behind those of the input.
const ADDED_COLUMNS: [&str; 3] = ["theta_rad", "h_m", "range_m"];

/// Copies the CSV file `points` to `out` with the wall points of its pixels added: angle θ of the
/// wall (radians), chainage (metres) and distance from the camera (metres); empty where the frame
/// shows no wall.
///
/// # Errors
/// A file without the columns, a line that names no frame or pixel, an output that cannot be
/// written.
pub fn locate_points(
    survey: &Survey,
    poses: &[Pose],
    points: &Path,
    out: &Path,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let surface = survey.surface.as_ref();
    let placements = place_frames(surface, &survey.cameras, poses, &survey.shutter())?;
    refuse_two_results(out, terminal)?;
    let bad = |what: String| Failure::input(format!("{}: {what}", printed(points)));
    let rows = FramePixels::open(survey, points).map_err(bad)?;
    let headers = rows.headers().clone();
    let mut writer = csv::Writer::from_writer(Vec::new());
    let written = |error: csv::Error| Failure::bug(error.to_string());
    writer
        .write_record(headers.iter().chain(ADDED_COLUMNS))
        .map_err(written)?;
    let (mut count, mut found) = (0, 0);
    for row in rows {
        let FramePixel {
            cells,
            frame,
            pixel,
        } = row.map_err(bad)?;
        let placement = &placements[frame];
        let camera = survey.cameras.of(frame);
        let mask = survey.frames.masks().of(frame).map(AsRef::as_ref);
        let hit = hit_of_pixel(surface, camera, mask, placement, pixel).ok();
        let added = hit.map_or_else(
            || [(); 3].map(|()| String::new()),
            |hit| {
                let distance_m = (hit.x_w - placement.pose.t_wc).norm();
                let theta_rad = surface.angle_rad(hit.wall.s_m);
                [theta_rad, hit.wall.h_m, distance_m].map(|value| format!("{value:.9}"))
            },
        );
        let fields = cells.iter().chain(added.iter().map(String::as_str));
        writer.write_record(fields).map_err(written)?;
        count += 1;
        found += usize::from(hit.is_some());
    }
    let table = writer
        .into_inner()
        .map_err(|error| Failure::bug(error.to_string()))?;
    let table = String::from_utf8_lossy(&table);
    if is_stream(out) {
        return json::print_text(&table);
    }
    atomic::write_text(out, &table)?;
    terminal.say(format!(
        "wrote {}: {found} of {count} pixels show the wall",
        printed(out)
    ));
    terminal.result(&PointsReport {
        out,
        pixels: count,
        on_wall: found,
    })
}

/// The result, for `--json`.
#[derive(Serialize)]
struct PointsReport<'a> {
    out: &'a Path,
    pixels: usize,
    on_wall: usize,
}
