//! Calibrations: `sensor_msgs/CameraInfo`.

use super::stamp::Header;
use super::topic::Wire;

/// Most coefficients of a lens; OpenCV's longest model has 14.
const MAX_COEFFICIENTS: usize = 64;

/// `sensor_msgs/CameraInfo`: `height`, `width`, `distortion_model`, `D`, `K`, `R`, `P`,
/// `binning_x`, `binning_y`, `roi`.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraInfo {
    /// Height and width of the full picture, pixels.
    pub height: u32,
    /// Width of the full picture, pixels.
    pub width: u32,
    /// The model of the lens.
    pub distortion_model: String,
    /// The coefficients of the lens.
    pub d: Vec<f64>,
    /// The 3 × 3 matrix of the camera, row by row; pixels.
    pub k: [f64; 9],
    /// True if the pictures are a part of the full one, or binned.
    pub is_reduced: bool,
}

impl CameraInfo {
    /// Reads a message.
    ///
    /// # Errors
    /// A message that ends too early, in words.
    pub fn read(message: &[u8], wire: Wire) -> Result<Self, String> {
        let mut fields = wire.fields(message)?;
        Header::read(&mut fields, wire)?;
        let (height, width) = (fields.u32()?, fields.u32()?);
        let distortion_model = fields.text()?.to_owned();
        let d = fields.f64_list(MAX_COEFFICIENTS)?;
        let k = fields.f64s()?;
        // R and P of rectified pictures.
        fields.f64s::<21>()?;
        let binning = [fields.u32()?, fields.u32()?];
        let offset = [fields.u32()?, fields.u32()?];
        let [roi_height, roi_width] = [fields.u32()?, fields.u32()?];
        let is_full =
            matches!((roi_height, roi_width), (0, 0)) || (roi_height, roi_width) == (height, width);
        Ok(Self {
            height,
            width,
            distortion_model,
            d,
            k,
            is_reduced: binning.iter().any(|b| *b > 1) || offset != [0, 0] || !is_full,
        })
    }
}
