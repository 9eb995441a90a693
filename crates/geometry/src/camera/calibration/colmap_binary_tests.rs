//! Tests of `cameras.bin`.

use super::read_calibration;
use crate::camera::projection::Camera;

/// A camera of the file: id, number of the model, size, parameters.
type Record<'a> = (u32, i32, [u64; 2], &'a [f64]);

fn bytes(cameras: &[Record]) -> Vec<u8> {
    let mut bytes = (cameras.len() as u64).to_le_bytes().to_vec();
    for (id, model, size, parameters) in cameras {
        bytes.extend(id.to_le_bytes());
        bytes.extend(model.to_le_bytes());
        bytes.extend(size.iter().flat_map(|side| side.to_le_bytes()));
        bytes.extend(parameters.iter().flat_map(|value| value.to_le_bytes()));
    }
    bytes
}

fn read(name: &str, content: &[u8], id: Option<&str>) -> Result<Camera, String> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, content).unwrap();
    read_calibration(&path, id).map_err(|error| error.to_string())
}

/// Every model that is supported is the camera of the text model.
#[test]
fn text_and_binary_are_the_same_camera() {
    let fisheye = [500.0, 502.0, 320.0, 240.0, -0.01, 5e-3, -4e-3, 7e-4];
    let thin = [1e-3, -2e-3, 3e-4, -5e-4];
    let thin = [&fisheye[..6], &thin[..2], &[1e-3, -2e-3], &thin[2..]].concat();
    let full = [&fisheye[..6], &[1e-3, -2e-3, 1e-3, 0.1, 0.02, 1e-3]].concat();
    let [f, fx, cx, cy] = [500.0, 500.0, 320.0, 240.0];
    let cases: [(i32, &str, &[f64]); 13] = [
        (0, "SIMPLE_PINHOLE", &[f, cx, cy]),
        (1, "PINHOLE", &[f, fx, cx, cy]),
        (2, "SIMPLE_RADIAL", &[f, cx, cy, -0.1]),
        (3, "RADIAL", &[f, cx, cy, -0.1, 0.01]),
        (4, "OPENCV", &[f, fx, cx, cy, -0.1, 0.01, 1e-3, -2e-3]),
        (5, "OPENCV_FISHEYE", &fisheye),
        (6, "FULL_OPENCV", &full),
        (7, "FOV", &[f, fx, cx, cy, 0.93]),
        (8, "SIMPLE_RADIAL_FISHEYE", &[f, cx, cy, -0.01]),
        (9, "RADIAL_FISHEYE", &[f, cx, cy, -0.01, 1e-3]),
        (10, "THIN_PRISM_FISHEYE", &thin),
        (16, "EUCM", &[f, fx, cx, cy, 0.63, 1.04]),
        (1, "PINHOLE", &[600.0, 601.5, 311.25, 250.125]),
    ];
    for (number, model, parameters) in cases {
        let words: Vec<String> = parameters.iter().map(f64::to_string).collect();
        let text = format!("3 {model} 640 480 {}\n", words.join(" "));
        let binary = bytes(&[(3, number, [640, 480], parameters)]);
        let expected = read("cameras.txt", text.as_bytes(), None).unwrap();
        assert_eq!(read("cameras.bin", &binary, None), Ok(expected), "{model}");
    }
}

#[test]
fn several_cameras_are_selected_by_id() {
    let records: [Record; 2] = [
        (4, 0, [640, 480], &[500.0, 320.0, 240.0]),
        (9, 0, [320, 240], &[250.0, 160.0, 120.0]),
    ];
    let content = bytes(&records);
    assert_eq!(read("c.bin", &content, Some("9")).unwrap().width, 320);
    let message = read("c.bin", &content, None).unwrap_err();
    assert!(message.contains("several cameras (4, 9)"), "{message}");
}

#[test]
fn damaged_files_are_refused_at_their_byte() {
    let parameters = [500.0, 320.0, 240.0];
    let whole = bytes(&[(1, 0, [640, 480], &parameters)]);
    for length in 0..whole.len() {
        let message = read("c.bin", &whole[..length], None).unwrap_err();
        assert!(message.contains("byte "), "{length}: {message}");
    }
    let longer = [&whole[..], &[0]].concat();
    let huge = [&u64::MAX.to_le_bytes()[..], &whole[8..]].concat();
    let of = |number, size, parameters| bytes(&[(1, number, size, parameters)]);
    let cases = [
        (longer, "byte 56: 1 bytes follow"),
        (huge, "byte 0: 18446744073709551615 entries"),
        (of(99, [640, 480], &parameters), "model number 99"),
        (of(-1, [640, 480], &parameters), "model number -1"),
        (of(0, [u64::MAX, 480], &parameters), "number of pixels"),
        (of(0, [640, 480], &[f64::NAN, 320.0, 240.0]), "is NaN"),
        (of(17, [640, 480], &[0.0, 0.0]), "EQUIRECTANGULAR is not"),
        (bytes(&[]), "holds no camera"),
    ];
    for (content, expected) in cases {
        let message = read("c.bin", &content, None).unwrap_err();
        assert!(message.contains(expected), "{message}");
    }
}
