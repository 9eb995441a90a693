//! Blocks of one level of the panorama's pyramid, with a border of their neighbours' pixels.
//!
//! A renderer interpolates between pixels. Without a border, a line would be visible where two
//! textures meet. Around the section the border continues on the other side.

use crate::raster::{RasterTile, TILE_EDGE_PX};
use rayon::prelude::*;

/// Width of the border, pixels: mipmaps down to an eighth still have one.
pub(super) const BORDER: usize = 8;

/// Texture of a rectangle of a level and [`BORDER`] pixels around it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct TextureBlock {
    /// Column among the level's blocks.
    pub(super) column: u32,
    /// Row among the level's blocks.
    pub(super) row: u32,
    /// First column and row of the level, border not counted.
    pub(super) corner: [usize; 2],
    /// Columns and rows, border not counted.
    pub(super) size: [usize; 2],
    /// All pixels, including the border, without alpha.
    pub(super) pixels: Vec<u8>,
}

impl TextureBlock {
    /// Columns and rows of the texture, including the border.
    pub(super) fn texture_size(&self) -> [usize; 2] {
        self.size.map(|side| side + 2 * BORDER)
    }
}

/// Buffer of a level's rows, from the first that a block still needs to the last that was added.
#[derive(Debug)]
pub(super) struct LevelStrip {
    width: usize,
    height: usize,
    /// Bytes of a pixel; the last is alpha.
    pixel_bytes: usize,
    /// Columns and rows of a block: a multiple of [`TILE_EDGE_PX`].
    block: usize,
    /// First row of `pixels`.
    first: usize,
    pixels: Vec<u8>,
    /// The next row of blocks.
    next: usize,
}

impl LevelStrip {
    /// A strip of a level of `width` × `height` pixels with blocks of `tiles` × `tiles` tiles.
    pub(super) fn new([width, height]: [u32; 2], pixel_bytes: usize, tiles: usize) -> Self {
        Self {
            width: width as usize,
            height: height as usize,
            pixel_bytes,
            block: tiles * TILE_EDGE_PX,
            first: 0,
            pixels: Vec::new(),
            next: 0,
        }
    }

    /// Maximum memory of the strip, bytes.
    pub(super) fn max_bytes(&self) -> u64 {
        let rows = (self.block + TILE_EDGE_PX + 2 * BORDER).min(self.height);
        (rows * self.width * self.pixel_bytes) as u64
    }

    /// Adds whole rows of tiles and returns the blocks that they complete.
    pub(super) fn add(&mut self, tiles: &[&RasterTile]) -> Vec<TextureBlock> {
        let stride = self.width * self.pixel_bytes;
        let mut arrived = self.first + self.pixels.len() / stride;
        for tile in tiles {
            let (row, column) = (
                tile.row as usize * TILE_EDGE_PX,
                tile.column as usize * TILE_EDGE_PX,
            );
            let rows = TILE_EDGE_PX.min(self.height - row);
            arrived = arrived.max(row + rows);
            self.pixels.resize((arrived - self.first) * stride, 0);
            let bytes = TILE_EDGE_PX.min(self.width - column) * self.pixel_bytes;
            let begin = (row - self.first) * stride + column * self.pixel_bytes;
            for (to, from) in self.pixels[begin..]
                .chunks_mut(stride)
                .zip(tile.pixels.chunks_exact(TILE_EDGE_PX * self.pixel_bytes))
                .take(rows)
            {
                to[..bytes].copy_from_slice(&from[..bytes]);
            }
        }
        let mut blocks = Vec::new();
        while self.next * self.block < self.height {
            let end = (self.next + 1) * self.block;
            if arrived < (end + BORDER).min(self.height) {
                break;
            }
            let columns = self.width.div_ceil(self.block);
            blocks.par_extend((0..columns).into_par_iter().map(|column| self.cut(column)));
            self.next += 1;
            let keep = (end - BORDER).min(self.height);
            self.pixels.drain(..(keep - self.first) * stride);
            self.first = keep;
        }
        blocks
    }

    /// Cuts the block in a column of the next row.
    fn cut(&self, column: usize) -> TextureBlock {
        let corner = [column, self.next].map(|place| place * self.block);
        let size = [
            self.block.min(self.width - corner[0]),
            self.block.min(self.height - corner[1]),
        ];
        let channels = self.pixel_bytes - 1;
        let [columns, rows] = size.map(|side| side + 2 * BORDER);
        let mut pixels = Vec::with_capacity(columns * rows * channels);
        for row in 0..rows {
            let row = (corner[1] + row)
                .saturating_sub(BORDER)
                .min(self.height - 1);
            let line = &self.pixels[(row - self.first) * self.width * self.pixel_bytes..];
            for column in 0..columns {
                // Whole turns are added to keep the column non-negative.
                let around = BORDER.div_ceil(self.width) * self.width;
                let column = (corner[0] + column + around - BORDER) % self.width;
                pixels.extend_from_slice(&line[column * self.pixel_bytes..][..channels]);
            }
        }
        TextureBlock {
            column: column as u32,
            row: self.next as u32,
            corner,
            size,
            pixels,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 700;
    const HEIGHT: usize = 1300;

    fn value(column: usize, row: usize) -> u8 {
        (column * 7 + row * 13) as u8
    }

    fn tile(column: u32, row: u32) -> RasterTile {
        let mut pixels = vec![0; TILE_EDGE_PX * TILE_EDGE_PX * 2];
        for (k, pixel) in pixels.chunks_exact_mut(2).enumerate() {
            let x = column as usize * TILE_EDGE_PX + k % TILE_EDGE_PX;
            let y = row as usize * TILE_EDGE_PX + k / TILE_EDGE_PX;
            if x < WIDTH && y < HEIGHT {
                pixel.copy_from_slice(&[value(x, y), 255]);
            }
        }
        RasterTile {
            column,
            row,
            pixels,
        }
    }

    fn blocks(tiles: usize) -> Vec<TextureBlock> {
        let mut strip = LevelStrip::new([WIDTH as u32, HEIGHT as u32], 2, tiles);
        let mut blocks = Vec::new();
        for row in 0..3 {
            let row: Vec<RasterTile> = (0..2).map(|column| tile(column, row)).collect();
            blocks.extend(strip.add(&row.iter().collect::<Vec<_>>()));
            assert!(strip.pixels.len() as u64 <= strip.max_bytes());
        }
        blocks
    }

    #[test]
    fn every_pixel_is_that_of_the_level_and_the_border_wraps() {
        for tiles in [1, 2, 7] {
            let blocks = blocks(tiles);
            let edge = tiles * TILE_EDGE_PX;
            assert_eq!(blocks.len(), WIDTH.div_ceil(edge) * HEIGHT.div_ceil(edge));
            for block in &blocks {
                let [columns, rows] = block.texture_size();
                assert_eq!(block.pixels.len(), columns * rows);
                for (k, pixel) in block.pixels.iter().enumerate() {
                    let column = block.corner[0] + WIDTH + k % columns - BORDER;
                    let row = (block.corner[1] + k / columns).saturating_sub(BORDER);
                    assert_eq!(*pixel, value(column % WIDTH, row.min(HEIGHT - 1)));
                }
            }
        }
    }
}
