//! Gyroflow's gyroscope log, `.gcsv`: a text of `key,value` lines (some loggers write a colon),
//! then a table `t,gx,gy,gz[,ax,ay,az[,mx,my,mz]]`.
//!
//! `t · tscale` is seconds, `gx · gscale` rad/s, `ax · ascale` multiples of g; all in the sensor's
//! own axes.
//!
//! Source: <https://docs.gyroflow.xyz/app/technical-details/gcsv-format>.

use super::log::{GyroLog, GyroSample, Readout, ReadoutDirection};
use super::orientation::Orientation;
use crate::trajectory::error::PoseError;
use crate::trajectory::text;
use nalgebra::Vector3;
use std::collections::HashMap;
use std::path::Path;

/// The two possible first lines.
const TITLES: [&str; 2] = ["GYROFLOW IMU LOG", "CAMERA IMU LOG"];
/// The table's columns, of which the first 4, 7 or all are present.
const COLUMNS: [&str; 10] = ["t", "gx", "gy", "gz", "ax", "ay", "az", "mx", "my", "mz"];

/// The `key,value` lines.
#[derive(Default)]
struct Header<'a>(HashMap<String, (usize, &'a str)>);

impl Header<'_> {
    /// The number of a key.
    fn number(&self, path: &Path, key: &str) -> Result<Option<f64>, PoseError> {
        let parse = |(line, value): &(usize, &str)| {
            text::finite(value)
                .map_err(|what| PoseError::line(path, *line, format!("{key}: {what}")))
        };
        self.0.get(key).map(parse).transpose()
    }

    /// The scale factor of a sensor's values.
    fn scale(&self, path: &Path, key: &str, what: &str) -> Result<f64, PoseError> {
        match self.number(path, key)? {
            Some(scale) if scale > 0.0 => Ok(scale),
            Some(scale) => {
                let line = self.0.get(key).map_or(0, |(line, _)| *line);
                Err(PoseError::line(
                    path,
                    line,
                    format!("{key} is {scale}; it must be positive"),
                ))
            }
            None => Err(PoseError::file(
                path,
                format!("its header has no `{key}`, by which {what} are multiplied"),
            )),
        }
    }

    fn readout(&self, path: &Path) -> Result<Option<Readout>, PoseError> {
        let Some(time_ms) = self.number(path, "frame_readout_time")? else {
            return Ok(None);
        };
        let word = self.0.get("frame_readout_direction");
        let direction = match word.map_or("0", |(_, value)| *value) {
            "0" | "TopToBottom" => ReadoutDirection::TopToBottom,
            "1" | "180" | "BottomToTop" => ReadoutDirection::BottomToTop,
            "2" | "3" | "90" | "270" | "LeftToRight" | "RightToLeft" => ReadoutDirection::Sideways,
            other => {
                let line = word.map_or(0, |(line, _)| *line);
                let what = format!("frame_readout_direction is `{other}`; it must be 0, 1, 2 or 3");
                return Err(PoseError::line(path, line, what));
            }
        };
        Ok((time_ms > 0.0).then_some(Readout { time_ms, direction }))
    }
}

/// Reads a gcsv log.
///
/// # Errors
/// An unreadable file; another first line; a header without scales, or with an impossible
/// orientation; a table with other columns; a line with more or fewer columns than the table's
/// first, or with something that is no number; times that do not increase; fewer than two
/// samples.
pub fn read(path: &Path) -> Result<GyroLog, PoseError> {
    let text = text::read(path)?;
    let mut lines = text::lines(&text);
    match lines.next() {
        Some((_, title)) if TITLES.contains(&title) => {}
        first => {
            let (number, found) = first.unwrap_or((1, ""));
            let found: String = found.chars().take(40).collect();
            return Err(PoseError::line(
                path,
                number,
                format!(
                    "`{found}` where a gcsv log begins with `{}`; Gyroflow converts others to \
                     it",
                    TITLES[0]
                ),
            ));
        }
    }
    let mut header = Header::default();
    let columns = loop {
        let Some((number, line)) = lines.next() else {
            return Err(PoseError::file(
                path,
                "ends within its header: there is no line `t,gx,gy,gz`",
            ));
        };
        let Some((key, value)) = line.split_once([',', ':']) else {
            let what = format!("`{line}` where the header has lines `key,value`");
            return Err(PoseError::line(path, number, what));
        };
        let key = key.trim().to_lowercase();
        if key == "t" || key == "time" {
            break columns(line).map_err(|what| PoseError::line(path, number, what))?;
        }
        header.0.insert(key, (number, value.trim()));
    };
    let orientation = match header.0.get("orientation") {
        Some((number, word)) => {
            let fail = |what: String| PoseError::line(path, *number, what);
            Some(Orientation::parse(word).map_err(fail)?)
        }
        None => None,
    };
    let scales = Scales {
        seconds: header.scale(path, "tscale", "times")?,
        rad_s: header.scale(path, "gscale", "rates")?,
        g: if columns > 4 {
            header.scale(path, "ascale", "accelerations")?
        } else {
            1.0
        },
    };
    let readout = header.readout(path)?;
    let mut samples: Vec<GyroSample> = Vec::new();
    for (number, line) in lines {
        let last_s = samples.last().map(|sample| sample.time_s);
        let sample = sample(line, columns, &scales, last_s)
            .map_err(|what| PoseError::line(path, number, what))?;
        samples.push(sample);
    }
    if samples.len() < 2 {
        return Err(PoseError::file(
            path,
            format!("{} samples; at least two are needed", samples.len()),
        ));
    }
    Ok(GyroLog {
        path: path.to_owned(),
        orientation,
        readout,
        rate_scale: Some(scales.rad_s),
        samples,
    })
}

/// Scale factors of the raw numbers.
struct Scales {
    seconds: f64,
    rad_s: f64,
    g: f64,
}

/// The number of columns named in the table's first line.
fn columns(line: &str) -> Result<usize, String> {
    let names: Vec<String> = line
        .split(',')
        .map(|word| word.trim().to_lowercase())
        .collect();
    let right = names
        .iter()
        .zip(COLUMNS)
        .skip(1)
        .all(|(name, column)| name == column);
    match names.len() {
        count @ (4 | 7 | 10) if right => Ok(count),
        _ => Err(format!(
            "columns `{line}`; they must be t,gx,gy,gz, then ax,ay,az and mx,my,mz if there"
        )),
    }
}

fn sample(
    line: &str,
    columns: usize,
    scales: &Scales,
    last_s: Option<f64>,
) -> Result<GyroSample, String> {
    let values = line
        .split(',')
        .map(|word| text::finite(word.trim()))
        .collect::<Result<Vec<f64>, String>>()?;
    if values.len() != columns {
        return Err(format!(
            "{} columns where the table's first line names {columns}; if the log was cut off, \
             delete this line",
            values.len()
        ));
    }
    let three = |from: usize| {
        let part = values.get(from..from + 3)?;
        Some(Vector3::from_column_slice(part))
    };
    let time_s = values.first().copied().unwrap_or_default() * scales.seconds;
    if let Some(last_s) = last_s
        && time_s <= last_s
    {
        return Err(format!(
            "time {time_s} s after {last_s} s: times must increase; sort the table, and leave one \
             of samples of the same time"
        ));
    }
    Ok(GyroSample {
        time_s,
        rate_rad_s: three(1).unwrap_or_default() * scales.rad_s,
        acceleration_g: three(4).map(|a| a * scales.g),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<GyroLog, PoseError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log.gcsv");
        std::fs::write(&path, text).unwrap();
        super::read(&path)
    }

    /// The example of the format's documentation.
    const EXAMPLE: &str = "GYROFLOW IMU LOG\nversion,1.3\nid,custom_logger_name\norientation,YxZ\n\
        note,development, test\nfwversion,FIRMWARE_0.1.0\ntimestamp,1644159993\nvendor,potatocam\n\
        videofilename,videofilename.mp4\n\
        lensprofile,potatocam/potatocam_mark1_prime_7_5mm_4k\nlens_info,wide\n\
        frame_readout_time,15.23\nframe_readout_direction,0\ntscale,0.001\ngscale,0.00122173047\n\
        ascale,0.00048828125\nt,gx,gy,gz,ax,ay,az\n\
        0,39,86,183,-1137,-15689,-2986\n1,56,100,202,-1179,-15694,-2887\n";

    #[test]
    fn the_documented_log_is_read() {
        let log = read(EXAMPLE).unwrap();
        assert_eq!(log.orientation, Some(Orientation::parse("YxZ").unwrap()));
        let readout = log.readout.unwrap();
        assert_eq!(readout.time_ms, 15.23);
        assert_eq!(readout.direction, ReadoutDirection::TopToBottom);
        assert_eq!(log.samples.len(), 2);
        let sample = log.samples[1];
        assert_eq!(sample.time_s, 0.001);
        assert_eq!(sample.rate_rad_s.z, 202.0 * 0.00122173047);
        assert_eq!(sample.acceleration_g.unwrap().x, -1179.0 * 0.00048828125);
        let rates = log.rates(&log.orientation.unwrap().to_camera());
        assert_eq!(rates.rates()[1].y, -100.0 * 0.00122173047);
    }

    /// As loggers of action cameras and small computers write it.
    #[test]
    fn a_colon_may_stand_for_the_comma_of_a_key() {
        let mixed = EXAMPLE.replace("version,1.3", "version:1.1");
        let colons = mixed
            .replace("tscale,", "tscale: ")
            .replace("note,", "note:");
        for text in [mixed, colons] {
            let log = read(&text).unwrap();
            assert_eq!((log.samples.len(), log.samples[1].time_s), (2, 0.001));
        }
    }

    #[test]
    fn gyro_alone_magnetometers_line_ends_and_the_neutral_title_are_fine() {
        let plain = "\u{feff}CAMERA IMU \
                     LOG\r\nversion,1.0\r\ntscale,1e-6\r\ngscale,1\r\nt,gx,gy,gz\r\n\
            0, 0.1,0.2,0.3\r\n1000,1,2,3\r\n\r\n";
        let log = read(plain).unwrap();
        assert_eq!(log.samples[1].time_s, 0.001);
        assert!(log.orientation.is_none() && log.readout.is_none());
        assert!(log.samples[0].acceleration_g.is_none());
        let all = "GYROFLOW IMU LOG\ntscale,1\ngscale,1\nascale,1\nmscale,1\nframe_readout_time,8\n\
            frame_readout_direction,1\nt,gx,gy,gz,ax,ay,az,mx,my,mz\n\
            0,1,2,3,4,5,6,7,8,9\n1,1,2,3,4,5,6,7,8,9\n";
        let log = read(all).unwrap();
        assert_eq!(
            log.samples[0].acceleration_g,
            Some(Vector3::new(4.0, 5.0, 6.0))
        );
        assert_eq!(
            log.readout.unwrap().direction,
            ReadoutDirection::BottomToTop
        );
    }

    #[test]
    fn broken_logs_say_where() {
        let table = "GYROFLOW IMU LOG\ntscale,1\ngscale,1\nt,gx,gy,gz\n";
        for (text, expected) in [
            (String::new(), ":1: `` where a gcsv log begins"),
            ("0,1,2,3\n".to_owned(), ":1: `0,1,2,3` where"),
            (
                "GYROFLOW IMU LOG\ntscale,1\n".to_owned(),
                "ends within its header",
            ),
            ("GYROFLOW IMU LOG\nhello\n".to_owned(), ":2: `hello`"),
            (
                "GYROFLOW IMU LOG\ngscale,1\nt,gx,gy,gz\n".to_owned(),
                "no `tscale`",
            ),
            (
                "GYROFLOW IMU LOG\ntscale,0\ngscale,1\nt,gx,gy,gz\n".to_owned(),
                ":2: tscale is 0",
            ),
            (
                "GYROFLOW IMU LOG\ntscale,x\ngscale,1\nt,gx,gy,gz\n".to_owned(),
                ":2: tscale: `x`",
            ),
            (
                "GYROFLOW IMU LOG\norientation,XXZ\ntscale,1\ngscale,1\nt,gx,gy,gz\n".to_owned(),
                ":2: `XXZ`",
            ),
            (
                "GYROFLOW IMU LOG\ntscale,1\ngscale,1\nt,ax,ay,az\n".to_owned(),
                ":4: columns",
            ),
            (
                "GYROFLOW IMU LOG\ntscale,1\ngscale,1\nt,gx,gy,gz,ax\n".to_owned(),
                ":4: columns",
            ),
            (
                "GYROFLOW IMU LOG\ntscale,1\ngscale,1\nt,gx,gy,gz,ax,ay,az\n".to_owned(),
                "no \
                                                                                        `ascale`",
            ),
            (
                "GYROFLOW IMU \
                 LOG\nframe_readout_time,1\nframe_readout_direction,7\n\
                 tscale,1\ngscale,1\nt,gx,gy,gz\n"
                    .to_owned(),
                ":3: frame_readout_direction is `7`",
            ),
            (format!("{table}0,1,2,3\n"), "1 samples"),
            (format!("{table}0,1,2,3\n1,1,2\n"), ":6: 3 columns"),
            (format!("{table}0,1,2,nan\n"), ":5: `nan`"),
            (format!("{table}0,1,2,\n"), ":5: ``"),
            (
                format!("{table}1,1,2,3\n0,1,2,3\n"),
                ":6: time 0 s after 1 s",
            ),
            (
                format!("{table}1,1,2,3\n1,1,2,3\n"),
                ":6: time 1 s after 1 s",
            ),
        ] {
            let message = read(&text).unwrap_err().to_string();
            assert!(message.contains(expected), "{text}: {message}");
        }
    }
}
