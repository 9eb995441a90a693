//! Cameras as COLMAP and nerfstudio write them.

use super::Pinhole;
use serde_json::{Map, Value, json};

/// A camera model of COLMAP with its parameters; pixels count from the corner of the first, whose centre is (½, ½).
///
/// Source: COLMAP's documentation, "Camera Models"; nerfstudio has the names of COLMAP's models.
#[derive(Clone, Debug, PartialEq)]
pub struct ColmapCamera {
    /// Name of the model.
    pub model: &'static str,
    /// Width of the image, pixels.
    pub width: u32,
    /// Height of the image, pixels.
    pub height: u32,
    /// Names and values of the parameters, in the model's order.
    pub parameters: Vec<(&'static str, f64)>,
}

impl ColmapCamera {
    /// `PINHOLE` for a lens without distortion, else `OPENCV` (k1, k2, and no tangential distortion p1, p2).
    pub fn of(camera: &Pinhole) -> Self {
        let mut parameters = vec![
            ("fx", camera.fx),
            ("fy", camera.fy),
            ("cx", camera.cx + 0.5),
            ("cy", camera.cy + 0.5),
        ];
        let model = if camera.radial.is_none() {
            "PINHOLE"
        } else {
            let (k1, k2) = (camera.radial.k1, camera.radial.k2);
            parameters.extend([("k1", k1), ("k2", k2), ("p1", 0.0), ("p2", 0.0)]);
            "OPENCV"
        };
        Self {
            model,
            width: camera.width,
            height: camera.height,
            parameters,
        }
    }

    /// The text of a `cameras.txt` with this camera alone, number 1.
    pub fn cameras_txt(&self) -> String {
        let values: Vec<String> = self.parameters.iter().map(|(_, v)| v.to_string()).collect();
        format!(
            "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n\
             # Number of cameras: 1\n1 {} {} {} {}\n",
            self.model,
            self.width,
            self.height,
            values.join(" ")
        )
    }

    /// The keys of the camera in nerfstudio's `transforms.json`.
    pub fn nerfstudio(&self) -> Map<String, Value> {
        let mut keys = Map::new();
        keys.insert("camera_model".to_owned(), json!(self.model));
        keys.insert("w".to_owned(), json!(self.width));
        keys.insert("h".to_owned(), json!(self.height));
        for (name, value) in &self.parameters {
            let name = match *name {
                "fx" => "fl_x",
                "fy" => "fl_y",
                name => name,
            };
            keys.insert(name.to_owned(), json!(value));
        }
        keys
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Radial;

    #[test]
    fn pixels_count_from_the_corner() {
        let camera = Pinhole::from_vertical_fov(640, 480, 1.0);
        let colmap = ColmapCamera::of(&camera);
        assert_eq!(colmap.model, "PINHOLE");
        // The middle of the image is half its size.
        assert_eq!(colmap.parameters[2..], [("cx", 320.0), ("cy", 240.0)]);
        let radial = Radial { k1: -0.1, k2: 0.02 };
        let distorted = ColmapCamera::of(&Pinhole { radial, ..camera });
        let text = distorted.cameras_txt();
        assert!(
            text.contains("\n1 OPENCV 640 480 ") && text.ends_with(" 320 240 -0.1 0.02 0 0\n"),
            "{text}"
        );
        assert_eq!(distorted.nerfstudio()["fl_x"], json!(camera.fx));
    }
}
