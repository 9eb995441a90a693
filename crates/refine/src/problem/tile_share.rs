//! Share of the tiles over which sums run.

use crate::tiles::grid::TileId;

/// The tiles over which sums run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TileShare {
    /// All of them.
    All,
    /// One in so many.
    OneIn(usize),
}

impl TileShare {
    /// True if a tile is among them. Those of a share lie on a lattice that is skew to rows and
    /// columns, so that each row and each column of a block of tiles has some.
    pub fn has(self, tile: &TileId) -> bool {
        match self {
            Self::All => true,
            Self::OneIn(stride) => (tile.column + 3 * tile.row).rem_euclid(stride as i64) == 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tiles::grid::BLOCK;

    #[test]
    fn share_has_its_part_of_the_tiles_of_a_block() {
        for stride in [4, 8] {
            let share = TileShare::OneIn(stride);
            let has = |column, row| share.has(&TileId { column, row });
            for row in -BLOCK..0 {
                let count = (0..BLOCK).filter(|column| has(*column, row)).count();
                assert_eq!(count, BLOCK as usize / stride);
            }
            for column in 0..BLOCK {
                let count = (0..BLOCK).filter(|row| has(column, *row)).count();
                assert_eq!(count, BLOCK as usize / stride);
            }
        }
    }
}
