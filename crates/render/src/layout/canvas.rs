//! Grid of the panorama on the unrolled wall.

use super::placement::Placement;
use crate::error::RenderError;
use image::DynamicImage;
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::surface::{Footprint, Surface, WallPoint};
use tunnelstitch_super_resolve::FineGrid;

/// Orientation of the panorama in its picture file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layout {
    /// θ to the right from 0 to 2π, chainage down: the wall as seen from inside, not mirrored.
    #[default]
    ThetaRight,
    /// [`Layout::ThetaRight`] turned by 90° counter-clockwise: chainage to the right, θ up. (A
    /// transpose would mirror all writing on the wall.)
    ChainageRight,
}

impl Layout {
    /// Turns a picture from [`Layout::ThetaRight`] into this layout.
    pub fn turn(self, image: DynamicImage) -> DynamicImage {
        match self {
            Self::ThetaRight => image,
            // 270° clockwise.
            Self::ChainageRight => image.rotate270(),
        }
    }

    /// Position in the picture, x and y, of a column and row of a canvas (integers are pixels'
    /// centres).
    pub fn to_picture(self, canvas: &Canvas, [column, row]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::ThetaRight => [column, row],
            Self::ChainageRight => [row, f64::from(canvas.columns) - 1.0 - column],
        }
    }

    /// Column and row of a canvas at a position in the picture: the inverse of
    /// [`Layout::to_picture`].
    pub fn from_picture(self, canvas: &Canvas, [x, y]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::ThetaRight => [x, y],
            Self::ChainageRight => [f64::from(canvas.columns) - 1.0 - y, x],
        }
    }

    /// True if the picture has a pixel there.
    pub fn holds(self, canvas: &Canvas, [x, y]: [f64; 2]) -> bool {
        let [width, height] = self.size(canvas).map(f64::from);
        (-0.5..width - 0.5).contains(&x) && (-0.5..height - 0.5).contains(&y)
    }

    /// Width and height of the picture, pixels.
    pub fn size(self, canvas: &Canvas) -> [u32; 2] {
        match self {
            Self::ThetaRight => [canvas.columns, canvas.rows],
            Self::ChainageRight => [canvas.rows, canvas.columns],
        }
    }
}

/// The pixels of a panorama: once around the tunnel, and along it as far as the frames see.
///
/// Column `j` and row `i` (from 0) have their centre at `s = (j + ½)/ppm`,
/// `h = h_start + (i + ½)/ppm`. The perimeter is a whole number of columns, so the last column
/// meets the first.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Canvas {
    /// Columns around the section.
    pub columns: u32,
    /// Rows along the axis.
    pub rows: u32,
    /// Resolution, pixels per metre in both directions.
    pub px_per_metre: f64,
    /// Chainage of the upper edge of the first row, metres.
    pub h_start_m: f64,
}

/// Largest number of pixels of a panorama: beyond it, units or poses are wrong.
const MAX_PIXELS: f64 = 1e12;
/// Largest side of a panorama, pixels.
const MAX_SIDE_PX: f64 = i32::MAX as f64;

impl Canvas {
    /// Lays out the canvas that holds every footprint at about `px_per_metre`: the resolution is
    /// changed by less than half a column over the whole perimeter, so that the perimeter is a
    /// whole number of columns.
    ///
    /// # Errors
    /// [`RenderError::Resolution`], [`RenderError::TooManyPixels`], [`RenderError::Count`] without
    /// any frame.
    pub fn covering<'a>(
        surface: &dyn Surface,
        footprints: impl IntoIterator<Item = &'a Footprint>,
        px_per_metre: f64,
    ) -> Result<Self, RenderError> {
        if !(px_per_metre.is_finite() && px_per_metre > 0.0) {
            return Err(RenderError::Resolution { px_per_metre });
        }
        let (mut h_min, mut h_max) = (f64::INFINITY, f64::NEG_INFINITY);
        let (mut widest, mut span_m, mut count) = (0, 0.0, 0);
        for (frame, footprint) in footprints.into_iter().enumerate() {
            h_min = h_min.min(footprint.h_min_m);
            h_max = h_max.max(footprint.h_max_m);
            let span = footprint.h_max_m - footprint.h_min_m;
            if span > span_m {
                (widest, span_m) = (frame, span);
            }
            count += 1;
        }
        if count == 0 {
            return Err(RenderError::Count {
                poses: 0,
                frames: 0,
            });
        }
        let perimeter_m = surface.perimeter_m();
        let columns = (perimeter_m * px_per_metre).round().max(1.0);
        let px_per_metre = columns / perimeter_m;
        // A row that would hold less than a thousandth of a pixel is rounding noise.
        let rows = ((h_max - h_min) * px_per_metre - 1e-3).ceil().max(1.0);
        if columns * rows > MAX_PIXELS || columns.max(rows) > MAX_SIDE_PX {
            return Err(RenderError::TooManyPixels {
                columns,
                rows,
                limit_px: MAX_PIXELS,
                perimeter_m,
                chainage_m: h_max - h_min,
                px_per_metre,
                frame: widest,
                span_m,
            });
        }
        Ok(Self {
            columns: columns as u32,
            rows: rows as u32,
            px_per_metre,
            h_start_m: h_min,
        })
    }

    /// Lays out the canvas that holds the footprints of placed frames, as [`Canvas::covering`].
    ///
    /// # Errors
    /// As [`Canvas::covering`].
    pub fn of_placements(
        surface: &dyn Surface,
        placements: &[Placement],
        px_per_metre: f64,
    ) -> Result<Self, RenderError> {
        let footprints = placements.iter().map(|placement| &placement.footprint);
        Self::covering(surface, footprints, px_per_metre)
    }

    /// FineGrid of the pixels, which continues beyond the first row and the last.
    pub fn lattice(&self) -> FineGrid {
        FineGrid {
            columns: i64::from(self.columns),
            spacing_m: [1.0 / self.px_per_metre; 2],
            start_m: [0.0, self.h_start_m],
        }
    }

    /// The wall point at the centre of a pixel.
    pub fn wall(&self, column: u32, row: u32) -> WallPoint {
        self.wall_at([f64::from(column), f64::from(row)])
    }

    /// The wall point at column and row (integers are pixels' centres).
    pub fn wall_at(&self, [column, row]: [f64; 2]) -> WallPoint {
        WallPoint {
            s_m: (column + 0.5) / self.px_per_metre,
            h_m: self.h_start_m + (row + 0.5) / self.px_per_metre,
        }
    }

    /// Column and row of a wall point, the inverse of [`Canvas::wall_at`] for columns from −½ to
    /// all less ½.
    pub fn pixel_of(&self, wall: WallPoint) -> [f64; 2] {
        let around_m = f64::from(self.columns) / self.px_per_metre;
        [
            wall.s_m.rem_euclid(around_m) * self.px_per_metre - 0.5,
            (wall.h_m - self.h_start_m) * self.px_per_metre - 0.5,
        ]
    }

    /// Chainage of the first row's upper and of the last row's lower edge, metres.
    pub fn chainage_m(&self) -> [f64; 2] {
        let end = self.h_start_m + f64::from(self.rows) / self.px_per_metre;
        [self.h_start_m, end]
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    /// Canvas of the same stretch of wall with at most about `pixels` pixels.
    pub fn coarser(&self, pixels: usize) -> Self {
        let shrink = (self.pixels() as f64 / pixels.max(1) as f64)
            .sqrt()
            .max(1.0);
        self.with_columns((f64::from(self.columns) / shrink).round().max(1.0))
    }

    /// Canvas of the same stretch of wall with pixels about `step` times as large: a multiple of
    /// `multiple` columns.
    pub fn grid(&self, step: f64, multiple: u32) -> Self {
        let columns = f64::from(self.columns) / step / f64::from(multiple);
        self.with_columns(columns.round().max(1.0) * f64::from(multiple))
    }

    fn with_columns(&self, columns: f64) -> Self {
        let perimeter_m = f64::from(self.columns) / self.px_per_metre;
        let px_per_metre = columns / perimeter_m;
        let rows = f64::from(self.rows) / self.px_per_metre * px_per_metre;
        Self {
            columns: columns as u32,
            rows: rows.round().max(1.0) as u32,
            px_per_metre,
            h_start_m: self.h_start_m,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::surface::Circle;

    fn footprint(h_min_m: f64, h_max_m: f64) -> Footprint {
        Footprint {
            s_min_m: 0.0,
            s_max_m: 1.0,
            h_min_m,
            h_max_m,
        }
    }

    #[test]
    fn the_perimeter_is_a_whole_number_of_columns() {
        let circle = Circle::new(3.0).unwrap();
        let footprints = [footprint(-1.5, 2.0), footprint(0.0, 3.5)];
        let canvas = Canvas::covering(&circle, &footprints, 100.0).unwrap();
        assert_eq!(canvas.columns, 1885);
        let around = f64::from(canvas.columns) / canvas.px_per_metre;
        assert!((around - circle.perimeter_m()).abs() < 1e-12);
        let [start, end] = canvas.chainage_m();
        assert_eq!(start, -1.5);
        assert!((3.5..3.5 + 1.0 / canvas.px_per_metre).contains(&end));
        // The first and the last column are one pixel apart across θ = 0.
        let gap = canvas.wall(0, 0).s_m - (canvas.wall(1884, 0).s_m - circle.perimeter_m());
        assert!((gap * canvas.px_per_metre - 1.0).abs() < 1e-9);
    }

    #[test]
    fn picture_and_wall_go_back_and_forth_in_either_layout() {
        let circle = Circle::new(3.0).unwrap();
        let canvas = Canvas::covering(&circle, &[footprint(-1.5, 2.0)], 20.0).unwrap();
        let (column, row) = (310.25, 12.5);
        let [again_column, again_row] = canvas.pixel_of(canvas.wall_at([column, row]));
        assert!((again_column - column).abs() < 1e-9 && (again_row - row).abs() < 1e-9);
        // A mark in the picture, turned as the picture is.
        let mut image = image::GrayImage::new(canvas.columns, canvas.rows);
        image.put_pixel(300, 7, image::Luma([200]));
        for layout in [Layout::ThetaRight, Layout::ChainageRight] {
            let turned = layout.turn(DynamicImage::from(image.clone())).to_luma8();
            assert_eq!([turned.width(), turned.height()], layout.size(&canvas));
            let [x, y] = layout.to_picture(&canvas, [300.0, 7.0]);
            assert_eq!(turned.get_pixel(x as u32, y as u32).0, [200]);
            assert_eq!(layout.from_picture(&canvas, [x, y]), [300.0, 7.0]);
            let [width, height] = layout.size(&canvas).map(f64::from);
            assert!(layout.holds(&canvas, [-0.5, height - 0.6]));
            assert!(!layout.holds(&canvas, [width - 0.5, 3.0]));
        }
    }

    #[test]
    fn absurd_sizes_are_refused_with_the_size_and_the_remedy() {
        let circle = Circle::new(3000.0).unwrap();
        let error = Canvas::covering(&circle, &[footprint(0.0, 4000.0)], 150.0).unwrap_err();
        let message = error.to_string();
        for part in ["2827433 × 600000 px", "--px-per-metre", "Frame 0"] {
            assert!(message.contains(part), "{message}");
        }
        assert!(matches!(
            Canvas::covering(&circle, &[footprint(0.0, 1.0)], -1.0),
            Err(RenderError::Resolution { .. })
        ));
        assert!(Canvas::covering(&circle, &[], 10.0).is_err());
    }
}
