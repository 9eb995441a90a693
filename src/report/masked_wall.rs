//! Map of the wall that was left out, in the report.

use crate::evaluate::deformation::PageCells;
use crate::survey::MaskedWall;
use serde::{Deserialize, Serialize};

const AROUND: usize = PageCells::AROUND;

/// Share of the frames that were left out because they show something else than the wall. Lists are
/// row-major: a row for each cell along the axis, which begins at θ = 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct MaskedMap {
    /// Number of cells around the section.
    pub around: usize,
    /// Number of cells along the axis.
    pub along: usize,
    /// Chainage of the first cell's beginning and of the last one's end, metres.
    pub chainage_m: [f64; 2],
    /// Mean share over the tiles of the cell, 0 to 1; null where no two frames see the wall.
    pub share: Vec<Option<f64>>,
}

impl MaskedMap {
    /// The map; None if no two frames see the wall.
    pub fn new(masked: &MaskedWall) -> Option<Self> {
        let (first, last) = (masked.seen().first()?.0, masked.seen().last()?.0);
        let [from_m, to_m] = [first, last + 1].map(|row| masked.corner(row, 0).h_m);
        let [width_m, _] = masked.tile_size_m();
        let perimeter_m = width_m * masked.columns() as f64;
        let PageCells { along, side_m } = PageCells::new([from_m, to_m], perimeter_m);
        let cell_of = |row: i64, column: i64| {
            let corner = masked.corner(row, column);
            let around = ((corner.s_m + 0.5 * width_m) / side_m).floor() as i64;
            let share = (corner.h_m - from_m) / (to_m - from_m);
            let row = ((share * along as f64) as usize).min(along - 1);
            row * AROUND + around.rem_euclid(AROUND as i64) as usize
        };
        let mut seen = vec![0u32; along * AROUND];
        let mut left_out = vec![0.0; along * AROUND];
        for (row, from, to) in masked.seen() {
            for column in *from..*to {
                seen[cell_of(*row, column)] += 1;
            }
        }
        for tile in masked.tiles() {
            left_out[cell_of(tile.row, tile.column)] += tile.share();
        }
        let rounded = |share: f64| (1e3 * share).round() / 1e3;
        let cells = seen.iter().zip(&left_out);
        Some(Self {
            around: AROUND,
            along,
            chainage_m: [from_m, to_m],
            share: cells
                .map(|(seen, left_out)| (*seen > 0).then(|| rounded(left_out / f64::from(*seen))))
                .collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::survey::MaskedTile;

    #[test]
    fn cells_have_the_mean_share_of_their_tiles() {
        let tiles = vec![MaskedTile {
            row: 4,
            column: 1,
            frames: 4,
            left_out: 2,
        }];
        // Two tiles a cell around, two along.
        let seen = vec![(3, 0, 20), (4, 0, 360)];
        let masked = MaskedWall::new(360.0, (360, 1.0), seen, tiles);
        let map = MaskedMap::new(&masked).unwrap();
        assert_eq!((map.around, map.along), (180, 1));
        assert_eq!(map.chainage_m, [3.0, 5.0]);
        assert_eq!(map.share[0], Some(0.125));
        assert!(map.share[1..].iter().all(|share| *share == Some(0.0)));
        assert_eq!(
            MaskedMap::new(&MaskedWall::new(1.0, (8, 1.0), vec![], vec![])),
            None
        );
    }
}
