//! Reading of a video's properties with `ffprobe`.

use super::info::{Moment, PixelLayout, VideoInfo, start_error};
use super::input::{input_arguments, is_refused_format};
use image::ColorType;
use serde::Deserialize;
use std::io::ErrorKind;
use std::path::Path;
use std::process::{Command, Stdio};
use tunnelstitch_geometry::files::{open_regular, printed};

/// The output of `ffprobe -of json`.
#[derive(Deserialize)]
struct Probed {
    #[serde(default)]
    packets: Vec<Packet>,
    #[serde(default)]
    streams: Vec<Stream>,
}

#[derive(Deserialize)]
struct Packet {
    pts: Option<i64>,
    #[serde(default)]
    flags: String,
}

#[derive(Deserialize)]
struct Stream {
    width: Option<u32>,
    height: Option<u32>,
    pix_fmt: Option<String>,
    field_order: Option<String>,
    time_base: Option<String>,
    #[serde(default)]
    side_data_list: Vec<SideData>,
}

#[derive(Deserialize)]
struct SideData {
    rotation: Option<f64>,
}

/// Words by which `ffprobe` reports truncated files.
const TRUNCATION_WORDS: [&str; 3] = ["prematurely", "partial file", "truncat"];

/// Reads the properties of the video at `path`.
///
/// # Errors
/// See [`super::Video::open`].
pub fn probe(path: &Path) -> Result<VideoInfo, String> {
    if let Err(error) = open_regular(path) {
        return Err(match error.kind() {
            ErrorKind::NotFound => format!("{error}; frames.video is relative to survey.toml"),
            _ => error.to_string(),
        });
    }
    let mut command = Command::new("ffprobe");
    command.args([
        "-v",
        "error",
        "-select_streams",
        "v:0",
        "-of",
        "json",
        "-show_entries",
    ]);
    command.arg(
        "packet=pts,flags:stream=width,height,pix_fmt,field_order,time_base:\
         stream_side_data=rotation",
    );
    let output = command
        .args(input_arguments(path))
        .stdin(Stdio::null())
        .output()
        .map_err(|error| start_error("ffprobe", &error))?;
    let said = String::from_utf8_lossy(&output.stderr);
    // A line may begin with the file's name or the address of a structure.
    let complaint = said.lines().last().map(|line| {
        let line = line.rsplit("] ").next().unwrap_or(line);
        let name = format!("file:{}: ", path.display());
        line.strip_prefix(&name).unwrap_or(line).trim().to_owned()
    });
    if !output.status.success() {
        let why = complaint.unwrap_or_else(|| "ffprobe cannot read it".to_owned());
        if is_refused_format(&said) {
            return Err(
                "it is a list of other files, or no format of videos that is read; \
                        frames.video must be the video itself"
                    .to_owned(),
            );
        }
        return Err(format!(
            "{why}; it is not a video, is damaged, or was cut off before its end was written: copy \
             it again"
        ));
    }
    if TRUNCATION_WORDS.iter().any(|sign| said.contains(sign)) {
        return Err(format!(
            "the video is cut off ({}): copy it again, or recover its intact part with ffmpeg -i \
             {} -c copy whole.mkv",
            complaint.unwrap_or_default(),
            printed(path)
        ));
    }
    let probed: Probed = serde_json::from_slice(&output.stdout)
        .map_err(|error| format!("the output of ffprobe cannot be parsed: {error}"))?;
    let video = of(path, probed)?;
    Ok(VideoInfo {
        warning: complaint.map(|said| format!("{}: ffprobe says: {said}", printed(path))),
        ..video
    })
}

fn of(path: &Path, probed: Probed) -> Result<VideoInfo, String> {
    let stream = probed.streams.first().ok_or("has no video stream")?;
    let (Some(width), Some(height), Some(pixels), Some(time_base)) = (
        stream.width,
        stream.height,
        &stream.pix_fmt,
        &stream.time_base,
    ) else {
        return Err("has a video stream that ffmpeg cannot decode".to_owned());
    };
    if let Some(order @ ("tt" | "bb" | "tb" | "bt")) = stream.field_order.as_deref() {
        return Err(format!(
            "is interlaced (field order {order}): its odd and even rows are of different times; \
             make it progressive with ffmpeg -i {} \
             -vf bwdif -c:v libx264 -crf 12 progressive.mp4",
            printed(path)
        ));
    }
    let rotation = stream.side_data_list.iter().find_map(|data| data.rotation);
    let rotation = rotation.unwrap_or(0.0).rem_euclid(360.0);
    let (width, height) = match rotation {
        0.0 | 180.0 => (width, height),
        90.0 | 270.0 => (height, width),
        _ => {
            return Err(format!(
                "is displayed with a rotation of {rotation}°, which is not a multiple of 90°"
            ));
        }
    };
    let mut moments = Vec::with_capacity(probed.packets.len());
    for packet in &probed.packets {
        // Discarded packets at the beginning are in the file, but not displayed.
        if packet.flags.contains('D') {
            continue;
        }
        moments.push(Moment {
            ticks: packet.pts.ok_or_else(|| untimed(path))?,
            key: packet.flags.starts_with('K'),
        });
    }
    // Packets are in decoding order.
    moments.sort_unstable_by_key(|moment| moment.ticks);
    if moments
        .windows(2)
        .any(|pair| pair[0].ticks == pair[1].ticks)
    {
        return Err(untimed(path));
    }
    if moments.is_empty() {
        return Err("holds no pictures; it was cut off or is still being written".to_owned());
    }
    Ok(VideoInfo {
        path: path.to_owned(),
        layout: PixelLayout {
            width,
            height,
            colour: colour(pixels),
        },
        moments,
        tick_s: fraction(time_base).ok_or("has no valid time base")?,
        rotation_deg: rotation as i32,
        warning: None,
    })
}

fn untimed(path: &Path) -> String {
    format!(
        "has pictures without times; add times with ffmpeg -i {} -c:v libx264 -crf 12 timed.mp4",
        printed(path)
    )
}

/// The colour type of a pixel format; names of formats with more than 8 bits end in the byte order.
fn colour(pixels: &str) -> ColorType {
    let grey = pixels.starts_with("gray") || pixels.starts_with("ya");
    let deep = pixels.ends_with("le") || pixels.ends_with("be");
    match (grey, deep) {
        (true, false) => ColorType::L8,
        (true, true) => ColorType::L16,
        (false, false) => ColorType::Rgb8,
        (false, true) => ColorType::Rgb16,
    }
}

fn fraction(text: &str) -> Option<[i64; 2]> {
    let (num, den) = text.split_once('/')?;
    let (num, den) = (num.parse().ok()?, den.parse().ok()?);
    (num > 0 && den > 0).then_some([num, den])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn probed(json: &str) -> Result<VideoInfo, String> {
        of(Path::new("a.mp4"), serde_json::from_str(json).unwrap())
    }

    const STREAM: &str =
        r#""width": 64, "height": 48, "pix_fmt": "yuv420p10le", "time_base": "1/600""#;

    #[test]
    fn pictures_are_in_the_order_of_their_times_without_those_cut_away() {
        let json = format!(
            r#"{{"packets": [{{"pts": -20, "flags": "KD"}}, {{"pts": 0, "flags": "K_"}},
            {{"pts": 60, "flags": "__"}}, {{"pts": 20, "flags": "__"}}],
                 "streams": [{{{STREAM}, "side_data_list": [{{}}, {{"rotation": -90}}]}}]}}"#
        );
        let video = probed(&json).unwrap();
        let times: Vec<f64> = (0..video.moments.len()).map(|k| video.time_s(k)).collect();
        assert_eq!(times, [0.0, 20.0 / 600.0, 0.1]);
        assert_eq!(
            (video.layout.width, video.layout.height, video.rotation_deg),
            (48, 64, 270)
        );
        assert_eq!(video.layout.colour, ColorType::Rgb16);
    }

    #[test]
    fn what_cannot_be_used_is_refused() {
        let packets = r#""packets": [{"pts": 0, "flags": "K_"}]"#;
        for (json, expected) in [
            (r#"{"streams": []}"#.to_owned(), "no video stream"),
            (
                format!(r#"{{"streams": [{{{STREAM}}}]}}"#),
                "holds no pictures",
            ),
            (
                format!(r#"{{{packets}, "streams": [{{"width": 64}}]}}"#),
                "cannot decode",
            ),
            (
                format!(r#"{{{packets}, "streams": [{{{STREAM}, "field_order": "tt"}}]}}"#),
                "interlaced",
            ),
            (
                format!(
                    r#"{{{packets},
                    "streams": [{{{STREAM}, "side_data_list": [{{"rotation": 30}}]}}]}}"#
                ),
                "not a multiple of 90°",
            ),
            (
                format!(r#"{{"packets": [{{"flags": "K_"}}], "streams": [{{{STREAM}}}]}}"#),
                "pictures without times",
            ),
            (
                format!(
                    r#"{{"packets": [{{"pts": 1}}, {{"pts": 1}}], "streams": [{{{STREAM}}}]}}"#
                ),
                "pictures without times",
            ),
        ] {
            let message = probed(&json).map(|_| ()).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn pixels_are_grey_or_colour_and_deep_or_not() {
        for (pixels, expected) in [
            ("gray", ColorType::L8),
            ("gray10le", ColorType::L16),
            ("yuvj420p", ColorType::Rgb8),
            ("nv12", ColorType::Rgb8),
            ("p010le", ColorType::Rgb16),
            ("gbrp12be", ColorType::Rgb16),
        ] {
            assert_eq!(colour(pixels), expected, "{pixels}");
        }
    }
}
