//! Deformation of one section: a row of `sections.csv`.

use super::best_fit_circle::CircleFit;
use super::chord::Chord;
use super::deviation::DeviationMap;
use super::diameters::{Diameters, Extreme};
use super::functional::{Measured, SectionSamples};
use super::outline::{DEGREES, SectionOutline};
use super::shape_estimate::ShapeEstimate;
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Smallest distance of sections along the tunnel, metres.
const MIN_SPACING_M: f64 = 0.25;
/// Smallest share of a section that must be determined.
const MIN_SECTION_SHARE: f64 = 0.25;

/// Deformation of one section. What is not determined, is not expressed by the functions of the
/// shape, or has no meaning for the section, is None; so is a σ that is not known.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SectionDeformation {
    /// Chainage, metres.
    pub chainage_m: Option<f64>,
    /// Share of the section that the frames determine, 0 to 1.
    pub determined_share: Option<f64>,
    /// Radius of the best-fit circle, metres.
    pub radius_m: Option<f64>,
    /// 1-σ of it relative to the nominal radius, millimetres.
    pub radius_sigma_mm: Option<f64>,
    /// Radius of the best-fit circle less the nominal radius, millimetres.
    pub radius_change_mm: Option<f64>,
    /// Offset of the best-fit centre from the axis towards three o'clock, millimetres.
    pub centre_x_mm: Option<f64>,
    /// 1-σ of it, millimetres.
    pub centre_x_sigma_mm: Option<f64>,
    /// Offset of the best-fit centre from the axis towards twelve o'clock, millimetres.
    pub centre_z_mm: Option<f64>,
    /// 1-σ of it, millimetres.
    pub centre_z_sigma_mm: Option<f64>,
    /// Largest diameter, metres.
    pub max_diameter_m: Option<f64>,
    /// 1-σ of it relative to the nominal radius, millimetres.
    pub max_diameter_sigma_mm: Option<f64>,
    /// Its direction from twelve o'clock towards three, 0 to 180 degrees.
    pub max_diameter_deg: Option<f64>,
    /// 1-σ of the direction, degrees.
    pub max_diameter_sigma_deg: Option<f64>,
    /// Smallest diameter, metres.
    pub min_diameter_m: Option<f64>,
    /// 1-σ of it relative to the nominal radius, millimetres.
    pub min_diameter_sigma_mm: Option<f64>,
    /// Its direction from twelve o'clock towards three, 0 to 180 degrees.
    pub min_diameter_deg: Option<f64>,
    /// 1-σ of the direction, degrees.
    pub min_diameter_sigma_deg: Option<f64>,
    /// Largest less smallest diameter, millimetres.
    pub ovality_mm: Option<f64>,
    /// 1-σ of it, millimetres.
    pub ovality_sigma_mm: Option<f64>,
    /// Amplitude c of the second harmonic `c cos 2(θ − θ_2)` of the displacement, millimetres.
    pub second_harmonic_mm: Option<f64>,
    /// 1-σ of it, millimetres.
    pub second_harmonic_sigma_mm: Option<f64>,
    /// Deviation from the best-fit circle (from the nominal section if it is no circle), root mean
    /// square over what is determined, millimetres.
    pub deviation_rms_mm: Option<f64>,
    /// Deviation of the largest absolute value, millimetres, positive outwards.
    pub deviation_extreme_mm: Option<f64>,
    /// Chord from nine to three o'clock: length, metres.
    pub horizontal_m: Option<f64>,
    /// Its change from the nominal length, millimetres; convergence is negative.
    pub horizontal_change_mm: Option<f64>,
    /// 1-σ of it relative to the nominal length, millimetres.
    pub horizontal_sigma_mm: Option<f64>,
    /// Chord from six to twelve o'clock: length, metres.
    pub vertical_m: Option<f64>,
    /// Its change from the nominal length, millimetres.
    pub vertical_change_mm: Option<f64>,
    /// 1-σ of it, millimetres.
    pub vertical_sigma_mm: Option<f64>,
    /// Chord from 7:30 to 1:30: length, metres.
    pub rising_m: Option<f64>,
    /// Its change from the nominal length, millimetres.
    pub rising_change_mm: Option<f64>,
    /// 1-σ of it, millimetres.
    pub rising_sigma_mm: Option<f64>,
    /// Chord from 10:30 to 4:30: length, metres.
    pub falling_m: Option<f64>,
    /// Its change from the nominal length, millimetres.
    pub falling_change_mm: Option<f64>,
    /// 1-σ of it, millimetres.
    pub falling_sigma_mm: Option<f64>,
}

/// Measures the sections of a wall at the rows of its shape, every `MIN_SPACING_M` or each row if
/// they are farther apart. Sections of which less than a quarter is determined are left out.
///
/// `sigmas_m`: 1-σ of the deviation at the nodes ([`super::deviation_sigmas_m`]).
pub fn measure_sections(
    shape: &ShapeEstimate,
    sigmas_m: &[Option<f64>],
) -> Vec<SectionDeformation> {
    let map = DeviationMap::new(shape.nominal, shape.field.clone(), sigmas_m.to_vec());
    let lattice = shape.field.lattice();
    let step = (MIN_SPACING_M / lattice.spacing_m()).ceil().max(1.0) as usize;
    let rows: Vec<i64> = shape.field.rows().step_by(step).collect();
    let sections = rows.par_map(|row| measure(shape, &map, lattice.node(*row, 0).h_m));
    sections.into_iter().flatten().collect()
}

/// Measures the section at a chainage, metres; None if too little of it is determined.
fn measure(shape: &ShapeEstimate, map: &DeviationMap, h_m: f64) -> Option<SectionDeformation> {
    let outline = SectionOutline::new(shape.nominal, h_m);
    let walls = &outline.walls;
    let determined: Vec<bool> = walls.iter().map(|wall| map.is_determined(*wall)).collect();
    let share = determined.iter().filter(|is_known| **is_known).count() as f64 / DEGREES as f64;
    if share < MIN_SECTION_SHARE {
        return None;
    }
    let samples = SectionSamples::new(shape.field, shape.error_draws, walls);
    let deviations = walls.iter().filter_map(|wall| map.at(*wall));
    let deviations: Vec<f64> = deviations.map(|deviation| deviation.value_m).collect();
    let square: f64 = deviations.iter().map(|value| value * value).sum();
    let extreme = deviations.iter().copied();
    let extreme = extreme.max_by(|a, b| a.abs().total_cmp(&b.abs()));
    let mut section = SectionDeformation {
        chainage_m: Some(h_m),
        determined_share: Some(share),
        deviation_rms_mm: extreme.map(|_| 1e3 * (square / deviations.len() as f64).sqrt()),
        deviation_extreme_mm: extreme.map(|value| 1e3 * value),
        ..SectionDeformation::default()
    };
    section.set_chords(&outline, &samples, &determined);
    if let Some(radius_m) = outline.radius_m {
        let angles: Vec<f64> = (0..DEGREES).map(SectionOutline::angle_rad).collect();
        if let Some(fit) = CircleFit::new(&angles, &determined) {
            section.set_circle(radius_m, &fit, &samples);
        }
        if let Some(diameters) = Diameters::new(radius_m, &samples, &determined) {
            section.set_diameters(&diameters);
        }
    }
    Some(section)
}

/// Value in millimetres and its 1-σ.
fn in_mm(measured: Measured) -> [Option<f64>; 2] {
    [Some(1e3 * measured.value), sigma_mm(measured)]
}

fn sigma_mm(measured: Measured) -> Option<f64> {
    measured.sigma.map(|sigma_m| 1e3 * sigma_m)
}

/// Diameter in metres with 1-σ in millimetres, direction and its 1-σ in degrees.
fn of_extreme(extreme: &Extreme) -> [Option<f64>; 4] {
    let Extreme {
        diameter,
        direction,
    } = extreme;
    [
        Some(diameter.value),
        sigma_mm(*diameter),
        Some(direction.value.to_degrees()),
        direction.sigma.map(f64::to_degrees),
    ]
}

impl SectionDeformation {
    fn set_circle(&mut self, radius_m: f64, fit: &CircleFit, samples: &SectionSamples) {
        let measure = |function| match samples.measure_expressed(function) {
            Some(measured) => in_mm(measured),
            None => [None; 2],
        };
        [self.radius_change_mm, self.radius_sigma_mm] = measure(&fit.radius);
        [self.centre_x_mm, self.centre_x_sigma_mm] = measure(&fit.x);
        [self.centre_z_mm, self.centre_z_sigma_mm] = measure(&fit.z);
        let change_mm = self.radius_change_mm;
        self.radius_m = change_mm.map(|change_mm| radius_m + 1e-3 * change_mm);
    }

    fn set_diameters(&mut self, diameters: &Diameters) {
        [
            self.max_diameter_m,
            self.max_diameter_sigma_mm,
            self.max_diameter_deg,
            self.max_diameter_sigma_deg,
        ] = of_extreme(&diameters.max);
        [
            self.min_diameter_m,
            self.min_diameter_sigma_mm,
            self.min_diameter_deg,
            self.min_diameter_sigma_deg,
        ] = of_extreme(&diameters.min);
        [self.ovality_mm, self.ovality_sigma_mm] = in_mm(diameters.ovality);
        if let Some(harmonic) = diameters.second_harmonic {
            [self.second_harmonic_mm, self.second_harmonic_sigma_mm] = in_mm(harmonic);
        }
    }

    fn set_chords(
        &mut self,
        outline: &SectionOutline,
        samples: &SectionSamples,
        determined: &[bool],
    ) {
        let measure = |chord: Chord| -> [Option<f64>; 3] {
            if !chord.ends.iter().all(|end| determined[*end]) {
                return [None; 3];
            }
            let (nominal_m, length) = chord.length(outline);
            let measured = samples.measure(&length);
            let change_mm = 1e3 * (measured.value - nominal_m);
            [Some(measured.value), Some(change_mm), sigma_mm(measured)]
        };
        [
            self.horizontal_m,
            self.horizontal_change_mm,
            self.horizontal_sigma_mm,
        ] = measure(Chord::HORIZONTAL);
        [
            self.vertical_m,
            self.vertical_change_mm,
            self.vertical_sigma_mm,
        ] = measure(Chord::VERTICAL);
        [self.rising_m, self.rising_change_mm, self.rising_sigma_mm] = measure(Chord::RISING);
        [
            self.falling_m,
            self.falling_change_mm,
            self.falling_sigma_mm,
        ] = measure(Chord::FALLING);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::deformation::deviation::deviation_sigmas_m;
    use crate::deformation::test_fields::{RADIUS_M, error_draws, field_of};
    use tunnelstitch_geometry::surface::section::Ellipse;
    use tunnelstitch_geometry::surface::{Circle, Prism, RadialField, Surface, WallPoint};

    fn estimate<'a>(
        nominal: &'a dyn Surface,
        field: &'a RadialField,
        error_draws: &'a [RadialField],
    ) -> ShapeEstimate<'a> {
        ShapeEstimate {
            nominal,
            field,
            error_draws,
            prior_sigma_m: 0.01,
            extent_h_m: None,
        }
    }

    fn assert_near(found: Option<f64>, expected: f64, tolerance: f64) {
        let found = found.unwrap();
        assert!(
            (found - expected).abs() < tolerance,
            "{found}, not {expected}"
        );
    }

    #[test]
    fn an_oval_has_its_diameters_at_their_clock_positions() {
        let circle = Circle::new(RADIUS_M).unwrap();
        let oval = |t: f64| 0.002 + 0.01 * (2.0 * (t - 0.7)).cos();
        let field = field_of(oval);
        let sections = measure_sections(&estimate(&circle, &field, &[]), &[]);
        // Rows of the middle; beyond the first and the last the spline goes to zero.
        let section = &sections[5];
        assert_near(section.radius_m, 3.002, 1e-6);
        // A spline with these coefficients is less by β = (2 + cos(2π 2/64))/3, 0.64 %.
        let beta = (2.0 + (std::f64::consts::TAU / 32.0).cos()) / 3.0;
        assert_near(section.max_diameter_m, 6.004 + 0.02 * beta, 1e-5);
        assert_near(section.min_diameter_m, 6.004 - 0.02 * beta, 1e-5);
        assert_near(section.max_diameter_deg, 0.7f64.to_degrees(), 0.6);
        assert_near(section.min_diameter_deg, 0.7f64.to_degrees() + 90.0, 0.6);
        assert_near(section.ovality_mm, 40.0 * beta, 0.02);
        assert_near(section.second_harmonic_mm, 10.0 * beta, 0.01);
        assert_near(section.deviation_rms_mm, 10.0 * beta / 2f64.sqrt(), 0.01);
        assert_near(section.vertical_m, 6.0 + 2.0 * oval(0.0), 2e-4);
        assert_near(
            section.rising_change_mm,
            2e3 * oval(std::f64::consts::FRAC_PI_4),
            0.2,
        );
        assert_eq!(
            (section.radius_sigma_mm, section.ovality_sigma_mm),
            (None, None)
        );
    }

    /// σ of all figures against the scatter of the figures themselves.
    #[test]
    fn stated_sigma_is_the_scatter_of_repeated_estimates() {
        let circle = Circle::new(RADIUS_M).unwrap();
        let truth = field_of(|t| 0.01 * (2.0 * (t - 0.7)).cos());
        let sigmas_m = [0.0008, 0.0005, 0.0003];
        let draws = error_draws(256, sigmas_m, 0.0001);
        let stated = estimate(&circle, &truth, &draws);
        let sigmas = deviation_sigmas_m(&stated);
        assert!(sigmas.iter().all(Option::is_some));
        let stated = &measure_sections(&stated, &sigmas)[5];
        type Pick = fn(&SectionDeformation) -> [Option<f64>; 2];
        let figures: [Pick; 8] = [
            |s| [s.radius_change_mm, s.radius_sigma_mm],
            |s| [s.centre_x_mm, s.centre_x_sigma_mm],
            |s| [s.max_diameter_m.map(|m| 1e3 * m), s.max_diameter_sigma_mm],
            |s| [s.max_diameter_deg, s.max_diameter_sigma_deg],
            |s| [s.ovality_mm, s.ovality_sigma_mm],
            |s| [s.second_harmonic_mm, s.second_harmonic_sigma_mm],
            |s| [s.horizontal_change_mm, s.horizontal_sigma_mm],
            |s| [s.falling_change_mm, s.falling_sigma_mm],
        ];
        let repeated: Vec<SectionDeformation> = error_draws(512, sigmas_m, 0.0001)[256..]
            .iter()
            .map(|error| {
                let field = truth.plus(error);
                measure_sections(&estimate(&circle, &field, &[]), &[]).swap_remove(4)
            })
            .collect();
        for (k, figure) in figures.iter().enumerate() {
            let values: Vec<f64> = repeated.iter().filter_map(|s| figure(s)[0]).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
            let scatter = (square / values.len() as f64).sqrt();
            let ratio = figure(stated)[1].unwrap() / scatter;
            // 256 draws and 256 repetitions: 6 %.
            assert!((0.8..1.25).contains(&ratio), "figure {k}: {ratio}");
        }
    }

    #[test]
    fn errors_of_mean_and_centre_are_not_those_of_the_deviation() {
        let circle = Circle::new(RADIUS_M).unwrap();
        let field = field_of(|_| 0.0);
        let draws = error_draws(64, [0.02, 0.02, 0.001], 0.0);
        let sigmas = deviation_sigmas_m(&estimate(&circle, &field, &draws));
        let map = DeviationMap::new(&circle, field.clone(), sigmas);
        let at = map.at(WallPoint { s_m: 4.0, h_m: 3.0 }).unwrap();
        assert!((0.0007..0.0013).contains(&at.sigma_m), "{}", at.sigma_m);
        // Where the errors are those of the prior, nothing is determined.
        let draws = error_draws(64, [0.0, 0.0, 0.01], 0.0);
        let sigmas = deviation_sigmas_m(&estimate(&circle, &field, &draws));
        assert!(sigmas.iter().all(Option::is_none));
        assert!(measure_sections(&estimate(&circle, &field, &draws), &sigmas).is_empty());
    }

    #[test]
    fn a_section_that_is_no_circle_has_chords_and_deviations_only() {
        let size_m = 2.0 * RADIUS_M;
        let ellipse = Prism::new(Box::new(Ellipse::new(size_m, 1.001 * size_m).unwrap()));
        let field = field_of(|_| 0.004);
        let section = &measure_sections(&estimate(&ellipse, &field, &[]), &[])[4];
        assert_eq!((section.radius_m, section.ovality_mm), (None, None));
        assert_near(section.deviation_rms_mm, 4.0, 1e-6);
        assert_near(section.horizontal_m, size_m + 0.008, 1e-6);
    }

    #[test]
    fn what_is_not_determined_is_left_out_of_fits_extremes_and_chords() {
        let circle = Circle::new(RADIUS_M).unwrap();
        let field = field_of(|t| 0.003 * t.sin());
        let columns = field.lattice().columns;
        let seen = |k: usize| (k % columns < columns * 7 / 10).then_some(1e-4);
        let sigmas: Vec<Option<f64>> = (0..field.coefficients_m().len()).map(seen).collect();
        let section = &measure_sections(&estimate(&circle, &field, &[]), &sigmas)[5];
        assert_near(section.determined_share, 0.7, 0.02);
        assert_near(section.centre_x_mm, 3.0, 0.02);
        // Nine o'clock, 270°, is not determined.
        assert_eq!(section.horizontal_m, None);
        assert!(section.vertical_m.is_some());
        assert_eq!(
            (section.ovality_mm, section.second_harmonic_mm),
            (None, None)
        );
    }
}
