//! Wall points of many pixels of frames: the file that `locate --points` reads, and the one that it
//! writes.

use crate::cli::output::{Failure, Terminal, is_stream, json, refuse_two_results};
use crate::files::{open_regular, printed};
use crate::persist::atomic;
use crate::render::{hit_of_pixel, place_frames};
use crate::survey::Survey;
use crate::trajectory::Pose;
use csv::StringRecord;
use serde::Serialize;
use std::path::Path;

/// Columns of the input.
const COLUMNS: [&str; 3] = ["frame", "u", "v"];
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
    let source = open_regular(points).map_err(|error| bad(error.to_string()))?;
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(source);
    let headers = reader
        .headers()
        .map_err(|error| bad(error.to_string()))?
        .clone();
    let columns = find_columns(&headers).map_err(bad)?;
    let mut writer = csv::Writer::from_writer(Vec::new());
    let written = |error: csv::Error| Failure::bug(error.to_string());
    writer
        .write_record(headers.iter().chain(ADDED_COLUMNS))
        .map_err(written)?;
    let (mut count, mut found) = (0, 0);
    for record in reader.records() {
        let record = record.map_err(|error| bad(error.to_string()))?;
        let line = record.position().map_or(0, csv::Position::line);
        let at_line = |what: String| bad(format!("line {line}: {what}"));
        let (frame, pixel) = parse(survey, &record, columns).map_err(at_line)?;
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
        let fields = record.iter().chain(added.iter().map(String::as_str));
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

/// Finds the columns of the input among its headers; returns what is missing.
fn find_columns(headers: &StringRecord) -> Result<[usize; 3], String> {
    let mut places = [0; 3];
    for (place, name) in places.iter_mut().zip(COLUMNS) {
        let found = headers.iter().position(|header| header == name);
        *place = found.ok_or_else(|| {
            format!(
                "there is no column {name}; the first line must name the columns frame, u and v, \
                 and has {}",
                headers.iter().collect::<Vec<_>>().join(", ")
            )
        })?;
    }
    Ok(places)
}

/// Frame and pixel of a line.
fn parse(
    survey: &Survey,
    record: &StringRecord,
    [frame, u, v]: [usize; 3],
) -> Result<(usize, [f64; 2]), String> {
    let number = |column: usize| {
        let text = &record[column];
        let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
        value.ok_or_else(|| format!("`{text}` is not a number of pixels"))
    };
    let name = &record[frame];
    let frame = find_frame(survey, name).map_err(|what| format!("frame {name}: {what}"))?;
    Ok((frame, [number(u)?, number(v)?]))
}

/// Finds the frame by the name of its file, the end of its path, or its index.
///
/// # Errors
/// A name of no frame, or of several.
pub fn find_frame(survey: &Survey, name: &str) -> Result<usize, String> {
    let count = survey.frames.len();
    let has_name = |k: &usize| survey.frames[*k].path.ends_with(name);
    let mut found = (0..count).filter(has_name);
    match (found.next(), found.next()) {
        (Some(only), None) => Ok(only),
        (Some(first), Some(second)) => Err(format!(
            "{} and {} both have this name; give the folder, too, or an index \
             from 0 to {}",
            printed(&survey.frames[first].path),
            printed(&survey.frames[second].path),
            count - 1
        )),
        _ => name.parse().ok().filter(|k| *k < count).ok_or_else(|| {
            format!(
                "no such frame; give the name of a file, as {}, or an index from \
                 0 to {}",
                survey.frames[0].name(),
                count - 1
            )
        }),
    }
}
