//! The cameras of OpenMVG's `sfm_data.json`.
//!
//! The key of its coefficients says which model a camera has: `disto_k1`, `disto_k3` (k1, k2, k3),
//! `disto_t2` (k1, k2, k3, t1, t2), `fisheye` (k1 to k4) or none. The centre of the first pixel is
//! (0, 0).
//! Source: OpenMVG 2.1, `Camera_Pinhole*.hpp`, `Camera_undistort_image.hpp`.

use super::coefficients::{brown_conrady, kannala_brandt};
use super::error::ParseError;
use super::selection::select_camera;
use super::value_tree::{needed, number, numbers, pixels};
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;
use serde_json::Value;

/// True for a file with `sfm_data_version`.
pub fn is_sfm_data(tree: &Value) -> bool {
    tree.get("sfm_data_version").is_some()
}

/// Reads an entry of `intrinsics`, whose name is its key.
pub fn read(tree: &Value, name: Option<&str>) -> Result<Camera, ParseError> {
    let all = needed(tree, "intrinsics")?.as_array().into_iter().flatten();
    let named = |entry: &Value| entry.get("key").map(Value::to_string).unwrap_or_default();
    let cameras = all.map(|entry| (named(entry), entry)).collect();
    let entry = needed(select_camera(cameras, name)?, "value")?;
    camera(needed(needed(entry, "ptr_wrapper")?, "data")?)
}

fn camera(data: &Value) -> Result<Camera, ParseError> {
    let focal = number(data, &["focal_length"])?;
    let centre = numbers(needed(data, "principal_point")?, "principal_point")?;
    let [cx, cy] = centre[..] else {
        return Err(ParseError::new("`principal_point` must be two numbers"));
    };
    let size = [pixels(data, &["width"])?, pixels(data, &["height"])?];
    Ok(Camera::at_rest(size, [focal; 2], [cx, cy], lens(data)?))
}

fn lens(data: &Value) -> Result<Lens, ParseError> {
    for (name, count) in [
        ("disto_k1", 1),
        ("disto_k3", 3),
        ("disto_t2", 5),
        ("fisheye", 4),
    ] {
        let Some(list) = data.get(name) else { continue };
        let d = numbers(list, name)?;
        return match (name, &d[..]) {
            ("disto_k1", [k1]) => brown_conrady(&[*k1, 0.0]),
            ("disto_k3", [k1, k2, k3]) => brown_conrady(&[*k1, *k2, 0.0, 0.0, *k3]),
            ("disto_t2", [k1, k2, k3, t1, t2]) => brown_conrady(&[*k1, *k2, *t1, *t2, *k3]),
            ("fisheye", [_, _, _, _]) => kannala_brandt(&d),
            _ => Err(ParseError::new(format!(
                "`{name}` has {} numbers; it must have {count}",
                d.len()
            ))),
        };
    }
    Ok(Lens::default())
}

#[cfg(test)]
mod tests {
    use crate::camera::calibration::tests::{calibrated, read_camera};
    use crate::camera::kannala_brandt::KannalaBrandt;
    use crate::camera::lens::Lens;
    use nalgebra::Vector3;

    fn file(coefficients: &str) -> String {
        format!(
            r#"{{"sfm_data_version": "0.3", "root_path": "", "views": [], "intrinsics": [{{
                "key": 4, "value": {{"polymorphic_id": 2147483649, "polymorphic_name": "pinhole",
                "ptr_wrapper": {{"id": 2147483649, "data": {{"width": 640, "height": 480,
                "focal_length": 415, "principal_point": [318, 241] {coefficients}}}}}}}}}],
                "extrinsics": [], "structure": []}}"#
        )
    }

    #[test]
    fn coefficients_tell_the_lens() {
        let read = |coefficients| read_camera("sfm_data.json", &file(coefficients), None).unwrap();
        let with = |lens| crate::camera::Camera {
            fy: 415.0,
            ..calibrated(lens)
        };
        assert_eq!(read(""), with(Lens::default()));
        assert_eq!(
            read(r#", "disto_k1": [-0.1]"#),
            with(Lens::radial(-0.1, 0.0))
        );
        let fisheye = KannalaBrandt::new([-0.01, 0.005, -0.004, 0.0007]);
        let of_file = read(r#", "fisheye": [-0.01, 0.005, -0.004, 0.0007]"#);
        assert_eq!(of_file, with(Lens::KannalaBrandt(fisheye)));
        // 1 + k3 r⁶ at r² = 0.3125, and t2 (r² + 2 x²) + 2 t1 x y across.
        let pixel = |coefficients, point: [f64; 3]| {
            read(coefficients).project(&Vector3::from(point)).unwrap().x
        };
        let radial = pixel(r#", "disto_k3": [0, 0, 0.2]"#, [1.0, 0.5, 2.0]);
        assert!((radial - 318.0 - 207.5 * (1.0 + 0.2 * 0.3125f64.powi(3))).abs() < 1e-9);
        let brown = pixel(r#", "disto_t2": [0, 0, 0, 0.02, 0.01]"#, [1.0, 0.5, 2.0]);
        assert!((brown - 318.0 - 415.0 * (0.5 + 0.008125 + 0.005)).abs() < 1e-9);
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        for (text, expected) in [
            (file(r#", "disto_k3": [1]"#), "`disto_k3` has 1 numbers"),
            (
                file("").replace("focal_length", "focal"),
                "`focal_length` is missing",
            ),
            (
                file("").replace("[318, 241]", "[318]"),
                "must be two numbers",
            ),
            (
                r#"{"sfm_data_version": "0.3"}"#.to_owned(),
                "`intrinsics` is missing",
            ),
        ] {
            let message = read_camera("s.json", &text, None).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
        assert!(read_camera("s.json", &file(""), Some("4")).is_ok());
    }
}
