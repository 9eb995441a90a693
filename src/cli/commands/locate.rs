//! `tunnelstitch locate`: converts a point between panorama, wall and frames; many points at once
//! by [`locate_points`].

use crate::cli::arguments::{CanvasArguments, PosesArguments, input_file};
use crate::cli::commands::locate_points::locate_points;
use crate::cli::output::{Failure, Terminal, json};
use crate::render::{
    Canvas, FramePixelError, LaidOut, Layout, Placement, Sighting, hit_of_pixel, lay_out, sightings,
};
use crate::surface::WallPoint;
use crate::survey::Survey;
use crate::trajectory::poses_of;
use serde::Serialize;
use std::path::PathBuf;

/// Finds a point of the wall in the panorama, in the tunnel and in the frames.
///
/// The point is given in one of these ways, and the answer has all of them: a pixel of the
/// panorama, chainage and angle or clock position on the wall, a pixel of a frame. Pixels count
/// from 0 at the centre of the first one.
///
/// The clock position is that of θ seen towards increasing chainage, with twelve o'clock at θ = 0
/// or at --twelve-at.
#[derive(Debug, clap::Args)]
#[command(
    group = clap::ArgGroup::new("point").required(true),
    after_help = "Examples:\n  \
    tunnelstitch locate survey --poses refined/poses.tum --panorama 1200,345\n      \
    where is this crack, and which frames show it?\n  \
    tunnelstitch locate survey --poses refined/poses.tum --clock 12.30,4:30\n      \
    which frames show the wall at chainage 12.30 m, half past four?\n  \
    tunnelstitch locate survey --poses refined/poses.tum --frame 000017.png,320,240 --json\n      \
    where on the wall is the centre of this frame?\n  \
    tunnelstitch locate survey --poses refined/poses.tum --points pixels.csv --out wall.csv\n      \
    where on the wall are all these pixels?"
)]
pub struct LocateArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    /// A pixel of the panorama that `stitch` draws from these poses with the same --px-per-metre
    /// and --layout (not of the pictures of `compare`, nor of one with --ignore-offset).
    #[arg(
        long,
        group = "point",
        value_name = "X,Y",
        value_parser = number_pair,
        allow_hyphen_values = true
    )]
    panorama: Option<[f64; 2]>,
    /// Chainage in metres and angle θ in degrees.
    #[arg(
        long,
        group = "point",
        value_name = "CHAINAGE,DEG",
        value_parser = number_pair,
        allow_hyphen_values = true
    )]
    wall: Option<[f64; 2]>,
    /// Chainage in metres and clock position.
    #[arg(
        long,
        group = "point",
        value_name = "CHAINAGE,H:MM",
        value_parser = chainage_and_clock,
        allow_hyphen_values = true
    )]
    clock: Option<[f64; 2]>,
    /// A frame (name of its file, or its index from 0) and a pixel of it.
    #[arg(
        long,
        group = "point",
        value_name = "FRAME,U,V",
        value_parser = frame_pixel,
        allow_hyphen_values = true
    )]
    frame: Option<FramePixel>,
    /// Many pixels: a CSV file with the columns frame (name of its file, or its index from 0), u
    /// and v. They are copied to --out with the columns theta_rad, h_m and range_m (distance from
    /// the camera) added, empty where the frame shows no wall. `-` is standard
    /// input.
    #[arg(
        long,
        group = "point",
        value_name = "IN.csv",
        requires = "out",
        value_parser = input_file()
    )]
    points: Option<PathBuf>,
    /// The file to write for --points; `-` is standard output.
    #[arg(long, short, value_name = "OUT.csv", requires = "points")]
    out: Option<PathBuf>,
    #[command(flatten)]
    poses: PosesArguments,
    #[command(flatten)]
    canvas: CanvasArguments,
    /// Angle θ of twelve o'clock, degrees.
    #[arg(
        long = "twelve-at",
        value_name = "DEG",
        default_value_t = 0.0,
        value_parser = bounded_number,
        allow_hyphen_values = true
    )]
    twelve_at_deg: f64,
}

/// A pixel of a frame.
#[derive(Clone, Debug)]
struct FramePixel {
    frame: String,
    pixel: [f64; 2],
}

/// Largest magnitude of a coordinate, metres, degrees or pixels.
const MAX_COORDINATE: f64 = 1e9;

fn bounded_number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.abs() <= MAX_COORDINATE => Ok(value),
        _ => Err(format!(
            "`{text}` is not a number within ±{MAX_COORDINATE:e}"
        )),
    }
}

fn number_pair(text: &str) -> Result<[f64; 2], String> {
    let (first, second) = text
        .split_once(',')
        .ok_or("must be two numbers separated by a comma")?;
    Ok([bounded_number(first)?, bounded_number(second)?])
}

/// Parses chainage and clock position into metres and degrees from twelve o'clock.
fn chainage_and_clock(text: &str) -> Result<[f64; 2], String> {
    const FORM: &str = "must be chainage and clock position, as 12.30,4:30";
    let (chainage, position) = text.split_once(',').ok_or(FORM)?;
    let (hours, minutes) = position.split_once(':').unwrap_or((position, "0"));
    let parsed = hours
        .trim()
        .parse::<u32>()
        .ok()
        .zip(minutes.trim().parse::<u32>().ok());
    match parsed {
        Some((hours, minutes)) if hours <= 12 && minutes < 60 => Ok([
            bounded_number(chainage)?,
            f64::from(hours % 12) * 30.0 + f64::from(minutes) * 0.5,
        ]),
        _ => Err(FORM.to_owned()),
    }
}

fn frame_pixel(text: &str) -> Result<FramePixel, String> {
    const FORM: &str = "must be a frame and a pixel of it, as 000017.png,320,240";
    let mut parts = text.rsplitn(3, ',');
    let (Some(v), Some(u), Some(frame)) = (parts.next(), parts.next(), parts.next()) else {
        return Err(FORM.to_owned());
    };
    Ok(FramePixel {
        frame: frame.trim().to_owned(),
        pixel: [bounded_number(u)?, bounded_number(v)?],
    })
}

/// The answer.
#[derive(Serialize)]
struct LocatedPoint {
    chainage_m: f64,
    theta_deg: f64,
    /// Hours and minutes.
    clock: String,
    /// Pixel of the panorama in its layout.
    panorama_px: [f64; 2],
    panorama_size_px: [u32; 2],
    in_panorama: bool,
    panorama_px_per_metre: f64,
    layout: Layout,
    frames: Vec<FrameSighting>,
}

#[derive(Serialize)]
struct FrameSighting {
    file: String,
    #[serde(flatten)]
    sighting: Sighting,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the survey, the poses or the point.
pub fn run(arguments: &LocateArguments, terminal: &Terminal) -> Result<(), Failure> {
    let (survey, trajectory) = arguments.poses.open(&arguments.survey, terminal)?;
    if let (Some(points), Some(out)) = (&arguments.points, &arguments.out) {
        return locate_points(&survey, &poses_of(&trajectory), points, out, terminal);
    }
    let surface = survey.surface.as_ref();
    let LaidOut {
        placements, canvas, ..
    } = lay_out(
        surface,
        &survey.cameras,
        &poses_of(&trajectory),
        &survey.shutter(),
        arguments.canvas.px_per_metre,
        1.0,
    )?;
    let layout = Layout::from(arguments.canvas.layout);
    let wall = wall_point(arguments, &survey, &placements, &canvas)?;
    let theta_deg = surface.angle_rad(wall.s_m).to_degrees();
    let masks = survey.frames.masks();
    let found = sightings(surface, &survey.cameras, masks, &placements, wall);
    let panorama_px = layout.to_picture(&canvas, canvas.pixel_of(wall));
    let located = LocatedPoint {
        chainage_m: wall.h_m,
        theta_deg,
        clock: clock_position(theta_deg - arguments.twelve_at_deg),
        panorama_px,
        panorama_size_px: layout.size(&canvas),
        in_panorama: layout.holds(&canvas, panorama_px),
        panorama_px_per_metre: canvas.px_per_metre,
        layout,
        frames: found
            .into_iter()
            .map(|sighting| FrameSighting {
                file: survey.frames[sighting.frame].name(),
                sighting,
            })
            .collect(),
    };
    if terminal.is_json() {
        return json::print(&located);
    }
    print_point(&located, survey.frames.len(), terminal);
    Ok(())
}

/// Finds the wall point that the arguments describe.
fn wall_point(
    arguments: &LocateArguments,
    survey: &Survey,
    placements: &[Placement],
    canvas: &Canvas,
) -> Result<WallPoint, Failure> {
    let on_wall = |[h_m, theta_deg]: [f64; 2]| WallPoint {
        s_m: survey.surface.s_at_m(theta_deg.to_radians()),
        h_m,
    };
    if let Some(wall) = arguments.wall {
        return Ok(on_wall(wall));
    }
    if let Some([h_m, from_twelve_deg]) = arguments.clock {
        return Ok(on_wall([h_m, from_twelve_deg + arguments.twelve_at_deg]));
    }
    if let Some(pixel) = arguments.panorama {
        let layout = Layout::from(arguments.canvas.layout);
        if !layout.holds(canvas, pixel) {
            let size = layout.size(canvas);
            return Err(Failure::usage(format!(
                "--panorama {},{}: the panorama of these poses has {} × {} px; give the \
                 --px-per-metre and --layout that it was drawn with",
                pixel[0], pixel[1], size[0], size[1]
            )));
        }
        return Ok(canvas.wall_at(layout.from_picture(canvas, pixel)));
    }
    let Some(FramePixel { frame, pixel }) = &arguments.frame else {
        return Err(Failure::bug("no point is given"));
    };
    let k = survey
        .find_frame(frame)
        .map_err(|what| Failure::usage(format!("--frame {frame}: {what}")))?;
    hit_of_pixel(
        survey.surface.as_ref(),
        survey.cameras.of(k),
        survey.frames.masks().of(k).map(AsRef::as_ref),
        &placements[k],
        *pixel,
    )
    .map(|hit| hit.wall)
    .map_err(|error| match error {
        FramePixelError::Outside { .. } => Failure::usage(format!("--frame {frame}: {error}")),
        FramePixelError::Surface(error) => Failure::input(format!("frame {k}: {error}")),
        _ => Failure::input(format!("--frame {frame}: {error}")),
    })
}

/// Formats an angle as hours and minutes: 12:00 at 0°, two minutes per degree.
fn clock_position(from_twelve_deg: f64) -> String {
    let minutes = (from_twelve_deg.rem_euclid(360.0) * 2.0).round() as u32 % 720;
    let hours = match minutes / 60 {
        0 => 12,
        hours => hours,
    };
    format!("{hours}:{:02}", minutes % 60)
}

fn print_point(located: &LocatedPoint, frames: usize, terminal: &Terminal) {
    let [x, y] = located.panorama_px;
    let [width, height] = located.panorama_size_px;
    terminal.say(format!(
        "chainage {:.4} m, {:.3}°, {} o'clock",
        located.chainage_m, located.theta_deg, located.clock
    ));
    let outside = if located.in_panorama {
        ""
    } else {
        ", outside of it"
    };
    terminal.say(format!(
        "panorama pixel {x:.2}, {y:.2} of {width} × {height} px{outside}"
    ));
    if located.frames.is_empty() {
        terminal.say(format!("none of the {frames} frames shows it"));
        return;
    }
    terminal.say(format!(
        "shown by {} of {frames} frames, in order of decreasing resolution:",
        located.frames.len()
    ));
    terminal.say(format!(
        "{:>6}  {:20} {:>9} {:>9} {:>8} {:>9} {:>8}",
        "frame", "file", "u", "v", "mm/px", "distance", "oblique"
    ));
    for FrameSighting { file, sighting } in &located.frames {
        let [u, v] = sighting.pixel;
        terminal.say(format!(
            "{:>6}  {file:20} {u:>9.2} {v:>9.2} {:>8.2} {:>7.3} m {:>7.1}°",
            sighting.frame,
            1e3 / sighting.px_per_metre,
            sighting.distance_m,
            sighting.obliqueness_deg
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clock_goes_round_in_half_degrees() {
        for (degrees, text) in [
            (0.0, "12:00"),
            (14.9, "12:30"),
            (135.0, "4:30"),
            (359.9, "12:00"),
            (-30.0, "11:00"),
        ] {
            assert_eq!(clock_position(degrees), text);
        }
        assert_eq!(chainage_and_clock("12.30,4:30"), Ok([12.3, 135.0]));
        assert_eq!(chainage_and_clock("-1,12"), Ok([-1.0, 0.0]));
        for wrong in ["1", "1,13:00", "1,4:75", "x,4:30", "1,four"] {
            assert!(chainage_and_clock(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_frame_may_have_commas_in_its_name() {
        let parsed = frame_pixel("a,b.png,3.5,4").unwrap();
        assert_eq!(
            (parsed.frame.as_str(), parsed.pixel),
            ("a,b.png", [3.5, 4.0])
        );
        assert!(frame_pixel("7,8").is_err() && frame_pixel("f,nan,1").is_err());
    }
}
