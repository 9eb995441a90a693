//! Motion of the wall in the picture, on a grid.

/// Motion of the wall in a cell of the picture, over the pairs of consecutive frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionCell {
    /// Unit vector (u, v) along which the wall moves most.
    pub direction: [f64; 2],
    /// Root mean square motion along the direction and across it, shares of the picture's width.
    pub rms: [f64; 2],
}

impl MotionCell {
    /// Principal directions of displacements (u, v), shares of the picture's width: the
    /// eigenvectors of their second moments `Σ d dᵀ/n`, whose eigenvalues are
    /// `(a + c)/2 ± √((a − c)²/4 + b²)`. None without displacements.
    pub fn of_displacements(displacements: impl Iterator<Item = [f64; 2]>) -> Option<Self> {
        let (mut count, [mut a, mut b, mut c]) = (0.0, [0.0; 3]);
        for [u, v] in displacements {
            (a, b, c) = (a + u * u, b + u * v, c + v * v);
            count += 1.0;
        }
        if count == 0.0 {
            return None;
        }
        let [a, b, c] = [a, b, c].map(|sum| sum / count);
        let (mean, half) = (0.5 * (a + c), (0.5 * (a - c)).hypot(b));
        let angle = 0.5 * (2.0 * b).atan2(a - c);
        Some(Self {
            direction: [angle.cos(), angle.sin()],
            rms: [mean + half, (mean - half).max(0.0)].map(f64::sqrt),
        })
    }
}

/// Motion of the wall in the picture, in cells of a regular grid.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionField {
    columns: usize,
    /// Row-major; None where the picture shows no wall.
    cells: Vec<Option<MotionCell>>,
}

impl MotionField {
    /// Creates a field from its cells, row-major.
    ///
    /// # Panics
    /// If `cells` does not hold `columns · rows` cells.
    pub fn new(columns: usize, rows: usize, cells: Vec<Option<MotionCell>>) -> Self {
        assert_eq!(cells.len(), columns * rows, "cells of a motion field");
        Self { columns, cells }
    }

    /// The cell at a position, shares of the picture's width and height.
    pub fn at(&self, u: f64, v: f64) -> Option<&MotionCell> {
        let rows = self.cells.len() / self.columns;
        // The casts saturate.
        let index = |share: f64, count: usize| ((share * count as f64) as usize).min(count - 1);
        let cell = index(v, rows) * self.columns + index(u, self.columns);
        self.cells[cell].as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn principal_directions_are_those_of_the_displacements() {
        let (cos, sin) = (0.3f64.cos(), 0.3f64.sin());
        // 0.2 to and fro along the direction, 0.05 across it.
        let displacements = [[0.2, 0.05], [-0.2, 0.05], [0.2, -0.05], [-0.2, -0.05]];
        let turned = displacements.map(|[x, y]| [cos * x - sin * y, sin * x + cos * y]);
        let cell = MotionCell::of_displacements(turned.into_iter()).unwrap();
        assert!((cell.direction[0] - cos).abs() < 1e-12);
        assert!((cell.direction[1] - sin).abs() < 1e-12);
        assert!((cell.rms[0] - 0.2).abs() < 1e-12 && (cell.rms[1] - 0.05).abs() < 1e-12);
        assert_eq!(MotionCell::of_displacements(std::iter::empty()), None);
    }

    #[test]
    fn cells_are_found_by_shares_of_the_picture() {
        let cell = |rms: f64| {
            Some(MotionCell {
                direction: [1.0, 0.0],
                rms: [rms, 0.0],
            })
        };
        let field = MotionField::new(2, 2, vec![cell(1.0), None, cell(3.0), cell(4.0)]);
        assert_eq!(field.at(0.0, 0.49).copied(), cell(1.0));
        assert_eq!(field.at(0.7, 0.1), None);
        assert_eq!(field.at(1.0, 1.0).copied(), cell(4.0));
    }
}
