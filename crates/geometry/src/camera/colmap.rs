//! Camera models in COLMAP's and nerfstudio's notation.

use super::brown_conrady::BrownCoefficients;
use super::lens::Lens;
use super::projection::Camera;
use super::thin_prism::ThinPrismCoefficients;
use serde_json::{Map, Value, json};

/// A lens that another program has no model for.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{program} has no lens model {model}")]
pub struct UnknownModelError {
    /// Name of the program.
    pub program: &'static str,
    /// Name of the model.
    pub model: &'static str,
}

/// A camera model of COLMAP with its parameters; pixels count from the corner of the first, whose
/// centre is (½, ½).
///
/// Source: COLMAP's documentation, "Camera Models"; nerfstudio uses the names of COLMAP's models.
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
    /// `PINHOLE` for a lens without distortion, `OPENCV` for k1, k2, p1, p2, `FULL_OPENCV` for
    /// more, `OPENCV_FISHEYE` for a Kannala–Brandt fisheye, `THIN_PRISM_FISHEYE`, `FOV`, `EUCM`.
    /// The largest usable angle is not exported.
    ///
    /// # Errors
    /// [`UnknownModelError`] for the other lenses.
    pub fn of(camera: &Camera) -> Result<Self, UnknownModelError> {
        let mut parameters = vec![
            ("fx", camera.fx),
            ("fy", camera.fy),
            ("cx", camera.cx + 0.5),
            ("cy", camera.cy + 0.5),
        ];
        let model = match &camera.lens {
            Lens::BrownConrady(lens) => {
                let BrownCoefficients {
                    k: [k1, k2, more @ ..],
                    p: [p1, p2],
                } = *lens.coefficients();
                let four = [("k1", k1), ("k2", k2), ("p1", p1), ("p2", p2)];
                if more != [0.0; 4] {
                    parameters.extend(four);
                    parameters.extend(["k3", "k4", "k5", "k6"].into_iter().zip(more));
                    "FULL_OPENCV"
                } else if four.iter().any(|(_, value)| *value != 0.0) {
                    parameters.extend(four);
                    "OPENCV"
                } else {
                    "PINHOLE"
                }
            }
            Lens::KannalaBrandt(lens) => {
                parameters.extend(
                    ["k1", "k2", "k3", "k4"]
                        .into_iter()
                        .zip(*lens.coefficients()),
                );
                "OPENCV_FISHEYE"
            }
            Lens::ThinPrismFisheye(lens) => {
                let ThinPrismCoefficients {
                    k: [k1, k2, k3, k4],
                    p: [p1, p2],
                    s: [sx1, sy1],
                } = *lens.coefficients();
                parameters.extend([("k1", k1), ("k2", k2), ("p1", p1), ("p2", p2)]);
                parameters.extend([("k3", k3), ("k4", k4), ("sx1", sx1), ("sy1", sy1)]);
                "THIN_PRISM_FISHEYE"
            }
            Lens::Fov(lens) => {
                parameters.push(("omega", lens.omega()));
                "FOV"
            }
            Lens::Eucm(lens) => {
                parameters.extend(["alpha", "beta"].into_iter().zip(lens.parameters()));
                "EUCM"
            }
            Lens::Mei(_) | Lens::DoubleSphere(_) | Lens::Ocam(_) => {
                return Err(UnknownModelError {
                    program: "COLMAP",
                    model: camera.lens.name(),
                });
            }
        };
        Ok(Self {
            model,
            width: camera.width,
            height: camera.height,
            parameters,
        })
    }

    /// The text of a `cameras.txt` with this camera only, number 1.
    pub fn cameras_txt(&self) -> String {
        let values: Vec<String> = self.parameters.iter().map(|(_, v)| v.to_string()).collect();
        format!(
            "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, \
             HEIGHT, PARAMS[]\n\
             # Number of cameras: 1\n1 {} {} {} {}\n",
            self.model,
            self.width,
            self.height,
            values.join(" ")
        )
    }

    /// The keys of the camera in nerfstudio's `transforms.json`, whose `OPENCV` includes k3.
    ///
    /// # Errors
    /// [`UnknownModelError`] for a rational lens (k4 to k6) and for models that nerfstudio lacks.
    pub fn nerfstudio(&self) -> Result<Map<String, Value>, UnknownModelError> {
        let rational =
            |(name, value): &(&str, f64)| matches!(*name, "k4" | "k5" | "k6") && *value != 0.0;
        let full = self.model == "FULL_OPENCV";
        let unknown = |model| UnknownModelError {
            program: "nerfstudio",
            model,
        };
        if full && self.parameters.iter().any(rational) {
            return Err(unknown("with k4 to k6"));
        }
        if matches!(self.model, "THIN_PRISM_FISHEYE" | "FOV" | "EUCM") {
            return Err(unknown(self.model));
        }
        let model = if full { "OPENCV" } else { self.model };
        let count = if full { 9 } else { self.parameters.len() };
        let mut keys = Map::new();
        keys.insert("camera_model".to_owned(), json!(model));
        keys.insert("w".to_owned(), json!(self.width));
        keys.insert("h".to_owned(), json!(self.height));
        for (name, value) in self.parameters.iter().take(count) {
            let name = match *name {
                "fx" => "fl_x",
                "fy" => "fl_y",
                name => name,
            };
            keys.insert(name.to_owned(), json!(value));
        }
        Ok(keys)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::brown_conrady::BrownConrady;
    use crate::camera::double_sphere::DoubleSphere;
    use crate::camera::eucm::Eucm;
    use crate::camera::fov::Fov;
    use crate::camera::kannala_brandt::KannalaBrandt;
    use crate::camera::thin_prism::ThinPrismFisheye;

    #[test]
    fn pixels_count_from_the_corner() {
        let camera = Camera::from_vertical_fov(640, 480, 1.0);
        let colmap = ColmapCamera::of(&camera).unwrap();
        assert_eq!(colmap.model, "PINHOLE");
        // The middle of the image is half its size.
        assert_eq!(colmap.parameters[2..], [("cx", 320.0), ("cy", 240.0)]);
        let with = |lens| ColmapCamera::of(&Camera { lens, ..camera }).unwrap();
        let distorted = with(Lens::radial(-0.1, 0.02));
        let text = distorted.cameras_txt();
        assert!(
            text.contains("\n1 OPENCV 640 480 ") && text.ends_with(" 320 240 -0.1 0.02 0 0\n"),
            "{text}"
        );
        assert_eq!(distorted.nerfstudio().unwrap()["fl_x"], json!(camera.fx));
    }

    /// Writing and reading restores the camera.
    #[test]
    fn every_lens_comes_back() {
        let brown = |k, p| Lens::BrownConrady(BrownConrady::new(BrownCoefficients { k, p }));
        let dir = tempfile::tempdir().unwrap();
        let read = |name: &str, text: String| {
            let path = dir.path().join(name);
            std::fs::write(&path, text).unwrap();
            crate::camera::read_calibration(&path, None).unwrap()
        };
        let fisheye = KannalaBrandt::new([-0.01, 0.005, -0.004, 0.0007]);
        let thin_prism = ThinPrismFisheye::new(ThinPrismCoefficients {
            k: [-0.01, 0.005, -0.004, 0.0007],
            p: [1e-3, -2e-3],
            s: [3e-4, -5e-4],
        });
        for (lens, is_unknown) in [
            (Lens::default(), false),
            (brown([-0.3, 0.1, 0.0, 0.0, 0.0, 0.0], [1e-3, -2e-3]), false),
            (
                brown([-0.3, 0.1, -0.02, 0.0, 0.0, 0.0], [1e-3, -2e-3]),
                false,
            ),
            (brown([4.1, 2.0, 0.1, 4.4, 3.1, 0.45], [-4e-4, 6e-4]), true),
            (Lens::KannalaBrandt(fisheye), false),
            (Lens::ThinPrismFisheye(thin_prism.unwrap()), true),
            (Lens::Fov(Fov::new(0.93).unwrap()), true),
            (Lens::Eucm(Eucm::new(0.63, 1.04).unwrap()), true),
        ] {
            let camera = Camera {
                lens,
                ..Camera::from_vertical_fov(640, 480, 1.0)
            };
            let colmap = ColmapCamera::of(&camera).unwrap();
            assert_eq!(read("cameras.txt", colmap.cameras_txt()), camera);
            let keys = colmap.nerfstudio();
            assert_eq!(keys.is_err(), is_unknown);
            if let Ok(keys) = keys {
                assert_eq!(read("transforms.json", json!(keys).to_string()), camera);
            }
        }
    }

    #[test]
    fn a_lens_without_a_model_is_refused_by_name() {
        let camera = Camera {
            lens: Lens::DoubleSphere(DoubleSphere::new(-0.2, 0.6).unwrap()),
            ..Camera::from_vertical_fov(640, 480, 1.0)
        };
        let message = ColmapCamera::of(&camera).unwrap_err().to_string();
        assert_eq!(message, "COLMAP has no lens model double-sphere");
    }
}
