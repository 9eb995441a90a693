//! Times of the frames.

use super::error::SurveyError;
use crate::frames::FrameFile;
use std::collections::HashMap;
use std::path::Path;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::trajectory::{PoseError, TimeUnit, text, times};

/// Reads the frames' times, seconds, one per frame.
///
/// One line per frame: its time alone, in the order of the frames' names (KITTI's `times.txt`); or
/// time and name in either order (TUM's `rgb.txt`, EuRoC's `data.csv`), with blanks or a comma
/// between. They are in `unit`; without one, a comment tells it, as `[ns]`, or whole numbers of 16
/// digits and more are nanoseconds, all else is seconds. Lines of files that are not frames of the
/// survey are ignored.
///
/// # Errors
/// An unreadable file, a line of another form, a frame without a time, two times of one frame.
pub(super) fn read(
    path: &Path,
    frames: &[FrameFile],
    unit: Option<TimeUnit>,
) -> Result<Vec<f64>, SurveyError> {
    let lines = read_lines(path, unit)?;
    let file = |what: String| SurveyError::from(PoseError::file(path, what));
    if lines.iter().all(|line| line.name.is_none()) {
        return if lines.len() == frames.len() {
            Ok(lines.iter().map(|line| line.time_s).collect())
        } else {
            Err(file(format!(
                "{} times for {} frames; every frame needs one, in the order of the frames' \
                 names, or with its name beside it",
                lines.len(),
                frames.len()
            )))
        };
    }
    let mut by_name: HashMap<&str, f64> = HashMap::new();
    for line in &lines {
        let Some(name) = &line.name else {
            return Err(file("some lines have a name and some do not".to_owned()));
        };
        if by_name.insert(base_name(name), line.time_s).is_some() {
            let what = format!("a second time of {name}");
            return Err(PoseError::line(path, line.number, what).into());
        }
    }
    let of_frame = |frame: &FrameFile| {
        by_name.get(frame.name().as_str()).copied().ok_or_else(|| {
            file(format!(
                "no time of frame {} ({})",
                frame.index,
                frame.name()
            ))
        })
    };
    frames.iter().map(of_frame).collect()
}

/// Reads the times of all lines of a file, in order, seconds.
///
/// # Errors
/// An unreadable file, a line of another form.
pub fn read_frame_times(path: &Path) -> Result<Vec<f64>, SurveyError> {
    let lines = read_lines(path, None)?;
    Ok(lines.into_iter().map(|line| line.time_s).collect())
}

/// A line of a file of times.
struct Line {
    number: usize,
    time_s: f64,
    name: Option<String>,
}

fn read_lines(path: &Path, unit: Option<TimeUnit>) -> Result<Vec<Line>, SurveyError> {
    let text = text::read(path)?;
    let unit = unit.or_else(|| TimeUnit::of_comments(&text));
    let mut lines = Vec::new();
    for (number, line) in text::lines(&text) {
        let fail = |what: String| PoseError::line(path, number, what);
        let is_between = |c: char| c == ',' || c.is_whitespace();
        let line = line.trim_matches(is_between);
        let is_time = |word: &str| times::from_word(word, unit).is_some();
        // Names may have blanks.
        let (time, name) = match (line.split_once(is_between), line.rsplit_once(is_between)) {
            (Some((time, name)), _) if is_time(time) => (time, Some(name)),
            (_, Some((name, time))) => (time, Some(name)),
            (_, None) => (line, None),
        };
        let name = name.map(|name| name.trim_matches(is_between));
        let time_s = times::from_word(time, unit).ok_or_else(|| {
            fail(format!(
                "`{time}` is not a time; give seconds, or whole nanoseconds"
            ))
        })?;
        lines.push(Line {
            number,
            time_s,
            name: name.map(str::to_owned),
        });
    }
    Ok(lines)
}

/// Reads the times from the frames' names, in `unit`, or in that which the number of digits tells;
/// where these have none, from EXIF data, if they name one for each frame.
///
/// # Errors
/// The first frame whose name contains no time.
pub(super) fn from_pictures(
    frames: &[FrameFile],
    unit: Option<TimeUnit>,
) -> Result<Vec<f64>, SurveyError> {
    from_names(frames, unit).or_else(|error| {
        let first = frames.first().and_then(FrameFile::exif_time_s);
        let exif = || -> Option<Vec<f64>> {
            let times_s = frames.par_map(FrameFile::exif_time_s);
            times_s.into_iter().collect()
        };
        // Pictures of one second have no time of their own.
        let increase = |times_s: &Vec<f64>| times_s.is_sorted_by(|a, b| a < b);
        first.and_then(|_| exif()).filter(increase).ok_or(error)
    })
}

/// Reads the times from the frames' names, in `unit`, or in that which the number of digits tells.
///
/// # Errors
/// The first frame whose name contains no time.
pub(super) fn from_names(
    frames: &[FrameFile],
    unit: Option<TimeUnit>,
) -> Result<Vec<f64>, SurveyError> {
    let of_frame = |frame: &FrameFile| {
        let stem = frame.path.file_stem().unwrap_or_default().to_string_lossy();
        times::from_name(&stem, unit).ok_or_else(|| SurveyError::FrameTime {
            frame: frame.index,
            file: frame.path.clone(),
        })
    };
    frames.iter().map(of_frame).collect()
}

/// The last component of a path with `/` or `\` as separators.
fn base_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(names: &[&str]) -> Vec<FrameFile> {
        let frame = |(index, name): (usize, &&str)| {
            FrameFile::picture(index, Path::new("survey/frames").join(name))
        };
        names.iter().enumerate().map(frame).collect()
    }

    fn read_text(text: &str) -> Result<Vec<f64>, SurveyError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("times.txt");
        std::fs::write(&path, text).unwrap();
        read(&path, &frames(&["a.png", "b.png"]), None)
    }

    #[test]
    fn all_usual_lists_of_times_are_read() {
        for text in [
            "1.5\n2.5\n",
            "# rgb\r\n1.5 rgb/a.png\r\n2.5 rgb/b.png\r\n",
            "b.png 2.5\na.png 1.5\nelsewhere.png 9\n",
            "#timestamp [ns],filename\n2500000000000000,b.png\n1500000000000000,a.png\n",
        ] {
            let expected = if text.contains("ns") {
                [1.5e6, 2.5e6]
            } else {
                [1.5, 2.5]
            };
            assert_eq!(read_text(text).unwrap(), expected, "{text}");
        }
    }

    #[test]
    fn names_may_have_blanks() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("times.txt");
        std::fs::write(&path, "1.5 part 1/frame 1.png\nframe 2.png, 2.5\n").unwrap();
        let times_s = read(&path, &frames(&["frame 1.png", "frame 2.png"]), None);
        assert_eq!(times_s.unwrap(), [1.5, 2.5]);
    }

    #[test]
    fn bad_lists_say_what_is_wrong() {
        for (text, expected) in [
            ("", "0 times for 2 frames"),
            ("1\n2\n3\n", "3 times for 2 frames"),
            ("1\nx\n", ":2: `x` is not a time"),
            ("1\nnan\n", ":2: `nan` is not a time"),
            ("1 a.png\n2 a.png\n", ":2: a second time of a.png"),
            ("1 a.png\n", "no time of frame 1 (b.png)"),
            ("1 a.png\n2\n", "some lines have a name"),
            ("1 a.png 3\n", "no time of frame 0 (a.png)"),
        ] {
            let message = read_text(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn a_counter_is_no_time() {
        assert_eq!(
            from_names(&frames(&["1.25.png", "1.5.png"]), None).unwrap(),
            [1.25, 1.5]
        );
        let message = from_names(&frames(&["000001.png"]), None)
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("frame 0") && message.contains("frames.times"),
            "{message}"
        );
    }
}
