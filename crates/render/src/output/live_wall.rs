//! The unrolled wall while frames are taken: drawn coarsely, frame by frame, so that the time for
//! one does not grow with their number.

use super::gaps::{Coverage, Gap};
use super::preview::Preview;
use crate::compositing::band::{Band, Target};
use crate::error::RenderError;
use crate::layout::canvas::{Canvas, Layout};
use crate::sampling::pixel_format::PixelFormat;
use crate::sampling::sample::Samples;
use image::RgbImage;
use rayon::prelude::*;
use tunnelstitch_core::frames::GreyImage;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::surface::{Footprint, Surface, SurfaceError, shortest_arc};
use tunnelstitch_geometry::trajectory::Pose;

/// Pixels of the picture around the tunnel, at the most.
const MAX_COLUMNS: f64 = 720.0;
/// Pixels of the picture at the most: 1 GiB.
const MAX_PIXELS: f64 = 1.34e8;
/// Area of the smallest gap that is reported, pixels.
const MIN_GAP_PX: f64 = 64.0;
const GREY: PixelFormat = PixelFormat {
    channels: 1,
    deep: false,
};

/// The unrolled wall as far as frames have shown it.
pub struct LiveWall {
    canvas: Canvas,
    /// Sum of the grey levels of each pixel and their number, row-major.
    sums: Vec<[f32; 2]>,
    /// The part of the wall at which each frame looks.
    footprints: Vec<Footprint>,
}

impl LiveWall {
    /// A wall that nothing has shown yet, drawn at `px_per_metre` or less.
    pub fn new(surface: &dyn Surface, px_per_metre: f64) -> Self {
        let perimeter_m = surface.perimeter_m();
        let columns = (px_per_metre * perimeter_m).clamp(1.0, MAX_COLUMNS).round();
        Self {
            canvas: Canvas {
                columns: columns as u32,
                rows: 0,
                px_per_metre: columns / perimeter_m,
                h_start_m: 0.0,
            },
            sums: Vec::new(),
            footprints: Vec::new(),
        }
    }

    /// Resolution, pixels per metre.
    pub fn px_per_metre(&self) -> f64 {
        self.canvas.px_per_metre
    }

    /// Adds a frame at `pose`; `picture`: in grey, of the size of `camera`, if it shows the wall.
    /// Pixels without a value are NaN.
    ///
    /// # Errors
    /// A camera outside the tunnel, or of unlimited range that looks along the axis.
    pub fn add(
        &mut self,
        surface: &dyn Surface,
        camera: &Camera,
        pose: &Pose,
        picture: Option<&GreyImage>,
    ) -> Result<(), SurfaceError> {
        let footprint = Footprint::trace(surface, camera, pose)?;
        self.footprints.push(footprint);
        if self.has_room(&footprint) {
            self.make_room(&footprint);
            if let Some(picture) = picture {
                self.draw(surface, camera, pose, (picture, &footprint));
            }
        }
        Ok(())
    }

    /// False if the canvas would become too large: a pose is far from all others.
    fn has_room(&self, footprint: &Footprint) -> bool {
        let [start_m, end_m] = match self.canvas.rows {
            0 => [footprint.h_min_m, footprint.h_max_m],
            _ => self.canvas.chainage_m(),
        };
        let length_m = footprint.h_max_m.max(end_m) - footprint.h_min_m.min(start_m);
        let rows = length_m * self.canvas.px_per_metre;
        rows * f64::from(self.canvas.columns) <= MAX_PIXELS
    }

    /// Adds rows at either end for what a frame sees.
    fn make_room(&mut self, footprint: &Footprint) {
        let canvas = &mut self.canvas;
        if canvas.rows == 0 {
            canvas.h_start_m = footprint.h_min_m;
        }
        let [start_m, end_m] = canvas.chainage_m();
        let rows = |length_m: f64| (length_m.max(0.0) * canvas.px_per_metre).ceil() as usize;
        let (before, after) = (
            rows(start_m - footprint.h_min_m),
            rows(footprint.h_max_m - end_m),
        );
        let columns = canvas.columns as usize;
        canvas.h_start_m -= before as f64 / canvas.px_per_metre;
        canvas.rows += (before + after) as u32;
        let empty = std::iter::repeat_n([0.0; 2], before * columns);
        self.sums.splice(0..0, empty);
        self.sums
            .resize(self.sums.len() + after * columns, [0.0; 2]);
    }

    /// Draws a picture where its frame sees the wall.
    fn draw(
        &mut self,
        surface: &dyn Surface,
        camera: &Camera,
        pose: &Pose,
        (picture, footprint): (&GreyImage, &Footprint),
    ) {
        let canvas = self.canvas;
        let columns = canvas.columns as usize;
        let row = |h_m: f64| ((h_m - canvas.h_start_m) * canvas.px_per_metre).max(0.0) as usize;
        let rows = row(footprint.h_min_m)..(row(footprint.h_max_m) + 1).min(canvas.rows as usize);
        let column = |s_m: f64| (s_m * canvas.px_per_metre).floor() as i64;
        let (left, right) = (column(footprint.s_min_m), column(footprint.s_max_m));
        let width = (right - left + 1).clamp(0, columns as i64);
        let grey = |column: usize, row: usize| {
            let point = surface.frame(canvas.wall(column as u32, row as u32));
            let x_c = pose.to_camera(&point.x_w);
            let is_near = x_c.norm() <= camera.max_range_m;
            let pixel = camera.project(&x_c).filter(|_| is_near)?;
            let [u, v] = [pixel.x.round(), pixel.y.round()].map(|x| x.max(0.0) as usize);
            let is_inside = camera.is_in_image(&pixel, 0.0);
            (is_inside && u < picture.width() && v < picture.height()).then(|| picture.at(u, v))
        };
        let drawn = self.sums[rows.start * columns..rows.end * columns].par_chunks_mut(columns);
        drawn.enumerate().for_each(|(k, sums)| {
            for column in left..left + width {
                let column = column.rem_euclid(columns as i64) as usize;
                if let Some(grey) = grey(column, rows.start + k).filter(|grey| !grey.is_nan()) {
                    sums[column][0] += grey;
                    sums[column][1] += 1.0;
                }
            }
        });
    }

    /// The picture with its axes, chainage to the right, as [`Preview::picture`]; None as long as
    /// nothing is drawn.
    ///
    /// # Errors
    /// None that is known: drawing into memory.
    pub fn picture(&self, surface: &dyn Surface) -> Result<Option<RgbImage>, RenderError> {
        if self.canvas.rows == 0 {
            return Ok(None);
        }
        let pixel = |[sum, count]: &[f32; 2]| match *count {
            0.0 => [0, 0],
            count => [(sum / count).round() as u8, u8::MAX],
        };
        let mut preview = Preview::new(&self.canvas);
        preview.put(&self.canvas, &self.band(self.sums.iter().map(pixel)))?;
        Ok(Some(preview.picture(surface, Layout::ChainageRight, 0.0)))
    }

    /// Wall that no frame has shown although the camera is past it, from the first chainage to the
    /// last.
    ///
    /// # Errors
    /// None that is known: counting in memory.
    pub fn gaps(&self, surface: &dyn Surface) -> Result<Vec<Gap>, RenderError> {
        let passed_m = passed_m(&self.footprints, surface.perimeter_m());
        let (Some([from_m, to_m]), true) = (passed_m, self.canvas.rows > 0) else {
            return Ok(Vec::new());
        };
        let columns = self.canvas.columns as usize;
        let is_shown = |(k, [_, count]): (usize, &[f32; 2])| {
            let h_m = self.canvas.wall(0, (k / columns) as u32).h_m;
            let is_passed = (from_m..to_m).contains(&h_m);
            [
                0,
                if is_passed && *count == 0.0 {
                    0
                } else {
                    u8::MAX
                },
            ]
        };
        let mut coverage = Coverage::new(&self.canvas);
        let band = self.band(self.sums.iter().enumerate().map(is_shown));
        coverage.put(&self.canvas, &band)?;
        let smallest_m2 = MIN_GAP_PX / self.canvas.px_per_metre.powi(2);
        let gaps = coverage.gaps(surface).into_iter();
        Ok(gaps.filter(|gap| gap.area_m2 >= smallest_m2).collect())
    }

    /// The whole canvas as a band of grey with alpha.
    fn band(&self, pixels: impl Iterator<Item = [u8; 2]>) -> Band {
        Band {
            rows: self.canvas.rows,
            samples: Samples::Eight(pixels.flatten().collect()),
            ..Band::empty(&self.canvas, GREY, false)
        }
    }
}

/// The chainage, from and to, that a camera is past for good and that it has looked at all around,
/// if it turns: from where its first turn has ended to where its last one begins. One that does not
/// turn is past what lies behind its last frame, once it has left its first.
fn passed_m(footprints: &[Footprint], perimeter_m: f64) -> Option<[f64; 2]> {
    let (first, last) = (footprints.first()?, footprints.last()?);
    let is_backward = last.middle().h_m < first.middle().h_m;
    let ends = |footprint: &Footprint| match is_backward {
        false => [footprint.h_min_m, footprint.h_max_m],
        true => [-footprint.h_max_m, -footprint.h_min_m],
    };
    let near = |footprint: &Footprint| ends(footprint)[0];
    let beginning = turn_of(footprints.iter(), perimeter_m);
    let end = turn_of(footprints.iter().rev(), perimeter_m);
    let [from, to] = match beginning.zip(end) {
        Some((beginning, end)) => [
            footprints[..beginning]
                .iter()
                .map(near)
                .fold(f64::NEG_INFINITY, f64::max),
            (footprints[footprints.len() - end..].iter().map(near)).fold(f64::INFINITY, f64::min),
        ],
        None if near(last) > ends(first)[1] => [near(first), near(last)],
        None => return None,
    };
    let range = if is_backward {
        [-to, -from]
    } else {
        [from, to]
    };
    (range[0] < range[1]).then_some(range)
}

/// Number of frames in a sequence from the first on until the camera has turned around once; None
/// if it does not.
fn turn_of<'a>(
    footprints: impl Iterator<Item = &'a Footprint> + Clone,
    perimeter_m: f64,
) -> Option<usize> {
    let pairs = footprints.clone().zip(footprints.skip(1));
    let mut turned_m = 0.0;
    for (k, (a, b)) in pairs.enumerate() {
        turned_m += shortest_arc(b.middle().s_m - a.middle().s_m, perimeter_m);
        if turned_m.abs() >= perimeter_m {
            return Some(k + 2);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;
    use tunnelstitch_geometry::surface::Circle;
    use tunnelstitch_geometry::trajectory::spiral;

    /// A wall that some frames of a spiral show, twelve a turn.
    fn wall(frames: usize, shows: impl Fn(usize) -> bool, is_backward: bool) -> (Circle, LiveWall) {
        let circle = Circle::new(1.0).unwrap();
        let camera = Camera::from_vertical_fov(80, 60, 60f64.to_radians());
        let picture = GreyImage::new(80, 60, vec![100.0; 80 * 60]);
        let mut wall = LiveWall::new(&circle, 30.0);
        let mut poses = spiral(frames, 0.03, TAU / 12.0);
        if is_backward {
            poses.reverse();
        }
        for (k, pose) in poses.iter().enumerate() {
            let shown = shows(k).then_some(&picture);
            wall.add(&circle, &camera, pose, shown).unwrap();
        }
        (circle, wall)
    }

    #[test]
    fn the_wall_between_the_first_and_the_last_turn_has_no_gap() {
        for is_backward in [false, true] {
            let (circle, wall) = wall(60, |_| true, is_backward);
            assert_eq!(wall.gaps(&circle).unwrap(), []);
            let picture = wall.picture(&circle).unwrap().unwrap();
            assert!(picture.pixels().any(|pixel| pixel.0 == [100; 3]));
        }
    }

    /// Three turns without pictures on one side.
    #[test]
    fn a_side_that_nothing_shows_is_a_gap() {
        for is_backward in [false, true] {
            let hidden = |k: usize| (12..48).contains(&k) && k % 12 < 5;
            let (circle, wall) = wall(60, |k| !hidden(k), is_backward);
            let gaps = wall.gaps(&circle).unwrap();
            assert_eq!(gaps.len(), 1, "{gaps:?}");
            let width_deg = gaps[0].angle_to_deg - gaps[0].angle_from_deg;
            assert!((40.0..150.0).contains(&width_deg), "{gaps:?}");
        }
    }

    /// Frames from the fourth turn on show nothing, which the camera is past only later.
    #[test]
    fn what_is_not_passed_yet_is_no_gap() {
        let (circle, five_turns) = wall(60, |k| k < 36, false);
        assert_eq!(five_turns.gaps(&circle).unwrap(), []);
        let (circle, ten_turns) = wall(120, |k| k < 36, false);
        let gaps = ten_turns.gaps(&circle).unwrap();
        assert_eq!(gaps.len(), 1, "{gaps:?}");
        let (from_m, to_m) = (gaps[0].chainage_from_m, gaps[0].chainage_to_m);
        assert!(
            from_m > 1.0 && to_m > 2.0 && to_m < 108.0 * 0.03,
            "{gaps:?}"
        );
        assert_eq!(gaps[0].angle_to_deg - gaps[0].angle_from_deg, 360.0);
    }

    #[test]
    fn there_is_no_picture_of_nothing() {
        let circle = Circle::new(1.0).unwrap();
        let nothing = LiveWall::new(&circle, 30.0);
        assert!(nothing.picture(&circle).unwrap().is_none());
        assert_eq!(nothing.gaps(&circle).unwrap(), []);
    }
}
