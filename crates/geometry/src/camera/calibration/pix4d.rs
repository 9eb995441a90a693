//! The cameras of Pix4D: `…_calibrated_camera_parameters.txt`, and
//! `…_pix4d_calibrated_internal_camera_parameters.cam`.
//!
//! | file | content |
//! | --- | --- |
//! | `.txt` | after a heading, of each picture its name, width and height, K, k1 k2 k3, t1 t2, position, rotation |
//! | `.cam` | of each camera, with its number, `F`, `Px`, `Py` in millimetres of a sensor whose width and height are stated, `K1`, `K2`, `K3`, `T1`, `T2` |
//!
//! The projection is `K [R | −R t]` with x to the right, y down and z forward; the coefficients are
//! OpenCV's, t1 and t2 its p1 and p2. The principal point is counted from the corner of the first
//! pixel. The second file has no size of the pictures.
//!
//! Source: the heading of the first file; Pix4D, "How are the internal and external camera
//! parameters defined?", "What does the Output Params Folder contain?".

use super::coefficients::brown_conrady;
use super::error::ParseError;
use super::per_picture::select_shared;
use super::picture_size::{PictureSize, needed};
use super::selection::select_camera;
use super::words::{exactly, filled_lines, finite};
use crate::camera::projection::Camera;

/// The first line of the file of pictures.
const PICTURES_TITLE: &str = "fileName imageWidth imageHeight";
/// The last line of its heading.
const HEADING_END: &str = "camera model m";
/// Lines of a picture: name, three of K, two of distortion, position, three of the rotation.
const PICTURE_LINES: usize = 10;
/// Begin of a camera's first line.
const CAM_TITLE: &str = "Pix4D camera calibration file";
/// The words before the size of the sensor.
const SENSOR: &str = "sensor width of";

/// Size, K, radial and tangential distortion of a picture.
#[derive(PartialEq)]
struct Picture {
    size: [u32; 2],
    focal: [f64; 2],
    centre: [f64; 2],
    distortion: [f64; 5],
}

/// True for a text that begins as the file of pictures does.
pub fn is_picture_list(text: &str) -> bool {
    text.trim_start().starts_with(PICTURES_TITLE)
}

/// True for a text that begins as a file of cameras does.
pub fn is_cam(text: &str) -> bool {
    text.trim_start().starts_with(CAM_TITLE)
}

/// Reads the calibration that all pictures share, or that of the picture of this name.
pub fn read_pictures(text: &str, name: Option<&str>) -> Result<Camera, ParseError> {
    let is_heading = |(_, line): &(usize, &str)| !line.starts_with(HEADING_END);
    let lines = filled_lines(text).skip_while(is_heading).skip(1);
    let lines: Vec<(usize, &str)> = lines.collect();
    let pictures: Result<Vec<_>, ParseError> = lines.chunks(PICTURE_LINES).map(picture).collect();
    let picture = select_shared(pictures?, name)?;
    let [k1, k2, k3, t1, t2] = picture.distortion;
    Ok(Camera::at_rest(
        picture.size,
        picture.focal,
        picture.centre.map(|centre| centre - 0.5),
        brown_conrady(&[k1, k2, t1, t2, k3])?,
    ))
}

fn picture(lines: &[(usize, &str)]) -> Result<(String, Picture), ParseError> {
    let &[title, row_u, row_v, _, radial, tangential, ..] = lines else {
        return Err(ParseError::new(
            "the file ends within a picture; it was cut off",
        ));
    };
    let (name, size) = name_and_size(title)?;
    let [fx, skew, cx] = exactly(row_u, "a row of K")?;
    let [_, fy, cy] = exactly(row_v, "a row of K")?;
    if skew != 0.0 {
        let what = format!("the skew is {skew}; it is not supported and must be 0");
        return Err(ParseError::at(row_u.0, what));
    }
    let [k1, k2, k3] = exactly(radial, "the radial distortion")?;
    let [t1, t2] = exactly(tangential, "the tangential distortion")?;
    let picture = Picture {
        size,
        focal: [fx, fy],
        centre: [cx, cy],
        distortion: [k1, k2, k3, t1, t2],
    };
    Ok((name, picture))
}

/// The name of a picture, which may have spaces, and its size.
fn name_and_size((number, line): (usize, &str)) -> Result<(String, [u32; 2]), ParseError> {
    let mut words = line.rsplitn(3, char::is_whitespace);
    let [height, width] = [words.next(), words.next()].map(|word| word?.parse().ok());
    match (words.next(), width, height) {
        (Some(name), Some(width), Some(height)) => Ok((name.trim().to_owned(), [width, height])),
        _ => {
            let what = format!("{line:?} where a picture begins with its name, width and height");
            Err(ParseError::at(number, what))
        }
    }
}

/// Reads the camera of this number, or the only one.
pub fn read_cam(text: &str, name: Option<&str>, size: PictureSize) -> Result<Camera, ParseError> {
    let mut cameras: Vec<(String, Vec<(usize, &str)>)> = Vec::new();
    for (number, line) in filled_lines(text) {
        match (line.strip_prefix(CAM_TITLE), cameras.last_mut()) {
            (Some(id), _) => cameras.push((id.trim().to_owned(), Vec::new())),
            (None, Some((_, lines))) => lines.push((number, line)),
            (None, None) => {}
        }
    }
    cam(&select_camera(cameras, name)?, size)
}

/// The camera of its lines.
fn cam(lines: &[(usize, &str)], size: PictureSize) -> Result<Camera, ParseError> {
    let value = |key: &str| {
        let entry = lines.iter().find_map(|(number, line)| {
            let (own, value) = line.split_once(char::is_whitespace)?;
            (own == key).then_some((*number, value.trim()))
        });
        let missing = || {
            ParseError::new(format!(
                "there is no `{key}`; only perspective lenses are read"
            ))
        };
        let (number, word) = entry.ok_or_else(missing)?;
        finite(word, number)
    };
    let [width_mm, height_mm] = sensor_mm(lines)?;
    let [width, height] = needed(size)?;
    let [px_per_mm_u, px_per_mm_v] = [f64::from(width) / width_mm, f64::from(height) / height_mm];
    let lens = brown_conrady(&[
        value("K1")?,
        value("K2")?,
        value("T1")?,
        value("T2")?,
        value("K3")?,
    ])?;
    Ok(Camera::at_rest(
        [width, height],
        [value("F")? * px_per_mm_u, value("F")? * px_per_mm_v],
        [
            value("Px")? * px_per_mm_u - 0.5,
            value("Py")? * px_per_mm_v - 0.5,
        ],
        lens,
    ))
}

/// Width and height of the sensor, millimetres, as in `… sensor width of 17.5x13.1mm`.
fn sensor_mm(lines: &[(usize, &str)]) -> Result<[f64; 2], ParseError> {
    let stated = lines
        .iter()
        .find_map(|(number, line)| Some((*number, line.split_once(SENSOR)?.1.trim())));
    let missing = || ParseError::new(format!("no line has the `{SENSOR}` its pictures"));
    let (number, words) = stated.ok_or_else(missing)?;
    let words = words.strip_suffix("mm").unwrap_or(words);
    let (width, height) = words.split_once('x').unwrap_or((words, ""));
    let sides = [finite(width, number)?, finite(height, number)?];
    if sides.iter().all(|side| *side > 0.0) {
        return Ok(sides);
    }
    Err(ParseError::at(
        number,
        "the sides of the sensor must be positive",
    ))
}

#[cfg(test)]
mod tests {
    use crate::camera::calibration::tests::read_sized;
    use crate::camera::projection::Camera;
    use nalgebra::Vector3;

    const HEADING: &str = "fileName imageWidth imageHeight \ncamera matrix K [3x3]\n\
        radial distortion [3x1]\ntangential distortion [2x1]\ncamera position t [3x1]\n\
        camera rotation R [3x3]\ncamera model m = K [R|-Rt] X\n\n";
    const NUMBERS: &str = "400 0 323\n0 400 238\n0 0 1\n0.1 0.2 0\n0.01 0.02\n\
        1 2 3\n1 0 0\n0 1 0\n0 0 1\n";
    const CAM: &str = "Pix4D camera calibration file 0\n\
        #Focal Length mm assuming a sensor width of 6.4x4.8mm\nF 4\n#Principal Point mm\nPx 3.23\n\
        Py 2.38\n#Symmetrical Lens Distortion Coeffs\nK1 0.1\nK2 0.2\nK3 0\n\
        #Tangential Lens Distortion Coeffs\nT1 0.01\nT2 0.02\n";

    fn pictures() -> String {
        format!("{HEADING}a b.jpg 640 480\n{NUMBERS}c.jpg 640 480\n{NUMBERS}")
    }

    fn read(name: &str, text: &str) -> Result<Camera, String> {
        read_sized(name, text, None, Some([640, 480])).map_err(|error| error.to_string())
    }

    /// Worked by hand at (0.5, 0.25), r² = 0.3125; both files have the numbers of one camera.
    #[test]
    fn both_files_have_one_camera() {
        for (name, text) in [
            ("a_calibrated_camera_parameters.txt", pictures()),
            ("a.cam", CAM.to_owned()),
        ] {
            let camera = read(name, &text).unwrap();
            let pixel = camera.project(&Vector3::new(1.0, 0.5, 2.0)).unwrap();
            let radial = 1.0 + 0.1 * 0.3125 + 0.2 * 0.3125 * 0.3125;
            let x = 0.5 * radial + 0.0025 + 0.02 * 0.8125;
            let y = 0.25 * radial + 0.01 * 0.4375 + 0.005;
            assert!((pixel.x - (322.5 + 400.0 * x)).abs() < 1e-9, "{pixel}");
            assert!((pixel.y - (237.5 + 400.0 * y)).abs() < 1e-9, "{pixel}");
        }
        let other = pictures().replacen("400 0 323", "401 0 323", 1);
        let chosen = read_sized("a.txt", &other, Some("a b.jpg"), None).unwrap();
        assert_eq!((chosen.fx, chosen.width), (401.0, 640));
        let two = CAM.to_owned() + &CAM.replace("file 0", "file 1").replace("F 4", "F 5");
        let chosen = read_sized("a.cam", &two, Some("1"), Some([640, 480])).unwrap();
        assert_eq!(chosen.fx, 500.0);
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        let changed = |from: &str, to: &str| pictures().replacen(from, to, 1);
        for (name, text, expected) in [
            (
                "a.txt",
                changed("400 0 323", "401 0 323"),
                "1 of 2 pictures have another",
            ),
            (
                "a.txt",
                changed("400 0 323", "400 1 323"),
                "txt:10: the skew is 1",
            ),
            (
                "a.txt",
                changed("0.01 0.02", "0.01"),
                "txt:14: 1 numbers where",
            ),
            (
                "a.txt",
                changed("0.1 0.2 0", "0.1 x 0"),
                "txt:13: \"x\" is not",
            ),
            (
                "a.txt",
                changed("640 480", "640"),
                "txt:9: \"a b.jpg 640\" where",
            ),
            (
                "a.txt",
                format!("{HEADING}a.jpg 640 480\n1 0 1\n"),
                "cut off",
            ),
            ("a.txt", HEADING.to_owned(), "holds no camera"),
            ("a.cam", CAM.replace("F 4", ""), "no `F`"),
            ("a.cam", CAM.replace("F 4", "F x"), "cam:3: \"x\" is not"),
            (
                "a.cam",
                CAM.replace("6.4x4.8", "6.4"),
                "\"\" is not a number",
            ),
            ("a.cam", CAM.replace("6.4x", "0x"), "must be positive"),
            (
                "a.cam",
                CAM.replace("sensor", "chip"),
                "no line has the `sensor",
            ),
            ("a.cam", "hello\n".to_owned(), "not a calibration known"),
        ] {
            let message = read(name, &text).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
        let message = read_sized("a.cam", CAM, None, None)
            .unwrap_err()
            .to_string();
        assert!(message.contains("no size of its pictures"), "{message}");
    }
}
