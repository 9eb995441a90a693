//! A sequential decoder of a video: one `ffmpeg` process.

use super::info::{VideoInfo, start_error};
use super::input::input_arguments;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use tunnelstitch_geometry::files::printed;

/// Largest number of `ffmpeg`'s error lines in an error message.
const MAX_REPORTED_LINES: usize = 2;

/// A running `ffmpeg` whose next picture is `next`.
#[derive(Debug)]
pub struct Decoder {
    next: usize,
    child: Child,
    pictures: ChildStdout,
    /// The time of each picture, as a fraction of a second, in their order.
    times: Receiver<[i128; 2]>,
    /// Returns the errors reported by `ffmpeg`.
    listener: Option<JoinHandle<Vec<String>>>,
}

impl Decoder {
    /// Starts decoding at a picture. The start time lies halfway to the previous picture, so that
    /// rounding cannot select the wrong one.
    ///
    /// # Errors
    /// `ffmpeg` is missing.
    pub fn start(video: &VideoInfo, picture: usize) -> Result<Self, String> {
        let mut command = Command::new("ffmpeg");
        // Log levels separate errors from the rest; showinfo reports at `info`.
        command.args([
            "-hide_banner",
            "-nostdin",
            "-nostats",
            "-loglevel",
            "level+info",
        ]);
        // Damaged pictures are not concealed.
        command.args(["-xerror", "-threads", "2", "-copyts"]);
        if let Some(before) = picture.checked_sub(1) {
            let [a, b] = [before, picture].map(|k| video.moments[k].ticks as f64);
            let start = format!("{:.6}", video.seconds(0.5 * (a + b)));
            command.args(["-seek_timestamp", "1", "-ss", &start]);
        }
        command.args(input_arguments(&video.path));
        command.args(["-map", "0:v:0", "-fps_mode", "passthrough"]);
        command.args(["-vf", "showinfo=checksum=0"]);
        command.args(["-sws_flags", "bitexact+accurate_rnd+full_chroma_int"]);
        command.args([
            "-f",
            "rawvideo",
            "-pix_fmt",
            video.layout.ffmpeg_name(),
            "-",
        ]);
        command.stdin(Stdio::null());
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command
            .spawn()
            .map_err(|error| start_error("ffmpeg", &error))?;
        let (Some(pictures), Some(log)) = (child.stdout.take(), child.stderr.take()) else {
            return Err("ffmpeg has no output".to_owned());
        };
        let (sender, times) = channel();
        let listener = std::thread::spawn(move || listen(BufReader::new(log), &sender));
        Ok(Self {
            next: picture,
            child,
            pictures,
            times,
            listener: Some(listener),
        })
    }

    /// Index of the next picture.
    pub fn next(&self) -> usize {
        self.next
    }

    /// Decodes up to a picture, which must not lie behind, and returns its pixels.
    ///
    /// # Errors
    /// The video ends earlier, is damaged, or has no picture at that time.
    pub fn advance(&mut self, video: &VideoInfo, picture: usize) -> Result<Vec<u8>, String> {
        let mut bytes = vec![0; video.layout.bytes()];
        loop {
            let read = self.pictures.read_exact(&mut bytes);
            let time = read.ok().and_then(|()| self.times.recv().ok());
            let Some([count, of_a_second]) = time else {
                return Err(self.ended(video));
            };
            let expected = i128::from(video.moments[self.next].ticks);
            let [num, den] = video.tick_s.map(i128::from);
            if count * den != expected * num * of_a_second {
                return Err(format!(
                    "the video is damaged: picture {} should be at {:.6} s, but the decoded \
                     picture is at {:.6} s; re-encode the video: ffmpeg -i {} -c:v \
                     libx264 -crf 12 new.mp4",
                    self.next,
                    video.time_s(self.next),
                    count as f64 / of_a_second as f64,
                    printed(&video.path)
                ));
            }
            self.next += 1;
            if self.next > picture {
                return Ok(bytes);
            }
        }
    }

    /// The error message of a decoder that has ended.
    fn ended(&mut self, video: &VideoInfo) -> String {
        let _ = self.child.kill();
        let _ = self.child.wait();
        let complaints = self
            .listener
            .take()
            .and_then(|listener| listener.join().ok());
        let complaints = complaints.unwrap_or_default();
        let said = match complaints.len().saturating_sub(MAX_REPORTED_LINES) {
            _ if complaints.is_empty() => String::new(),
            from => format!(" ({})", complaints[from..].join("; ")),
        };
        format!(
            "the video is damaged or cut off: it decodes up to picture {} of {}{said}",
            self.next,
            video.moments.len()
        )
    }
}

impl Drop for Decoder {
    fn drop(&mut self) {
        // Fails if the process has already ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Reads the log of `ffmpeg` to its end: sends the pictures' times and returns the errors.
fn listen(log: impl BufRead, times: &Sender<[i128; 2]>) -> Vec<String> {
    let mut complaints = Vec::new();
    let mut tick_s = [1, 1];
    for line in log.split(b'\n').map_while(Result::ok) {
        let line = String::from_utf8_lossy(&line);
        if let Some(found) = after(&line, "config in time_base:").and_then(fraction) {
            tick_s = found;
        } else if let Some(ticks) = after(&line, " pts:").and_then(|word| word.parse::<i64>().ok())
        {
            // The receiver may have been dropped.
            let _ = times.send([i128::from(ticks) * tick_s[0], tick_s[1]]);
        } else if let Some((_, what)) = line.split_once("[error] ").or(line.split_once("[fatal] "))
        {
            complaints.push(what.trim().to_owned());
        }
    }
    complaints
}

/// The word after a text in a line.
fn after<'a>(line: &'a str, text: &str) -> Option<&'a str> {
    let (_, rest) = line.split_once(text)?;
    rest.split([' ', ',']).find(|word| !word.is_empty())
}

fn fraction(word: &str) -> Option<[i128; 2]> {
    let (num, den) = word.split_once('/')?;
    let (num, den): (i64, i64) = (num.parse().ok()?, den.parse().ok()?);
    (num > 0 && den > 0).then_some([num, den].map(i128::from))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_complaints_are_picked_out_of_the_log() {
        let log = "[info] Input #0, mov\n\
                   [Parsed_showinfo_0 @ 0x55] [info] config in time_base: 1/10240, frame_rate: \
                   10/1\n\
                   [Parsed_showinfo_0 @ 0x55] [info] config out time_base: 0/0, frame_rate: 0/0\n\
                   [Parsed_showinfo_0 @ 0x55] [info] n:   0 pts:  35840 pts_time:3.5     pos:  \
                   1639136 fmt:gray\n\
                   [Parsed_showinfo_0 @ 0x55] [info] n:   1 pts:-12 pts_time:3.6     pos:  \
                   1639136 fmt:gray\n\
                   [h264 @ 0x56] [error] error while decoding MB 3 4\n\
                   [fatal] corrupt decoded frame in stream 0\n";
        let (sender, times) = channel();
        let complaints = listen(log.as_bytes(), &sender);
        drop(sender);
        assert_eq!(
            times.iter().collect::<Vec<_>>(),
            [[35840, 10240], [-12, 10240]]
        );
        assert_eq!(
            complaints,
            [
                "error while decoding MB 3 4",
                "corrupt decoded frame in stream 0"
            ]
        );
    }
}
