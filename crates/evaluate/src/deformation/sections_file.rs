//! `sections.csv`: the deformation of every section, a line each.
//!
//! A header names the columns, which are the fields of [`SectionDeformation`] and the clock
//! positions of the extreme diameters. A cell is empty where nothing is determined.

use super::section::SectionDeformation;

/// A number of a section.
type Field = fn(&mut SectionDeformation) -> &mut Option<f64>;

/// A column of the file.
enum Column {
    /// A number with its decimals.
    Number(usize, Field),
    /// The clock position of an angle; it is not read back.
    Clock(Field),
}

use Column::{Clock, Number};

/// The columns by their names.
const COLUMNS: [(&str, Column); 37] = [
    ("chainage_m", Number(4, |s| &mut s.chainage_m)),
    ("determined_share", Number(3, |s| &mut s.determined_share)),
    ("radius_m", Number(6, |s| &mut s.radius_m)),
    ("radius_change_mm", Number(3, |s| &mut s.radius_change_mm)),
    ("radius_sigma_mm", Number(3, |s| &mut s.radius_sigma_mm)),
    ("centre_x_mm", Number(3, |s| &mut s.centre_x_mm)),
    ("centre_x_sigma_mm", Number(3, |s| &mut s.centre_x_sigma_mm)),
    ("centre_z_mm", Number(3, |s| &mut s.centre_z_mm)),
    ("centre_z_sigma_mm", Number(3, |s| &mut s.centre_z_sigma_mm)),
    ("max_diameter_m", Number(6, |s| &mut s.max_diameter_m)),
    (
        "max_diameter_sigma_mm",
        Number(3, |s| &mut s.max_diameter_sigma_mm),
    ),
    ("max_diameter_deg", Number(0, |s| &mut s.max_diameter_deg)),
    (
        "max_diameter_sigma_deg",
        Number(2, |s| &mut s.max_diameter_sigma_deg),
    ),
    ("max_diameter_clock", Clock(|s| &mut s.max_diameter_deg)),
    ("min_diameter_m", Number(6, |s| &mut s.min_diameter_m)),
    (
        "min_diameter_sigma_mm",
        Number(3, |s| &mut s.min_diameter_sigma_mm),
    ),
    ("min_diameter_deg", Number(0, |s| &mut s.min_diameter_deg)),
    (
        "min_diameter_sigma_deg",
        Number(2, |s| &mut s.min_diameter_sigma_deg),
    ),
    ("min_diameter_clock", Clock(|s| &mut s.min_diameter_deg)),
    ("ovality_mm", Number(3, |s| &mut s.ovality_mm)),
    ("ovality_sigma_mm", Number(3, |s| &mut s.ovality_sigma_mm)),
    (
        "second_harmonic_mm",
        Number(3, |s| &mut s.second_harmonic_mm),
    ),
    (
        "second_harmonic_sigma_mm",
        Number(3, |s| &mut s.second_harmonic_sigma_mm),
    ),
    ("deviation_rms_mm", Number(3, |s| &mut s.deviation_rms_mm)),
    (
        "deviation_extreme_mm",
        Number(3, |s| &mut s.deviation_extreme_mm),
    ),
    ("horizontal_m", Number(6, |s| &mut s.horizontal_m)),
    (
        "horizontal_change_mm",
        Number(3, |s| &mut s.horizontal_change_mm),
    ),
    (
        "horizontal_sigma_mm",
        Number(3, |s| &mut s.horizontal_sigma_mm),
    ),
    ("vertical_m", Number(6, |s| &mut s.vertical_m)),
    (
        "vertical_change_mm",
        Number(3, |s| &mut s.vertical_change_mm),
    ),
    ("vertical_sigma_mm", Number(3, |s| &mut s.vertical_sigma_mm)),
    ("rising_m", Number(6, |s| &mut s.rising_m)),
    ("rising_change_mm", Number(3, |s| &mut s.rising_change_mm)),
    ("rising_sigma_mm", Number(3, |s| &mut s.rising_sigma_mm)),
    ("falling_m", Number(6, |s| &mut s.falling_m)),
    ("falling_change_mm", Number(3, |s| &mut s.falling_change_mm)),
    ("falling_sigma_mm", Number(3, |s| &mut s.falling_sigma_mm)),
];

/// The clock position of an angle from twelve o'clock towards three, degrees, as `h:mm`.
pub fn clock_position(angle_deg: f64) -> String {
    let minutes = (2.0 * angle_deg).rem_euclid(720.0).round() as u32 % 720;
    let hour = match minutes / 60 {
        0 => 12,
        hour => hour,
    };
    format!("{hour}:{:02}", minutes % 60)
}

/// A number with some decimals; zero has no sign.
fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|digit| matches!(digit, '0' | '.')) => rest.to_owned(),
        _ => text,
    }
}

/// The text of `sections.csv`.
pub fn sections_csv(sections: &[SectionDeformation]) -> String {
    let mut text = COLUMNS.map(|(name, _)| name).join(",");
    text.push('\n');
    for section in sections {
        let mut section = section.clone();
        let cells = COLUMNS.map(|(_, column)| match column {
            Number(decimals, field) => field(&mut section).map(|value| fixed(value, decimals)),
            Clock(field) => field(&mut section).map(clock_position),
        });
        text += &cells.map(Option::unwrap_or_default).join(",");
        text.push('\n');
    }
    text
}

/// Reads the text of `sections.csv`. Columns may be in any order; others are ignored.
///
/// # Errors
/// A number that is none, or a line without a chainage, with its line number.
pub fn read_sections(text: &str) -> Result<Vec<SectionDeformation>, String> {
    let mut lines = text.lines();
    let header = lines.next().unwrap_or_default();
    let fields: Vec<Option<Field>> = header
        .split(',')
        .map(|name| {
            let mut columns = COLUMNS.into_iter();
            match columns.find(|(own, _)| *own == name.trim())?.1 {
                Number(_, field) => Some(field),
                Clock(_) => None,
            }
        })
        .collect();
    let mut sections = Vec::new();
    for (line, number) in lines.zip(2..) {
        let mut section = SectionDeformation::default();
        for (cell, field) in line.split(',').zip(&fields) {
            let (Some(field), false) = (field, cell.trim().is_empty()) else {
                continue;
            };
            let value: f64 = cell
                .trim()
                .parse()
                .map_err(|_| format!("line {number}: {cell:?} is not a number"))?;
            *field(&mut section) = Some(value);
        }
        if section.chainage_m.is_none() {
            return Err(format!("line {number}: chainage_m is missing"));
        }
        sections.push(section);
    }
    Ok(sections)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_read_back_and_empty_cells_stay_empty() {
        let section = SectionDeformation {
            chainage_m: Some(1.25),
            centre_x_mm: Some(0.0),
            radius_m: Some(3.004),
            max_diameter_deg: Some(45.0),
            ovality_mm: Some(20.5),
            ..SectionDeformation::default()
        };
        let text = sections_csv(&[section.clone(), section.clone()]);
        assert_eq!(text.lines().count(), 3);
        assert!(text.contains(",1:30,"), "{text}");
        assert_eq!(read_sections(&text), Ok(vec![section.clone(), section]));
        let error = read_sections("chainage_m,radius_m\n1,2\n1,x\n").unwrap_err();
        assert!(
            error.contains("line 3") && error.contains("\"x\""),
            "{error}"
        );
        assert!(
            read_sections("radius_m\n3\n")
                .unwrap_err()
                .contains("chainage_m")
        );
    }

    #[test]
    fn clock_positions_go_from_twelve_to_twelve() {
        for (angle_deg, text) in [
            (0.0, "12:00"),
            (90.0, "3:00"),
            (45.0, "1:30"),
            (359.9, "12:00"),
            (-30.0, "11:00"),
            (16.0, "12:32"),
        ] {
            assert_eq!(clock_position(angle_deg), text);
        }
    }
}
