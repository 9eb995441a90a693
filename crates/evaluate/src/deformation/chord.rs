//! Convergence chords: distances between points of the wall on standard lines.
//!
//! The end points a, b of a chord move along their normals, so that its length is, to first order,
//! `ℓ + u·n_b δ_b − u·n_a δ_a` with the nominal length ℓ and the unit vector u from a to b. A
//! length that falls (convergence) is a negative change.

use super::functional::Functional;
use super::outline::{DEGREES, SectionOutline};

/// A standard chord: its end points, degrees from twelve o'clock towards three.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chord {
    /// End points.
    pub(super) ends: [usize; 2],
}

impl Chord {
    /// From nine to three o'clock.
    pub(super) const HORIZONTAL: Self = Self { ends: [270, 90] };
    /// From six to twelve o'clock.
    pub(super) const VERTICAL: Self = Self { ends: [180, 0] };
    /// From 7:30 to 1:30.
    pub(super) const RISING: Self = Self { ends: [225, 45] };
    /// From 10:30 to 4:30.
    pub(super) const FALLING: Self = Self { ends: [315, 135] };

    /// The nominal length, metres, and the length as a function of the displacements.
    pub(super) fn length(&self, outline: &SectionOutline) -> (f64, Functional) {
        let [a, b] = self.ends;
        let along = outline.points[b] - outline.points[a];
        let nominal_m = along.norm();
        let u = along / nominal_m;
        let terms = [
            (b, u.dot(&outline.normals[b])),
            (a, -u.dot(&outline.normals[a])),
        ];
        (nominal_m, Functional::sparse(DEGREES, nominal_m, terms))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::surface::section::PiecewiseOutline;
    use tunnelstitch_geometry::surface::{Circle, Prism};

    #[test]
    fn chords_have_their_lengths_and_weights() {
        let circle = SectionOutline::new(&Circle::new(3.0).unwrap(), 0.0);
        for chord in [
            Chord::HORIZONTAL,
            Chord::VERTICAL,
            Chord::RISING,
            Chord::FALLING,
        ] {
            let (nominal_m, length) = chord.length(&circle);
            assert!((nominal_m - 6.0).abs() < 1e-9);
            assert!((length.weights.iter().sum::<f64>() - 2.0).abs() < 1e-9);
        }
        let section = PiecewiseOutline::rectangle(4.0, 3.0).unwrap();
        let rectangle = SectionOutline::new(&Prism::new(Box::new(section)), 0.0);
        let (width_m, _) = Chord::HORIZONTAL.length(&rectangle);
        assert!((width_m - 4.0).abs() < 1e-9);
        // A diagonal meets the roof obliquely, at 45°.
        let (_, diagonal) = Chord::RISING.length(&rectangle);
        assert!((diagonal.weights[45] - 0.5f64.sqrt()).abs() < 1e-6);
    }
}
