//! Text of a burnt-in overlay.

use image::{Rgb, RgbImage};
use tunnelstitch_core::bitmap_text::{self, LETTER};

/// Lines that are the same in every frame.
const HEADING: [&str; 2] = ["TUNNEL INSPECTION", "CAM 1  LINE 2 NORTH"];
/// Width of a frame for each step of the letters' size, pixels.
const FRAME_PX: usize = 320;
/// Day at which the clock starts, and time of that day, seconds.
const START: (u64, f64) = (14, 34_200.0);

/// Size of the letters, in multiples of the font's, in frames of the given width.
pub(super) fn letter_scale(width: usize) -> u32 {
    (width / FRAME_PX).max(1) as u32
}

/// The lines of a frame that is taken `time_s` seconds after the first: a heading, and date, time
/// and counter.
///
/// Days beyond the end of the month begin it anew.
pub(super) fn lines(frame: usize, time_s: f64) -> [String; 3] {
    const DAY_S: f64 = 86_400.0;
    let clock_s = START.1 + time_s;
    let day = START.0 + (clock_s / DAY_S) as u64;
    let second = clock_s.rem_euclid(DAY_S);
    let (hours, minutes) = (second / 3600.0, second / 60.0 % 60.0);
    let last = format!(
        "2024-05-{:02} {:02}:{:02}:{:04.1} {frame:05}",
        (day - 1) % 31 + 1,
        hours as u32,
        minutes as u32,
        (second % 60.0 * 10.0).floor() / 10.0,
    );
    let [first, second] = HEADING.map(String::from);
    [first, second, last]
}

/// Pixels of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ink {
    /// None: the picture shows.
    None,
    /// Dark outline.
    Outline,
    /// Bright letter.
    Letter,
}

/// Picture of a line of text: white letters with a dark outline around them.
pub(super) struct TextLine {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Row-major.
    pub ink: Vec<Ink>,
}

impl TextLine {
    /// Draws a line of text; the outline is as thick as a stroke at scale 1.
    pub fn draw(text: &str, scale: u32) -> Self {
        let size = [bitmap_text::width(text, scale) + 2, LETTER * scale + 2];
        let mut image = RgbImage::new(size[0], size[1]);
        bitmap_text::draw(&mut image, [1, 1], text, scale, Rgb([255; 3]));
        let is_letter = |u: i64, v: i64| {
            let within =
                (0..i64::from(size[0])).contains(&u) && (0..i64::from(size[1])).contains(&v);
            within && image.get_pixel(u as u32, v as u32).0[0] > 0
        };
        let ink = |k: u32| {
            let (u, v) = (i64::from(k % size[0]), i64::from(k / size[0]));
            let mut around = (0..9).map(|k| (u + k % 3 - 1, v + k / 3 - 1));
            if is_letter(u, v) {
                Ink::Letter
            } else if around.any(|(u, v)| is_letter(u, v)) {
                Ink::Outline
            } else {
                Ink::None
            }
        };
        Self {
            width: size[0] as usize,
            height: size[1] as usize,
            ink: (0..size[0] * size[1]).map(ink).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_line_counts_frames_and_time() {
        assert_eq!(lines(0, 0.0)[2], "2024-05-14 09:30:00.0 00000");
        assert_eq!(lines(12, 4.0)[2], "2024-05-14 09:30:04.0 00012");
        assert_eq!(lines(7, 86_400.0 + 61.27)[2], "2024-05-15 09:31:01.2 00007");
        assert_eq!(lines(7, 18.0 * 86_400.0)[2], "2024-05-01 09:30:00.0 00007");
        assert_eq!(lines(3, 1.0)[..2], lines(4, 2.0)[..2]);
    }

    #[test]
    fn letters_have_an_outline_all_around() {
        let line = TextLine::draw("I0", 2);
        assert_eq!((line.width, line.height), (34, 18));
        let at = |u: usize, v: usize| line.ink[v * line.width + u];
        for v in 1..line.height - 1 {
            for u in 1..line.width - 1 {
                let around = (0..9).map(|k| at(u + k % 3 - 1, v + k / 3 - 1));
                if at(u, v) == Ink::Letter {
                    assert!(around.into_iter().all(|ink| ink != Ink::None), "{u} {v}");
                }
            }
        }
        assert!(line.ink.contains(&Ink::None));
    }
}
