//! Wall that no frame sees.

use crate::compositing::band::{Band, Target};
use crate::error::RenderError;
use crate::layout::canvas::Canvas;
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::surface::Surface;

/// Edge of a cell, canvas pixels, unless there would be too many cells.
const CELL_EDGE_PX: u32 = 8;
/// Largest number of cells. A higher value finds smaller gaps in long panoramas and needs more
/// memory.
const MAX_CELLS: u64 = 8 << 20;

/// A connected part of the wall that no frame shows, in a box.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Gap {
    /// From, metres.
    pub chainage_from_m: f64,
    /// To, metres.
    pub chainage_to_m: f64,
    /// From, degrees of θ as seen from the axis, below 360.
    pub angle_from_deg: f64,
    /// To; beyond 360 across θ = 0, and 360 more than the beginning all around.
    pub angle_to_deg: f64,
    /// Area of the gap, square metres.
    pub area_m2: f64,
    /// True if it reaches the panorama's first or last row, beyond which no frame was expected.
    pub at_the_end: bool,
}

/// Edge of a canvas' cells, pixels.
fn cell(canvas: &Canvas) -> u32 {
    let mut cell = CELL_EDGE_PX;
    while cells(canvas, cell) > MAX_CELLS {
        cell *= 2;
    }
    cell
}

/// Number of cells with the given edge.
fn cells(canvas: &Canvas, cell: u32) -> u64 {
    u64::from(canvas.columns.div_ceil(cell)) * u64::from(canvas.rows.div_ceil(cell))
}

/// Coverage of the canvas, counted in cells.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Coverage {
    canvas: Canvas,
    cell: u32,
    columns: usize,
    rows: usize,
    /// Pixels of each cell that no frame shows.
    holes: Vec<u32>,
    covered: u64,
}

impl Coverage {
    /// Makes a coverage of which nothing has been seen yet.
    pub fn new(canvas: &Canvas) -> Self {
        let cell = cell(canvas);
        let (columns, rows) = (canvas.columns.div_ceil(cell), canvas.rows.div_ceil(cell));
        Self {
            canvas: *canvas,
            cell,
            columns: columns as usize,
            rows: rows as usize,
            holes: vec![0; columns as usize * rows as usize],
            covered: 0,
        }
    }

    /// Memory for a canvas, bytes: the cells, a visited flag each, and a queue of all of them.
    pub fn bytes(canvas: &Canvas) -> u64 {
        21 * cells(canvas, cell(canvas))
    }

    /// Adds what another one of the same canvas has seen.
    pub fn absorb(&mut self, part: &Self) {
        for (own, part) in self.holes.iter_mut().zip(&part.holes) {
            *own += part;
        }
        self.covered += part.covered;
    }

    /// Share of the canvas that some frame sees, 0–1.
    pub fn share(&self) -> f64 {
        self.covered as f64 / self.canvas.pixels() as f64
    }

    /// Finds the gaps, from the first chainage to the last.
    pub fn gaps(&self, surface: &dyn Surface) -> Vec<Gap> {
        let mut seen = vec![false; self.holes.len()];
        let mut gaps = Vec::new();
        for start in 0..self.holes.len() {
            if self.holes[start] > 0 && !seen[start] {
                gaps.push(self.gap(surface, start, &mut seen));
            }
        }
        gaps
    }

    /// Finds the gap of the cells with holes that are connected with `start`.
    fn gap(&self, surface: &dyn Surface, start: usize, seen: &mut [bool]) -> Gap {
        let around = self.columns as i64;
        // Columns are counted on across θ = 0.
        let mut open = vec![(start, (start % self.columns) as i64)];
        seen[start] = true;
        let (mut left, mut right) = (open[0].1, open[0].1);
        let (mut top, mut bottom, mut pixels) = (start / self.columns, start / self.columns, 0u64);
        while let Some((cell, column)) = open.pop() {
            let row = cell / self.columns;
            (left, right) = (left.min(column), right.max(column));
            (top, bottom) = (top.min(row), bottom.max(row));
            pixels += u64::from(self.holes[cell]);
            let beside = [(0, -1i64), (0, 1), (-1, 0), (1, 0)];
            for (down, across) in beside {
                let Some(row) = row.checked_add_signed(down).filter(|row| *row < self.rows) else {
                    continue;
                };
                let next = column + across;
                let cell = row * self.columns + next.rem_euclid(around) as usize;
                if self.holes[cell] > 0 && !seen[cell] {
                    seen[cell] = true;
                    open.push((cell, next));
                }
            }
        }
        let ppm = self.canvas.px_per_metre;
        let cell_m = f64::from(self.cell) / ppm;
        let [start_m, end_m] = self.canvas.chainage_m();
        let whole = right - left + 1 >= around;
        // The last cell may be narrower than the others.
        let degrees = |edge: i64| {
            let pixels = (edge.rem_euclid(around) * i64::from(self.cell)) as f64;
            let s_m = surface.perimeter_m() * pixels / f64::from(self.canvas.columns);
            360.0 * edge.div_euclid(around) as f64 + surface.angle_rad(s_m).to_degrees()
        };
        let turns = 360.0 * left.div_euclid(around) as f64;
        let (from, to) = (degrees(left) - turns, degrees(right + 1) - turns);
        Gap {
            chainage_from_m: start_m + top as f64 * cell_m,
            chainage_to_m: (start_m + (bottom + 1) as f64 * cell_m).min(end_m),
            angle_from_deg: if whole { 0.0 } else { from },
            angle_to_deg: if whole { 360.0 } else { to },
            area_m2: pixels as f64 / (ppm * ppm),
            at_the_end: top == 0 || bottom + 1 == self.rows,
        }
    }
}

impl Target for Coverage {
    fn put(&mut self, canvas: &Canvas, band: &Band) -> Result<(), RenderError> {
        let covered = band.covered();
        let width = canvas.columns as usize;
        for (row, pixels) in covered.chunks_exact(width).enumerate() {
            let row = (band.row as usize + row) / self.cell as usize * self.columns;
            let cells = self.holes[row..].iter_mut();
            for (holes, pixels) in cells.zip(pixels.chunks(self.cell as usize)) {
                let covered: u32 = pixels.iter().map(|covered| u32::from(*covered)).sum();
                *holes += pixels.len() as u32 - covered;
                self.covered += u64::from(covered);
            }
        }
        Ok(())
    }
}

/// Formats gaps as CSV, one a line.
pub fn gaps_csv(gaps: &[Gap]) -> String {
    let mut text =
        "chainage_from_m,chainage_to_m,angle_from_deg,angle_to_deg,area_m2,at_the_end\n".to_owned();
    for gap in gaps {
        text += &format!(
            "{:.4},{:.4},{:.3},{:.3},{:.6},{}\n",
            gap.chainage_from_m,
            gap.chainage_to_m,
            gap.angle_from_deg,
            gap.angle_to_deg,
            gap.area_m2,
            gap.at_the_end
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::pixel_format::PixelFormat;
    use crate::sampling::sample::Samples;
    use tunnelstitch_geometry::surface::Circle;

    const CANVAS: Canvas = Canvas {
        columns: 80,
        rows: 64,
        px_per_metre: 10.0,
        h_start_m: 5.0,
    };

    fn coverage(hole: impl Fn(usize, usize) -> bool) -> Coverage {
        let format = PixelFormat {
            channels: 1,
            deep: false,
        };
        let mut coverage = Coverage::new(&CANVAS);
        for row in [0, 32] {
            let mut band = Band::empty(&CANVAS, format, false);
            band.begin(&CANVAS, row, 32);
            let samples = (0..32 * 80).flat_map(|at| {
                let hole = hole(row as usize + at / 80, at % 80);
                [9, if hole { 0 } else { u8::MAX }]
            });
            band.samples = Samples::Eight(samples.collect());
            coverage.put(&CANVAS, &band).unwrap();
        }
        coverage
    }

    #[test]
    fn gaps_are_boxes_around_what_hangs_together() {
        // One across θ = 0, in the middle; one along the last rows, all around.
        let coverage = coverage(|row, column| {
            (16..24).contains(&row) && !(8..72).contains(&column) || row >= 60
        });
        assert!((coverage.share() - 1.0 + (8.0 * 16.0 + 4.0 * 80.0) / 5120.0).abs() < 1e-12);
        let gaps = coverage.gaps(&Circle::new(1.0).unwrap());
        assert_eq!(gaps.len(), 2, "{gaps:?}");
        let close = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(close(gaps[0].chainage_from_m, 6.6) && close(gaps[0].chainage_to_m, 7.4));
        assert!(close(gaps[0].angle_from_deg, 324.0) && close(gaps[0].angle_to_deg, 396.0));
        assert!(close(gaps[0].area_m2, 1.28) && !gaps[0].at_the_end);
        assert!(close(gaps[1].angle_from_deg, 0.0) && close(gaps[1].angle_to_deg, 360.0));
        assert!(close(gaps[1].chainage_to_m, 11.4) && gaps[1].at_the_end);
        assert_eq!(gaps_csv(&gaps).lines().count(), 3);
    }

    #[test]
    fn without_holes_there_are_no_gaps() {
        let coverage = coverage(|_, _| false);
        assert_eq!(
            (
                coverage.share(),
                coverage.gaps(&Circle::new(1.0).unwrap()).len()
            ),
            (1.0, 0)
        );
    }
}
