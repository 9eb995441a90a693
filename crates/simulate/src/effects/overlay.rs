//! Overlay that is burnt into the frames: text and logo.

use crate::effects::effect_options::OverlayParts;
use crate::effects::frame_effect::FrameEffect;
use crate::effects::overlay_logo::logo_grey;
use crate::effects::overlay_text::{Ink, TextLine, letter_scale, lines};
use tunnelstitch_core::frames::GreyImage;

/// Grey levels of letters and of their outline.
const LETTER_GREY: f32 = 250.0;
const OUTLINE_GREY: f32 = 10.0;

/// Text at the lower left, of which the last line differs from frame to frame, and a logo at the
/// upper right.
pub(crate) struct Overlay {
    parts: OverlayParts,
    width: usize,
    height: usize,
    /// Time from frame to frame, seconds.
    interval_s: f64,
}

impl Overlay {
    /// The overlay of frames of `width × height` pixels, `interval_s` seconds apart.
    pub fn new(parts: OverlayParts, [width, height]: [usize; 2], interval_s: f64) -> Self {
        Self {
            parts,
            width,
            height,
            interval_s,
        }
    }

    /// Calls `put` with the index and the grey level of each pixel of the text of a frame.
    fn draw_text(&self, frame: usize, mut put: impl FnMut(usize, f32)) {
        if self.parts == OverlayParts::Logo {
            return;
        }
        let scale = letter_scale(self.width);
        let lines = lines(frame, frame as f64 * self.interval_s);
        let mut bottom = self.height.saturating_sub(4 * scale as usize);
        for text in lines.iter().rev() {
            let line = TextLine::draw(text, scale);
            // A frame too low for all lines has the last ones.
            let Some(top) = bottom.checked_sub(line.height) else {
                return;
            };
            let left = 4 * scale as usize;
            for (k, ink) in line.ink.iter().enumerate() {
                let (u, v) = (left + k % line.width, top + k / line.width);
                if u < self.width {
                    match ink {
                        Ink::None => {}
                        Ink::Outline => put(v * self.width + u, OUTLINE_GREY),
                        Ink::Letter => put(v * self.width + u, LETTER_GREY),
                    }
                }
            }
            bottom = top;
        }
    }

    /// Calls `put` with the index and the grey level of each pixel of the logo.
    fn draw_logo(&self, mut put: impl FnMut(usize, f32)) {
        if self.parts == OverlayParts::Text {
            return;
        }
        for k in 0..self.width * self.height {
            if let Some(grey) = logo_grey(self.width, self.height, k % self.width, k / self.width) {
                put(k, grey);
            }
        }
    }

    /// Mask of the pixels that the overlay covers in none of the frames, row-major.
    pub fn wall_mask(&self, frames: impl Iterator<Item = usize>) -> Vec<bool> {
        let mut wall = vec![true; self.width * self.height];
        self.draw_logo(|k, _| wall[k] = false);
        for frame in frames {
            self.draw_text(frame, |k, _| wall[k] = false);
        }
        wall
    }
}

impl FrameEffect for Overlay {
    fn apply(&self, frame: usize, mut image: GreyImage) -> GreyImage {
        let data = image.data_mut();
        self.draw_logo(|k, grey| data[k] = grey);
        self.draw_text(frame, |k, grey| data[k] = grey);
        image
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 2] = [320, 240];
    /// A grey level that the overlay does not have.
    const WALL: f32 = 99.5;

    fn burnt(parts: OverlayParts, frame: usize) -> GreyImage {
        let even = GreyImage::new(SIZE[0], SIZE[1], vec![WALL; SIZE[0] * SIZE[1]]);
        Overlay::new(parts, SIZE, 0.4).apply(frame, even)
    }

    #[test]
    fn the_mask_is_all_that_the_overlay_covers_in_any_frame() {
        for parts in [OverlayParts::Text, OverlayParts::Logo, OverlayParts::Both] {
            let wall = Overlay::new(parts, SIZE, 0.4).wall_mask(0..30);
            let images: Vec<GreyImage> = (0..30).map(|frame| burnt(parts, frame)).collect();
            for (k, wall) in wall.iter().enumerate() {
                let covered = images.iter().any(|image| image.data()[k] != WALL);
                assert_eq!(*wall, !covered);
            }
            let hidden = wall.iter().filter(|wall| !**wall).count();
            assert!((500..20_000).contains(&hidden), "{hidden}");
        }
    }

    #[test]
    fn only_the_last_line_changes() {
        let (first, then) = (burnt(OverlayParts::Both, 3), burnt(OverlayParts::Both, 4));
        let changed: Vec<usize> = (0..SIZE[0] * SIZE[1])
            .filter(|k| first.data()[*k] != then.data()[*k])
            .map(|k| k / SIZE[0])
            .collect();
        assert!(changed.len() > 20, "{}", changed.len());
        assert!(
            changed.iter().all(|v| (225..237).contains(v)),
            "{changed:?}"
        );
        assert_eq!(burnt(OverlayParts::Logo, 3), burnt(OverlayParts::Logo, 4));
    }

    #[test]
    fn tiny_frames_have_what_fits() {
        let overlay = Overlay::new(OverlayParts::Both, [16, 16], 1.0);
        let image = overlay.apply(0, GreyImage::new(16, 16, vec![WALL; 256]));
        assert!(image.data().contains(&WALL));
        assert!(image.data().iter().any(|value| *value != WALL));
    }
}
