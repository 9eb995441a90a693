//! The calibration in RealityCapture's CSV of cameras ("Internal/External camera parameters";
//! RealityScan's, too): columns `f`, `px`, `py`, `k1` to `k4`, `t1` and `t2` beside the poses.
//!
//! `f` is that of a picture whose longer side is 36 mm; `px` and `py` are the principal point from
//! the middle of the picture, to the right and down, in longer sides: `cx = px s + w / 2`, with
//! `s = max(w, h)`, pixels counted from the corner of the first. The coefficients are those of the
//! model Brown 3, with or without tangential distortion; OpenCV's p1 and p2 are `t2` and `t1`. `k4`
//! of Brown 4 has no place in OpenCV's model and must be 0. The file does not state its model:
//! coefficients of the model Division are of another kind, and are taken wrongly. Neither does it
//! have the size of the pictures. Cameras are named by their pictures.
//!
//! Source: the formats "Internal/External Camera Parameters" (`f*36`, `px`, `py`) and
//! "OpenCV-compliant" (`px*scale+width*0.5`; k1, k2, t2, t1, k3) in `calibration.xml` of
//! RealityScan 2.2; "RealityCapture XMP Camera Math".

use super::coefficients::brown_conrady;
use super::error::ParseError;
use super::per_picture::select_shared;
use super::picture_size::{PictureSize, needed};
use super::words::{data_lines, filled_lines, finite};
use crate::camera::projection::Camera;
use csv::{ReaderBuilder, StringRecord, Trim};

/// Width of the picture that focal lengths belong to, millimetres.
const FILM_MM: f64 = 36.0;
/// The columns, with the names that RealityScan gives to the first three; only the first is needed.
const COLUMNS: [[&str; 2]; 9] = [
    ["f", "f_35mm"],
    ["px", "px_norm"],
    ["py", "py_norm"],
    ["k1", "k1"],
    ["k2", "k2"],
    ["k3", "k3"],
    ["k4", "k4"],
    ["t1", "t1"],
    ["t2", "t2"],
];

/// The comment with the names of the columns.
struct Header {
    separator: u8,
    /// Place of the pictures' names.
    name: usize,
    /// Places of [`COLUMNS`].
    places: [Option<usize>; 9],
}

/// True for a text whose comments name the columns `name` and `f`.
pub fn is_table(text: &str) -> bool {
    header(text).is_some()
}

/// Reads the calibration that all cameras share, or that of the picture of this name.
pub fn read(text: &str, name: Option<&str>, size: PictureSize) -> Result<Camera, ParseError> {
    let header = header(text).ok_or_else(|| ParseError::new("no comment names its columns"))?;
    let rows = data_lines(text);
    let rows: Result<Vec<_>, ParseError> = rows.map(|row| camera_row(row, &header)).collect();
    let [f, px, py, k1, k2, k3, k4, t1, t2] = select_shared(rows?, name)?;
    if k4 != 0.0 {
        return Err(ParseError::new(format!(
            "`k4` is {k4}; the model Brown 4 is not supported: set the distortion model to Brown 3 \
             and align again"
        )));
    }
    let [width, height] = needed(size)?;
    let longer = f64::from(width.max(height));
    let centre = |side: u32, offset: f64| 0.5 * f64::from(side) + longer * offset - 0.5;
    let focal_px = longer * f / FILM_MM;
    Ok(Camera::at_rest(
        [width, height],
        [focal_px, focal_px],
        [centre(width, px), centre(height, py)],
        brown_conrady(&[k1, k2, t2, t1, k3])?,
    ))
}

fn header(text: &str) -> Option<Header> {
    let mut comments = filled_lines(text).map_while(|(_, line)| line.strip_prefix('#'));
    comments.find_map(|line| {
        let is_there = |separator: &u8| line.as_bytes().contains(separator);
        let separator = [b'\t', b';', b','].into_iter().find(is_there)?;
        let titles = split(line, separator)?;
        let place = |names: &[&str]| {
            let is_named = |title: &str| names.iter().any(|name| title.eq_ignore_ascii_case(name));
            titles.iter().position(is_named)
        };
        let places = COLUMNS.map(|names| place(&names));
        places[0]?;
        Some(Header {
            separator,
            name: place(&["name"])?,
            places,
        })
    })
}

/// The name and the numbers of a camera, 0 for columns that are not there.
fn camera_row(
    (number, line): (usize, &str),
    header: &Header,
) -> Result<(String, [f64; 9]), ParseError> {
    let row = split(line, header.separator)
        .ok_or_else(|| ParseError::at(number, "this line is no row of a CSV"))?;
    let cell = |place: usize| {
        let missing = || ParseError::at(number, "fewer columns than the comment names");
        row.get(place).ok_or_else(missing)
    };
    let mut values = [0.0; 9];
    for (value, place) in values.iter_mut().zip(header.places) {
        if let Some(place) = place {
            *value = finite(cell(place)?, number)?;
        }
    }
    Ok((cell(header.name)?.to_owned(), values))
}

fn split(line: &str, separator: u8) -> Option<StringRecord> {
    let mut reader = ReaderBuilder::new()
        .delimiter(separator)
        .has_headers(false)
        .trim(Trim::All)
        .from_reader(line.as_bytes());
    let mut record = StringRecord::new();
    reader.read_record(&mut record).ok().map(|_| record)
}

#[cfg(test)]
mod tests {
    use crate::camera::calibration::tests::read_sized;
    use nalgebra::Vector3;

    const HEADER: &str = "#cameras 2\n#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n";
    const NUMBERS: &str = "1,2,3,0,90,0,27,0.01,-0.02,0.1,0.2,0,0,0.02,0.01\n";

    fn table() -> String {
        format!("{HEADER}a.jpg,{NUMBERS}b.jpg,{NUMBERS}")
    }

    /// Worked by hand at (0.5, 0.25), r² = 0.3125.
    #[test]
    fn points_are_where_the_published_formulas_say() {
        let scan = table()
            .replace("heading", "yaw")
            .replace("f,px,py", "f_35mm,px_norm,py_norm");
        for text in [table(), scan, table().replace(',', ";")] {
            let camera = read_sized("cameras.csv", &text, None, Some([640, 480])).unwrap();
            let pixel = camera.project(&Vector3::new(1.0, 0.5, 2.0)).unwrap();
            // p1 = 0.01, p2 = 0.02: 2 p1 x y + p2 (r² + 2 x²) and p1 (r² + 2 y²) + 2 p2 x y.
            let radial = 1.0 + 0.1 * 0.3125 + 0.2 * 0.3125 * 0.3125;
            let x = 0.5 * radial + 0.0025 + 0.02 * 0.8125;
            let y = 0.25 * radial + 0.01 * 0.4375 + 0.005;
            // f = 640 · 27 / 36 = 480.
            let expected = [
                320.0 + 6.4 - 0.5 + 480.0 * x,
                240.0 - 12.8 - 0.5 + 480.0 * y,
            ];
            assert!((pixel.x - expected[0]).abs() < 1e-9, "{pixel}");
            assert!((pixel.y - expected[1]).abs() < 1e-9, "{pixel}");
        }
        // The longer side of an upright picture is its height.
        let upright = read_sized("cameras.csv", &table(), None, Some([480, 640])).unwrap();
        assert_eq!((upright.fx, upright.cx), (480.0, 245.9));
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        let size = Some([640, 480]);
        let changed = |from: &str, to: &str| table().replacen(from, to, 1);
        for (text, size, expected) in [
            (table(), None, "no size of its pictures"),
            (
                changed("0,0,0.02", "0,0.5,0.02"),
                size,
                "1 of 2 pictures have another",
            ),
            (
                table().replace("0,0,0.02", "0,0.5,0.02"),
                size,
                "`k4` is 0.5",
            ),
            (changed("90,0,27", "90,0,x"), size, "csv:3: \"x\" is not"),
            (
                changed("0.02,0.01\n", "0.02\n"),
                size,
                "csv:3: fewer columns",
            ),
            (
                table().replace(",f,", ",g,"),
                size,
                "not a calibration known",
            ),
            (HEADER.to_owned(), size, "holds no camera"),
        ] {
            let message = read_sized("cameras.csv", &text, None, size).unwrap_err();
            assert!(message.to_string().contains(expected), "{message}");
        }
    }
}
