//! Size and axis along the tunnel as a displacement of the wall.

use crate::point_fit::axis_fit::AxisFit;
use crate::point_fit::located_points::{SECTION_MODES, section_modes};
use crate::point_fit::section_fit::SectionFit;
use tunnelstitch_geometry::surface::{RadialField, SplineLattice, Surface, WallPoint};

/// Halvings from the lattice of the sections to that of the field.
const HALVINGS: u32 = 2;

/// Displacement of the wall between the chainages `extent_h_m` by size and axis of its sections,
/// which are fitted around the rows of `lattice`.
///
/// Along the tunnel they are B-splines whose coefficients are the values at the rows, which
/// reproduces lines and smooths the rest. Around the section the coefficients at the nodes are
/// `(8 m_i − m_(i−1) − m_(i+1))/6` of the modes m, which are off by the fourth power of the
/// spacing.
///
/// Source: C. de Boor, "A Practical Guide to Splines", 1978, XII (quasi-interpolation).
pub fn section_field(
    axis: &AxisFit,
    sections: &[SectionFit],
    surface: &dyn Surface,
    lattice: &SplineLattice,
    (extent_h_m, radius_m): ([f64; 2], f64),
) -> RadialField {
    let [from, to] = extent_h_m;
    let rows = lattice.rows_between(from, to);
    let values: Vec<[f64; SECTION_MODES]> = rows
        .clone()
        .map(|row| {
            let section = sections.iter().find(|section| section.row == row);
            axis.section_m(lattice.node(row, 0).h_m, section)
        })
        .collect();
    let amplitudes: [RadialField; SECTION_MODES] = std::array::from_fn(|mode| {
        let of_row = |value: &[f64; SECTION_MODES]| vec![value[mode]; lattice.columns];
        let coefficients = values.iter().flat_map(of_row).collect();
        let mut field = RadialField::new(*lattice, rows.start, coefficients);
        for _ in 0..HALVINGS {
            field = field.halved();
        }
        field
    });
    let fine = *amplitudes[0].lattice();
    let columns = fine.columns;
    let modes: Vec<[f64; SECTION_MODES]> = (0..columns)
        .map(|column| {
            let wall = WallPoint {
                h_m: 0.5 * (from + to),
                ..fine.node(0, column)
            };
            section_modes(surface, wall, radius_m)
        })
        .collect();
    let coefficient = |index: usize| {
        let column = index % columns;
        let (before, after) = ((column + columns - 1) % columns, (column + 1) % columns);
        let of_mode = |mode: usize| {
            let around = modes[before][mode] + modes[after][mode];
            let along = amplitudes[mode].coefficients_m()[index];
            along * (8.0 * modes[column][mode] - around) / 6.0
        };
        (0..SECTION_MODES).map(of_mode).sum()
    };
    let count = amplitudes[0].coefficients_m().len();
    let first_row = amplitudes[0].rows().start;
    RadialField::new(fine, first_row, (0..count).map(coefficient).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::point_fit::axis_fit::{AxisPrior, fit_axis};
    use nalgebra::Vector3;
    use tunnelstitch_geometry::surface::Circle;

    #[test]
    fn a_line_is_a_displacement_along_cosine_and_sine() {
        let circle = Circle::new(3.0).unwrap();
        let lattice = SplineLattice {
            perimeter_m: circle.perimeter_m(),
            columns: 16,
            origin: WallPoint { s_m: 0.2, h_m: 0.1 },
        };
        let section = |row: i64| {
            let h_m = lattice.node(row, 0).h_m;
            SectionFit {
                row,
                h_m,
                modes_m: [0.02, 0.01 + 0.002 * h_m, -0.005],
                variances_m2: [1e-12; 3],
                used: 50,
                outliers: 0,
                rms_m: 0.001,
            }
        };
        let sections: Vec<SectionFit> = (0..6).map(section).collect();
        let prior = AxisPrior {
            at_h_m: 0.0,
            sigma: Vector3::new(1.0, 1.0, 1.0),
            may_bend: false,
            alpha: 1e-3,
        };
        let axis = fit_axis(&sections, &prior).unwrap();
        let field = section_field(&axis, &sections, &circle, &lattice, ([0.0, 6.0], 3.0));
        assert_eq!(field.lattice().columns, 64);
        for (s_m, h_m) in [(0.0, 0.0), (3.3, 2.2), (14.0, 6.0)] {
            let theta: f64 = s_m / 3.0;
            let expected = 0.02 + (0.01 + 0.002 * h_m) * theta.sin() - 0.005 * theta.cos();
            let delta_m = field.at(WallPoint { s_m, h_m }).delta_m;
            assert!((delta_m - expected).abs() < 2e-6, "{delta_m} {expected}");
        }
    }
}
