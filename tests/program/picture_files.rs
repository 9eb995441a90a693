//! Picture files as cameras and computers name and write them.

use crate::support::{edit, fail, first_frames, simulate, succeed, text, tunnelstitch};
use image::{DynamicImage, GrayImage};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// The frames of a survey, sorted by name.
fn frames(survey: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(survey.join("frames")).unwrap();
    let mut frames: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    frames.sort();
    frames
}

/// The panorama by the true poses.
fn panorama(survey: &Path) -> DynamicImage {
    let out = survey.join("panorama.png");
    let stitch = ["stitch", text(survey), "--poses", "truth", "--quiet"];
    succeed(&[&stitch[..], &["--px-per-metre", "40", "--out", text(&out)]].concat());
    image::open(out).unwrap()
}

fn check(survey: &Path) -> (Value, String) {
    let output = tunnelstitch(&["check", text(survey), "--json"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    let check: Value = serde_json::from_slice(&output.stdout).unwrap();
    let warnings = check["warnings"].to_string();
    (check, warnings)
}

/// Frames without leading zeros, with what macOS leaves beside them, found by a pattern of Windows.
#[test]
fn frames_are_taken_in_natural_order() {
    let survey = first_frames(12);
    let before = panorama(survey.path());
    for (k, path) in frames(survey.path()).iter().enumerate() {
        let name = format!("frame{}.jpg", k + 1);
        std::fs::write(path.with_file_name(format!("._{name}")), "\0\x05\x16\x07").unwrap();
        std::fs::rename(path, path.with_file_name(name)).unwrap();
    }
    let file = survey.path().join("survey.toml");
    edit(&file, r#""frames/*.jpg""#, r"'frames\*.jpg'");
    assert_eq!(panorama(survey.path()), before);
}

#[test]
fn bits_of_files_of_sixteen_are_found_and_read() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    simulate(
        &survey,
        &["--frames", "4", "--size", "96x72", "--bits", "16"],
    );
    let grey = |survey: &Path| check(survey).0["pictures"]["grey"].as_f64().unwrap();
    let before = grey(&survey);
    for path in frames(&survey) {
        let mut picture = image::open(&path).unwrap().into_luma16();
        picture.pixels_mut().for_each(|pixel| pixel.0[0] >>= 4);
        picture.save(&path).unwrap();
    }
    // They are read so by all commands without a word in survey.toml.
    let (_, warnings) = check(&survey);
    let confirmed = "bits = 12 under [frames] confirms it";
    assert!(warnings.contains(confirmed), "{warnings}");
    assert!((grey(&survey) - before).abs() < 0.1);
    let mean = |picture: &DynamicImage| {
        let values = picture.to_luma8().into_raw();
        let shown: Vec<f64> = values
            .iter()
            .filter(|v| **v > 0)
            .map(|v| f64::from(*v))
            .collect();
        shown.iter().sum::<f64>() / shown.len() as f64
    };
    let drawn = mean(&panorama(&survey));
    assert!((drawn - before).abs() < 0.2 * before, "{drawn} {before}");
    let file = survey.join("survey.toml");
    edit(&file, "[frames]", "[frames]\nbits = 12");
    let (_, warnings) = check(&survey);
    assert!(!warnings.contains("bits"), "{warnings}");
    assert!((grey(&survey) - before).abs() < 0.1);
    // Values of 8 bits that were saved as numbers of 16.
    for path in frames(&survey) {
        let mut picture = image::open(&path).unwrap().into_luma16();
        picture.pixels_mut().for_each(|pixel| pixel.0[0] >>= 4);
        picture.save(&path).unwrap();
    }
    edit(&file, "bits = 12\n", "");
    assert!((grey(&survey) - before).abs() < 1.0);
    edit(&file, "[frames]", "[frames]\nbits = 8");
    assert!((grey(&survey) - before).abs() < 1.0);
    for path in frames(&survey) {
        let mut picture = image::open(&path).unwrap().into_luma16();
        picture.pixels_mut().for_each(|pixel| pixel.0[0] <<= 4);
        picture.save(&path).unwrap();
    }
    succeed(&["init", text(&survey), "--radius-m", "3", "--force"]);
    let written = std::fs::read_to_string(&file).unwrap();
    assert!(written.contains("\nbits = 12"), "{written}");
    edit(&file, "bits = 12", "bits = 10");
    let output = tunnelstitch(&["check", text(&survey)]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(
        said.contains("frames.bits = 10 allows no more than 1023"),
        "{said}"
    );
}

/// Writes a JPEG file with an EXIF orientation.
fn write_jpeg(path: &Path, picture: &DynamicImage, orientation: u8) {
    let mut bytes = Vec::new();
    let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut bytes, 100);
    picture.write_with_encoder(encoder).unwrap();
    // Marker and length of the segment, a TIFF header, and a directory with one entry.
    let exif = [
        &b"\xff\xe1\0\x22Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0"[..],
        &[orientation, 0, 0, 0, 0, 0, 0],
    ]
    .concat();
    bytes.splice(2..2, exif);
    std::fs::write(path, bytes).unwrap();
}

/// Checks that pictures are the same but for what JPEG loses.
fn assert_equal(a: &GrayImage, b: &GrayImage) {
    assert_eq!(a.dimensions(), b.dimensions());
    let pairs = a.as_raw().iter().zip(b.as_raw());
    let difference: f64 = pairs.map(|(a, b)| f64::from(a.abs_diff(*b))).sum();
    assert!(difference < 1.5 * a.as_raw().len() as f64, "{difference}");
}

#[test]
fn pictures_are_turned_as_exif_says_if_the_calibration_fits_only_that() {
    let survey = first_frames(3);
    let before = panorama(survey.path()).into_luma8();
    // To be turned clockwise.
    for path in frames(survey.path()) {
        let stored = image::open(&path).unwrap().rotate270();
        write_jpeg(&path, &stored, 6);
    }
    let (_, warnings) = check(survey.path());
    assert!(warnings.contains("EXIF orientation (6)") && warnings.contains("which is done"));
    assert_equal(&panorama(survey.path()).into_luma8(), &before);
    let init = ["init", text(survey.path()), "--radius-m", "3", "--force"];
    let file = survey.path().join("survey.toml");
    let given = std::fs::read_to_string(&file).unwrap();
    succeed(&init);
    let written = std::fs::read_to_string(&file).unwrap();
    assert!(written.contains("\norientation = \"exif\""), "{written}");
    let (_, warnings) = check(survey.path());
    assert!(!warnings.contains("EXIF"), "{warnings}");
    std::fs::write(&file, given).unwrap();
    // Upside down, the calibration fits both; the survey says which.
    for path in frames(survey.path()) {
        let upright = image::open(&path).unwrap().rotate90();
        write_jpeg(&path, &upright.rotate180(), 3);
    }
    let (_, warnings) = check(survey.path());
    assert!(warnings.contains("which is not done"), "{warnings}");
    edit(&file, "[frames]", "[frames]\norientation = \"exif\"");
    let (_, warnings) = check(survey.path());
    assert!(!warnings.contains("EXIF"), "{warnings}");
    assert_equal(&panorama(survey.path()).into_luma8(), &before);
}

/// Frames in formats that are not read are named with the command that converts them.
#[test]
fn formats_that_are_not_read_are_named_with_the_conversion() {
    let survey = first_frames(4);
    let folder = survey.path().join("frames");
    let heif = b"\0\0\0\x1cftypheic\0\0\0\0mif1heic";
    for (extension, content, name, command) in [
        (
            "bmp",
            &b"BM\x7a\xe9\x07\0"[..],
            "BMP",
            "mogrify -format png",
        ),
        ("heic", heif, "HEIF or AVIF", "heif-convert"),
        ("dng", DNG, "DNG", "dcraw -T"),
        ("NEF", DNG, "a raw picture", "dcraw -T"),
        ("gif", b"GIF89a\x10\0", "GIF", "mogrify -format png"),
        ("tif", &float_tiff(), "floating point", "gdal_translate"),
    ] {
        for path in frames(survey.path()) {
            std::fs::remove_file(path).unwrap();
        }
        for k in 0..4 {
            std::fs::write(folder.join(format!("{k:06}.{extension}")), content).unwrap();
        }
        let file = survey.path().join("survey.toml");
        let toml = std::fs::read_to_string(&file).unwrap();
        let images = toml
            .lines()
            .find(|line| line.starts_with("images"))
            .unwrap();
        edit(&file, images, &format!("images = \"frames/*.{extension}\""));
        let said = fail(&["check", text(survey.path())], 3);
        for part in ["all 4 frames", "is not read", name, command] {
            assert!(said.contains(part), "no {part} in {said}");
        }
        let pattern = format!("{}/*.{extension}", text(&folder));
        assert!(said.contains(&pattern), "no {pattern} in {said}");
        let init = ["init", text(survey.path()), "--radius-m", "3", "--force"];
        let output = tunnelstitch(&init);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(said.contains(name) && said.contains(command), "{said}");
    }
}

/// A TIFF file whose only tag is the version of DNG.
const DNG: &[u8] = b"II*\0\x08\0\0\0\x01\0\x12\xc6\x01\0\x04\0\0\0\x01\x04\0\0\0\0\0\0";

/// A grey TIFF file of floating point numbers.
fn float_tiff() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut bytes).unwrap();
    let values = vec![0.5f32; 480 * 360];
    encoder
        .write_image::<tiff::encoder::colortype::Gray32Float>(480, 360, &values)
        .unwrap();
    bytes.into_inner()
}

/// Pictures that were turned for display and calibrated so, with poses of the camera as it stored
/// them: the line that reads them so is named and mends it.
#[test]
fn poses_of_a_camera_before_its_pictures_were_turned_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    simulate(&survey, &["--frames", "14", "--size", "160x120"]);
    for path in frames(&survey) {
        let stored = image::open(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        write_jpeg(&path.with_extension("jpg"), &stored, 6);
    }
    edit(&survey.join("survey.toml"), "frames/*.png", "frames/*.jpg");
    let camera = survey.join("camera.json");
    let read = std::fs::read_to_string(&camera).unwrap();
    let mut turned: serde_json::Value = serde_json::from_str(&read).unwrap();
    for (a, b) in [("width", "height"), ("cx", "cy")] {
        let (own, other) = (turned[a].clone(), turned[b].clone());
        (turned[a], turned[b]) = (other, own);
    }
    std::fs::write(&camera, turned.to_string()).unwrap();
    let (checked, warnings) = check(&survey);
    let mend = "camera_axes = \"turned-right\"";
    assert!(warnings.contains("turned-right"), "{warnings}");
    let first = checked["readings"]["readings"][0].as_str().unwrap();
    assert!(first.contains(mend), "{first}");
    edit(
        &survey.join("survey.toml"),
        "[poses]",
        &format!("[poses]\n{mend}"),
    );
    let (checked, _) = check(&survey);
    assert!(checked["readings"].is_null(), "{checked}");
}

/// Of readings that the frames fit alike, the one that EXIF data ask for is named first.
#[test]
fn the_orientation_of_exif_data_is_named_before_others() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    simulate(&survey, &["--frames", "14", "--size", "160x120"]);
    for path in frames(&survey) {
        let stored = image::open(&path).unwrap().rotate180();
        std::fs::remove_file(&path).unwrap();
        write_jpeg(&path.with_extension("jpg"), &stored, 3);
    }
    edit(&survey.join("survey.toml"), "frames/*.png", "frames/*.jpg");
    let (checked, _) = check(&survey);
    let readings = checked["readings"]["readings"].as_array().unwrap();
    assert!(readings.len() > 1, "{readings:?}");
    let first = readings[0].as_str().unwrap();
    assert!(first.contains("orientation = \"exif\""), "{first}");
}
