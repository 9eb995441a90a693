//! Readings of a survey's camera that people get wrong: other focal lengths and other lenses.

use super::calibrate::CalibrationGroup;
use super::open::Survey;
use std::path::Path;
use tunnelstitch_geometry::camera::{BrownCoefficients, Camera, Lens, LensSlip};
use tunnelstitch_geometry::files::limits::MAX_CALIBRATION_BYTES;
use tunnelstitch_geometry::files::{decode_text, read_regular};

/// Focal lengths over the given one that are tried: nearer ones are found by estimating them.
const FOCAL_FACTORS: [f64; 6] = [0.7, 0.79, 0.89, 1.12, 1.26, 1.42];
/// The nearest of these on either side.
const NEAREST_FACTORS: [f64; 2] = [0.89, 1.12];
/// Largest ratio of the sizes of pictures that a calibration is of and of the frames.
const MAX_SIZE_RATIO: f64 = 8.0;
/// Smallest fraction of the picture that a lens shows.
const MIN_VISIBLE_FRACTION: f64 = 0.5;

/// A reading of the camera against the one given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CameraReading {
    /// The camera given.
    AsGiven,
    /// Another focal length, over the given one.
    FocalFactor(f64),
    /// Other focal lengths fx and fy, pixels.
    Focal([f64; 2]),
    /// Another principal point, pixels.
    Centre([f64; 2]),
    /// A calibration of pictures of another size, whose sides are so many times those of the
    /// frames.
    OfSize(f64),
    /// Another lens.
    Lens(Lens),
}

impl CameraReading {
    /// The camera of the reading, `given` the one of the survey.
    pub fn camera(&self, given: &Camera) -> Camera {
        match *self {
            Self::AsGiven => *given,
            Self::FocalFactor(factor) => Camera {
                fx: factor * given.fx,
                fy: factor * given.fy,
                ..*given
            },
            Self::Focal([fx, fy]) => Camera { fx, fy, ..*given },
            Self::Centre([cx, cy]) => Camera { cx, cy, ..*given },
            Self::OfSize(ratio) => given.resampled([given.width, given.height], [1.0 / ratio; 2]),
            Self::Lens(lens) => Camera { lens, ..*given },
        }
    }
}

impl Survey {
    /// Readings of the camera that people get wrong, each with its remedy.
    pub(super) fn camera_readings(&self) -> Vec<(String, CameraReading)> {
        let mut readings: Vec<_> = self.other_focal_lengths().collect();
        if let Some(file) = &self.file.camera.first().file {
            readings.extend(self.other_lenses(file));
            readings.extend(other_intrinsics(self.cameras.of(0), file));
        }
        readings
    }

    /// Other focal lengths than given, beyond those that refining searches by itself.
    fn other_focal_lengths(&self) -> impl Iterator<Item = (String, CameraReading)> {
        let section = self.file.calibrate.as_ref();
        let searched =
            section.filter(|section| section.unknowns.contains(&CalibrationGroup::Focal));
        let reach = searched.map_or(0.0, |section| 0.02 * section.focal_sigma_percent);
        let factors = FOCAL_FACTORS.into_iter();
        let beyond = factors.filter(move |factor: &f64| factor.ln().abs() > reach);
        beyond.map(|factor| {
            let remedy = format!(
                "a focal length of about {factor} times the given one (unknowns = [\"focal\"] \
                 and focal_sigma_percent = 20 under [calibrate])"
            );
            (remedy, CameraReading::FocalFactor(factor))
        })
    }

    /// Other lenses whose coefficients may be those of the calibration `file`.
    fn other_lenses(&self, file: &Path) -> impl Iterator<Item = (String, CameraReading)> {
        let given = self.cameras.of(0);
        let reading = move |slip: LensSlip| {
            let lens = slip.meant(&given.lens)?;
            let reading = CameraReading::Lens(lens);
            let is_possible = reading.camera(given).visible_fraction() >= MIN_VISIBLE_FRACTION;
            is_possible.then(|| (remedy(slip, &lens, &self.folder, file), reading))
        };
        LensSlip::ALL.into_iter().filter_map(reading)
    }
}

/// The calibration of pictures of another size, where its principal point is their middle; focal
/// lengths of square pixels, where those given differ by more than the nearest factor that is
/// tried, and principal points that are as near to the middle as none given is: it swapped, and the
/// middle itself, where the one given is in the outer half of the picture.
fn other_intrinsics(given: &Camera, file: &Path) -> Vec<(String, CameraReading)> {
    let name = file.display();
    let mut readings = Vec::new();
    let (fx, fy) = (given.fx, given.fy);
    if !(NEAREST_FACTORS[0]..NEAREST_FACTORS[1]).contains(&(fx / fy)) {
        for focal in [fx, fy] {
            let remedy = format!("square pixels (fx = fy = {} in {name})", rounded(focal));
            readings.push((remedy, CameraReading::Focal([focal; 2])));
        }
    }
    let middle = [given.width, given.height].map(|size| 0.5 * f64::from(size - 1));
    // In halves of the picture's sides.
    let off = |[cx, cy]: [f64; 2]| {
        let sides = [(cx - middle[0]) / middle[0], (cy - middle[1]) / middle[1]];
        sides[0].abs().max(sides[1].abs())
    };
    let own = [given.cx, given.cy];
    let swapped = [given.cy, given.cx];
    let mut add = |[cx, cy]: [f64; 2], what: &str| {
        let values = format!("cx = {}, cy = {}", rounded(cx), rounded(cy));
        let remedy = format!("the principal point {what} ({values} in {name})");
        readings.push((remedy, CameraReading::Centre([cx, cy])));
    };
    if off(swapped) < 0.5 * off(own) {
        add(swapped, "with cx and cy swapped");
    }
    if off(own) > 0.5 {
        add(middle, "near the middle of the picture");
    }
    readings.extend(of_another_size(given, file));
    readings
}

/// A calibration of larger or smaller pictures, if its principal point is the middle of some of the
/// same shape. The ratio of sizes is one of quarters: 1.5, 2, 2.25, or their inverses.
fn of_another_size(given: &Camera, file: &Path) -> Option<(String, CameraReading)> {
    let sides = [given.width, given.height].map(f64::from);
    let own = [2.0 * given.cx + 1.0, 2.0 * given.cy + 1.0];
    let [x, y] = [own[0] / sides[0], own[1] / sides[1]];
    let mean = 0.5 * (x + y);
    let is_near = |ratio: f64| (NEAREST_FACTORS[0]..NEAREST_FACTORS[1]).contains(&ratio);
    let is_possible = (1.0 / MAX_SIZE_RATIO..=MAX_SIZE_RATIO).contains(&mean);
    if !is_possible || !is_near(x / y) || is_near(mean) {
        return None;
    }
    let quarters = |ratio: f64| (4.0 * ratio).round() / 4.0;
    let ratio = match mean > 1.0 {
        true => quarters(mean),
        false => 1.0 / quarters(1.0 / mean),
    };
    let [width, height] = sides.map(|side| (ratio * side).round());
    let remedy = format!(
        "a calibration of pictures of {width} × {height} px (as their width and height in {}, \
         and it is scaled to the frames)",
        file.display()
    );
    Some((remedy, CameraReading::OfSize(ratio)))
}

/// The lens that was meant, and the lines of the calibration `file` that give it.
fn remedy(slip: LensSlip, meant: &Lens, folder: &Path, file: &Path) -> String {
    let name = file.display();
    match slip {
        LensSlip::FisheyeAsPinhole => {
            let line = model_line(meant, &folder.join(file));
            format!("a fisheye with the given coefficients ({line} in {name})")
        }
        LensSlip::PinholeAsFisheye => {
            let line = model_line(meant, &folder.join(file));
            format!("a lens that is no fisheye with the given coefficients ({line} in {name})")
        }
        LensSlip::OppositeSign => {
            let values = coefficients(meant);
            format!("a radial distortion with the other sign ({values} in {name})")
        }
        LensSlip::Inverse => {
            let values = coefficients(meant);
            format!("the inverse of the given radial distortion ({values} in {name})")
        }
        LensSlip::RadialFirst => in_order("given as k1 k2 k3 p1 p2", meant, file),
        LensSlip::TangentialInside => in_order("given as OpenCV's k1 k2 p1 p2 k3", meant, file),
        LensSlip::TangentialSwapped => in_order("given with p2 before p1", meant, file),
    }
}

/// Coefficients that are `given` in another order than they are read in, and their values by name;
/// a file that lists them without names has OpenCV's order.
fn in_order(given: &str, meant: &Lens, file: &Path) -> String {
    let (values, name) = (coefficients(meant), file.display());
    let extension = file.extension().unwrap_or_default().to_string_lossy();
    let order = match &*extension.to_lowercase() {
        "yaml" | "yml" | "xml" => ", in the order k1 k2 p1 p2 k3",
        _ => "",
    };
    format!("distortion coefficients that are {given} ({values} in {name}{order})")
}

/// The entry of a calibration file that names the model of a lens.
fn model_line(meant: &Lens, path: &Path) -> String {
    let is_fisheye = matches!(meant, Lens::KannalaBrandt(_));
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    match &*extension.to_lowercase() {
        "yaml" | "yml" => yaml_line(is_fisheye, &content(path)),
        "txt" | "bin" => colmap_line(is_fisheye, &content(path)),
        "toml" => format!("model = \"{}\" with {}", meant.name(), coefficients(meant)),
        _ => format!(
            "\"model\": \"{}\" with {}",
            meant.name(),
            coefficients(meant)
        ),
    }
}

/// The text of a calibration file; empty if it is none.
fn content(path: &Path) -> String {
    let bytes = read_regular(path, MAX_CALIBRATION_BYTES).unwrap_or_default();
    decode_text(&bytes).unwrap_or_default()
}

/// The line for the YAML of ROS and Kalibr, which names the model, or for that of OpenCV.
fn yaml_line(is_fisheye: bool, text: &str) -> String {
    match (text.contains("distortion_model"), is_fisheye) {
        (true, true) => "distortion_model: equidistant".to_owned(),
        (true, false) => "distortion_model: plumb_bob".to_owned(),
        (false, _) => format!("fisheye_model: {}", u8::from(is_fisheye)),
    }
}

/// COLMAP's model with as many parameters as the one in the file.
fn colmap_line(is_fisheye: bool, text: &str) -> String {
    let mut of_file = ["SIMPLE_RADIAL", "RADIAL"].into_iter();
    let model = of_file.find(|model| text.contains(model));
    let model = model.unwrap_or("OPENCV");
    let ending = if is_fisheye { "_FISHEYE" } else { "" };
    format!("the model {model}{ending}")
}

/// The coefficients of a lens by their names.
fn coefficients(lens: &Lens) -> String {
    let values: Vec<(&str, f64)> = match lens {
        Lens::BrownConrady(lens) => {
            let BrownCoefficients { k, p } = *lens.coefficients();
            let names = ["k1", "k2", "k3", "p1", "p2"];
            names
                .into_iter()
                .zip([k[0], k[1], k[2], p[0], p[1]])
                .collect()
        }
        Lens::KannalaBrandt(lens) => {
            let names = ["k1", "k2", "k3", "k4"];
            names.into_iter().zip(*lens.coefficients()).collect()
        }
        _ => Vec::new(),
    };
    let rounded = values
        .into_iter()
        .map(|(name, value)| (name, rounded(value)));
    let given = rounded.filter(|(_, value)| *value != 0.0);
    let texts: Vec<String> = given
        .map(|(name, value)| format!("{name} = {value}"))
        .collect();
    if texts.is_empty() {
        "no coefficients".to_owned()
    } else {
        texts.join(", ")
    }
}

/// A coefficient to eight decimals, without the digits of binary fractions.
fn rounded(value: f64) -> f64 {
    (value * 1e8).round() / 1e8
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Square pixels with the principal point near the middle ask for nothing.
    #[test]
    fn intrinsics_that_fit_no_picture_have_other_readings() {
        let right = Camera::from_vertical_fov(160, 120, 1.0);
        let others = |change: fn(&mut Camera)| -> Vec<CameraReading> {
            let mut camera = right;
            change(&mut camera);
            let readings = other_intrinsics(&camera, Path::new("camera.json")).into_iter();
            readings.map(|(_, reading)| reading).collect()
        };
        assert_eq!(others(|_| ()), []);
        assert_eq!(others(|camera| (camera.cx, camera.cy) = (85.0, 55.0)), []);
        let middle = CameraReading::Centre([79.5, 59.5]);
        assert_eq!(
            others(|camera| (camera.cx, camera.cy) = (59.5, 79.5)),
            [middle]
        );
        assert_eq!(
            others(|camera| (camera.cx, camera.cy) = (0.0, 0.0)),
            [middle]
        );
        // Calibrated with pictures of twice the size.
        let twice = others(|camera| *camera = CameraReading::OfSize(0.5).camera(camera));
        assert!(twice.contains(&CameraReading::OfSize(2.0)), "{twice:?}");
        let fx = right.fx;
        let square = [fx, 1.5 * fx].map(|focal| CameraReading::Focal([focal; 2]));
        assert_eq!(others(|camera| camera.fy *= 1.5), square);
    }

    #[test]
    fn the_line_suits_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let fisheye = Lens::KannalaBrandt(tunnelstitch_geometry::camera::KannalaBrandt::new([
            0.1, -0.02, 0.0, 0.0,
        ]));
        let line = |name: &str, text: &str| {
            std::fs::write(dir.path().join(name), text).unwrap();
            model_line(&fisheye, &dir.path().join(name))
        };
        assert_eq!(line("a.yml", "distCoeffs: 1"), "fisheye_model: 1");
        let ros = line("a.yaml", "distortion_model: plumb_bob");
        assert_eq!(ros, "distortion_model: equidistant");
        let json = "\"model\": \"kannala-brandt\" with k1 = 0.1, k2 = -0.02";
        assert_eq!(line("camera.json", "{}"), json);
        let colmap = line("cameras.txt", "1 OPENCV 64 48 50 50 32 24 0.1 0 0 0\n");
        assert_eq!(colmap, "the model OPENCV_FISHEYE");
        let radial = line("cameras.txt", "1 RADIAL 64 48 50 32 24 0.1 -0.02\n");
        assert_eq!(radial, "the model RADIAL_FISHEYE");
    }
}
