//! Bands along the tunnel where most frames show something else than the wall: a mirror of water,
//! a walkway, a train of cables.
//!
//! The outlier mask leaves such a band out tile by tile ([`crate::samples::outlier_mask`]). But a
//! mirror shows a wall of its own, behind the surface: frames that see hardly anything else agree
//! about that, tile by tile, and close the section where nothing closes it. So where most of a band
//! is left out, all of it is, before frames are registered.

use crate::thresholds::hidden_bands::{HIDDEN_SHARES, MIN_WIDTH_RAD};
use std::f64::consts::TAU;
use tunnelstitch_core::survey::MaskedWall;
use tunnelstitch_geometry::surface::Surface;

/// Columns around the section, by which bands are found.
const COLUMNS: usize = 72;

/// Finds all bands: angles θ from and to, radians, the second beyond 2π across θ = 0; `known`:
/// those that are left out already. None if hardly more is hidden; and where it is a third of the
/// section or more, for then it is the poses that are wrong.
pub fn find_hidden_bands(
    masked: &MaskedWall,
    surface: &dyn Surface,
    known: &[[f64; 2]],
) -> Option<Vec<[f64; 2]>> {
    let column_m = surface.perimeter_m() / COLUMNS as f64;
    let is_known = |column: usize| {
        let angle = surface.angle_rad((column as f64 + 0.5) * column_m);
        let mut bands = known.iter();
        bands.any(|[from, to]| (angle - from).rem_euclid(TAU) < to - from)
    };
    let mut shares = hidden_shares(masked);
    for (column, share) in shares.iter_mut().enumerate() {
        *share = if is_known(column) { 1.0 } else { *share };
    }
    let hidden = hide_columns(&shares);
    let count = hidden.iter().filter(|hidden| **hidden).count();
    if 3 * count >= COLUMNS {
        return None;
    }
    let bands = runs(&hidden).into_iter().map(|(start, length)| {
        let from = surface.angle_rad(start as f64 * column_m);
        let to = surface.angle_rad(((start + length) % COLUMNS) as f64 * column_m);
        [from, from + (to - from).rem_euclid(TAU)]
    });
    let bands: Vec<[f64; 2]> = bands
        .filter(|[from, to]| to - from >= MIN_WIDTH_RAD)
        .collect();
    let width = |bands: &[[f64; 2]]| bands.iter().map(|[from, to]| to - from).sum::<f64>();
    let column_rad = TAU / COLUMNS as f64;
    (width(&bands) - width(known) > MIN_WIDTH_RAD - 0.5 * column_rad).then_some(bands)
}

/// Share of the tiles of each column that are hidden, of those that are seen.
fn hidden_shares(masked: &MaskedWall) -> Vec<f64> {
    let (mut seen, mut hidden) = ([0usize; COLUMNS], [0usize; COLUMNS]);
    let column_of = |column: i64| {
        (column * COLUMNS as i64 / masked.columns()).clamp(0, COLUMNS as i64 - 1) as usize
    };
    for (_, from, to) in masked.seen() {
        (*from..*to).for_each(|column| seen[column_of(column)] += 1);
    }
    for tile in masked.tiles().iter().filter(|tile| tile.is_hidden()) {
        hidden[column_of(tile.column)] += 1;
    }
    let both = seen.iter().zip(&hidden);
    both.map(|(seen, hidden)| *hidden as f64 / (*seen).max(1) as f64)
        .collect()
}

/// Hides the columns of which most is hidden, and those beside them of which more is than of the
/// rest of the section (hysteresis): at the edge of a band, and where a mirror shows the same to
/// all. Together, half of them must be.
///
/// Source: J. Canny, "A computational approach to edge detection", IEEE Transactions on Pattern
/// Analysis and Machine Intelligence 8(6), 1986.
fn hide_columns(shares: &[f64]) -> Vec<bool> {
    let [edge, core] = HIDDEN_SHARES;
    let is_touched: Vec<bool> = shares.iter().map(|share| *share >= edge).collect();
    let mut hidden = vec![false; COLUMNS];
    for (start, length) in runs(&is_touched) {
        let columns = || (start..start + length).map(|column| column % COLUMNS);
        let sum: f64 = columns().map(|column| shares[column]).sum();
        if columns().any(|column| shares[column] >= core) && 2.0 * sum >= length as f64 {
            columns().for_each(|column| hidden[column] = true);
        }
    }
    hidden
}

/// Start and length of the runs of hidden columns; the last may go on across the first column.
fn runs(hidden: &[bool]) -> Vec<(usize, usize)> {
    let before = |k: usize| hidden[(k + COLUMNS - 1) % COLUMNS];
    let starts = (0..COLUMNS).filter(|k| hidden[*k] && !before(*k));
    let length = |start: usize| {
        (1..COLUMNS)
            .take_while(|k| hidden[(start + k) % COLUMNS])
            .count()
            + 1
    };
    starts.map(|start| (start, length(start))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_core::survey::MaskedTile;
    use tunnelstitch_geometry::surface::Circle;

    /// Wall of 144 × 10 tiles, of which so many rows are left out in most frames.
    fn masked(circle: &Circle, hidden_rows: impl Fn(i64) -> i64) -> MaskedWall {
        let seen = (0..10).map(|row| (row, 0, 144)).collect();
        let tile = |row, column| MaskedTile {
            row,
            column,
            frames: 4,
            left_out: if row < hidden_rows(column) { 3 } else { 1 },
        };
        let tiles = (0..10).flat_map(|row| (0..144).map(move |column| tile(row, column)));
        MaskedWall::new(circle.perimeter_m(), (144, 0.1), seen, tiles.collect())
    }

    fn bands_deg(known: &[[f64; 2]], hidden_rows: impl Fn(i64) -> i64) -> Vec<[f64; 2]> {
        let circle = Circle::new(3.0).unwrap();
        let bands = find_hidden_bands(&masked(&circle, hidden_rows), &circle, known);
        let bands = bands.unwrap_or_default();
        let degrees = |band: &[f64; 2]| band.map(|angle| angle.to_degrees().round());
        bands.iter().map(degrees).collect()
    }

    /// Columns of 2.5°; those at the edge and in the middle of the band are hidden less.
    #[test]
    fn bands_are_found_with_their_edges_and_across_the_first_column() {
        let rows = |column: i64| match column {
            58..60 | 70..74 | 84..86 => 2,
            60..84 => 8,
            _ => 0,
        };
        assert_eq!(bands_deg(&[], rows), [[145.0, 215.0]]);
        let across = |column: i64| if (10..130).contains(&column) { 0 } else { 9 };
        assert_eq!(bands_deg(&[], across), [[325.0, 385.0]]);
    }

    /// A band that is left out already is no news, nor is its edge; the other half of it is.
    #[test]
    fn bands_grow() {
        let known = [[145f64.to_radians(), 180f64.to_radians()]];
        let beside = |to: i64| move |column: i64| if (72..to).contains(&column) { 8 } else { 0 };
        assert!(bands_deg(&known, beside(72)).is_empty());
        assert!(bands_deg(&known, beside(76)).is_empty());
        assert_eq!(bands_deg(&known, beside(86)), [[145.0, 215.0]]);
    }

    /// A cable is left to the outlier mask; where much of the section is hidden, poses are wrong.
    #[test]
    fn cables_and_wrong_poses_are_no_bands() {
        let among = |range: std::ops::Range<i64>, rows: i64| {
            move |column: i64| if range.contains(&column) { rows } else { 0 }
        };
        assert!(bands_deg(&[], among(20..24, 10)).is_empty());
        assert!(bands_deg(&[], among(0..50, 10)).is_empty());
        assert!(bands_deg(&[], among(0..40, 4)).is_empty());
        // Joints that run along the picture's rows alias where they are far away.
        let aliased = |column: i64| {
            if column < 4 {
                8
            } else {
                among(0..20, 2)(column)
            }
        };
        assert!(bands_deg(&[], aliased).is_empty());
    }
}
