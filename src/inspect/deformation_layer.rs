//! Layer of the page that shows the deformation of the wall: colours over the panorama.

use super::tiles_target::TilesTarget;
use crate::evaluate::deformation::DeviationMap;
use crate::render::{Band, Canvas, PixelFormat, RenderError, Samples, Target};
use tunnelstitch_core::colour_map::Palette;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Name of the layer and of its folder.
pub const DEFORMATION_LAYER: &str = "deformation";

/// Format of the layer's textures.
pub(super) const FORMAT: PixelFormat = PixelFormat {
    channels: 3,
    deep: false,
};

/// Brightness of a colour over a black wall; that over a white one is 1.
const DARKEST: f32 = 0.45;

/// Target that paints the deviation over the panorama and hands the bands on.
pub(super) struct DeformationPaint<'a> {
    /// Tiles of the layer, of the format [`FORMAT`].
    pub(super) tiles: TilesTarget<'a>,
    map: &'a DeviationMap,
    size_mm: f64,
}

impl<'a> DeformationPaint<'a> {
    /// Paints a map with colours for deviations up to `size_mm` either way.
    pub(super) fn new(tiles: TilesTarget<'a>, map: &'a DeviationMap, size_mm: f64) -> Self {
        Self {
            tiles,
            map,
            size_mm,
        }
    }
}

impl DeformationPaint<'_> {
    /// Red, green, blue and alpha of a pixel of the given brightness (0 to 1).
    fn colour(&self, deviation_mm: f32, brightness: f32, alpha: u8) -> [u8; 4] {
        let light = DARKEST + (1.0 - DARKEST) * brightness;
        let share = 0.5 + 0.5 * f64::from(deviation_mm) / self.size_mm;
        let colour = if deviation_mm.is_finite() {
            Palette::BlueRed.colour(share).map(f32::from)
        } else {
            // Not determined: the wall in grey.
            [255.0 * brightness / light; 3]
        };
        let [red, green, blue] = colour.map(|value| (value * light).round().min(255.0) as u8);
        [red, green, blue, alpha]
    }

    /// A row of a band, painted.
    fn row(&self, canvas: &Canvas, band: &Band, row: usize) -> Vec<u8> {
        let step = band.format.channels + 1;
        let pixels = canvas.columns as usize;
        let value = |k: usize| match &band.samples {
            Samples::Eight(samples) => f32::from(samples[k]),
            Samples::Sixteen(samples) => f32::from(samples[k]),
        };
        let colour = |column: usize| {
            let first = (row * pixels + column) * step;
            let mut colours = [0.0; 4];
            for (channel, colour) in colours.iter_mut().enumerate().take(band.format.channels) {
                *colour = value(first + channel);
            }
            let brightness = band.format.grey(colours) / 255.0;
            let alpha = 255.0 * value(first + step - 1) / band.format.white();
            let wall = canvas.wall(column as u32, band.row + row as u32);
            self.colour(self.map.at_mm(wall)[0], brightness, alpha.round() as u8)
        };
        (0..pixels).flat_map(colour).collect()
    }
}

impl Target for DeformationPaint<'_> {
    fn put(&mut self, canvas: &Canvas, band: &Band) -> Result<(), RenderError> {
        let rows = (0..band.rows as usize).par_map(|row| self.row(canvas, band, row));
        let mut painted = band.clone();
        painted.format = FORMAT;
        painted.samples = Samples::Eight(rows.concat());
        self.tiles.put(canvas, &painted)
    }
}
