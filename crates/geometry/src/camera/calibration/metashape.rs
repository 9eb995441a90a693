//! The sensors of Metashape's cameras in XML.
//!
//! `u = w / 2 + cx + (f + b1) x' + b2 y'`, `v = h / 2 + cy + f y'`, pixels counted from the corner
//! of the first, with `x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸) + p1 (r² + 2 x²) + 2 p2 x y` and
//! y' likewise: p1 and p2 are OpenCV's p2 and p1. Of a fisheye, x and y are the ideal image's of an
//! equidistant lens. Source: "Agisoft Metashape User Manual", appendix "Camera models".

use super::coefficients::{brown_conrady, kannala_brandt, thin_prism_fisheye};
use super::error::ParseError;
use super::selection::select_camera;
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;
use crate::files::xml::{child, children, numbers, parse};
use roxmltree::Node;

/// Reads the calibration of a sensor, whose name is its id, or the one of a file of its own, as
/// "Camera Calibration" saves it.
pub fn read(text: &str, name: Option<&str>) -> Result<Camera, ParseError> {
    let document = parse(text).map_err(ParseError::new)?;
    if document.root_element().has_tag_name("calibration") {
        return camera(document.root_element());
    }
    let chunks = children(document.root_element(), "chunk");
    let sensors = chunks.filter_map(|chunk| child(chunk, "sensors"));
    let sensors = sensors.flat_map(|sensors| children(sensors, "sensor"));
    let calibrated = sensors.filter_map(|sensor| {
        let id = sensor.attribute("id").unwrap_or_default();
        Some((id.to_owned(), calibration(sensor)?))
    });
    let calibrated: Vec<_> = calibrated.collect();
    if calibrated.is_empty() {
        return Err(ParseError::new(
            "this XML holds no calibrated sensor of Metashape",
        ));
    }
    camera(select_camera(calibrated, name)?)
}

/// The calibration of a sensor: the adjusted one, or the only one.
fn calibration<'a, 'i>(sensor: Node<'a, 'i>) -> Option<Node<'a, 'i>> {
    let is_adjusted = |node: &Node| node.attribute("class") == Some("adjusted");
    let adjusted = children(sensor, "calibration").find(is_adjusted);
    adjusted.or_else(|| child(sensor, "calibration"))
}

fn camera(calibration: Node) -> Result<Camera, ParseError> {
    let value = |name: &'static str| match child(calibration, name) {
        Some(node) => numbers::<1>(node)
            .map(|[value]| value)
            .map_err(ParseError::new),
        None => Ok(0.0),
    };
    for name in ["b2", "p3", "p4"] {
        if value(name)? != 0.0 {
            return Err(ParseError::new(format!(
                "`{name}` is {}; it is not supported: optimise the cameras without it",
                value(name)?
            )));
        }
    }
    let [k1, k2, k3, k4] = [value("k1")?, value("k2")?, value("k3")?, value("k4")?];
    let [p1, p2] = [value("p2")?, value("p1")?];
    let projection = child(calibration, "projection").and_then(|node| node.text());
    let model = calibration.attribute("type").or(projection);
    let lens: Lens = match model.map_or("frame", str::trim) {
        "frame" if k4 != 0.0 => {
            return Err(ParseError::new(format!(
                "`k4` is {k4}; it is not supported: optimise the cameras without it"
            )));
        }
        "frame" => brown_conrady(&[k1, k2, p1, p2, k3])?,
        "fisheye" if p1 == 0.0 && p2 == 0.0 => kannala_brandt(&[k1, k2, k3, k4])?,
        "fisheye" => thin_prism_fisheye(&[k1, k2, p1, p2, k3, k4, 0.0, 0.0])?,
        other => {
            return Err(ParseError::new(format!(
                "a sensor of type {other:?} is not supported; known are frame and fisheye"
            )));
        }
    };
    let [width, height] = size(calibration)?;
    let [middle_x, middle_y] = [width, height].map(|side| 0.5 * f64::from(side) - 0.5);
    let f = value("f")?;
    Ok(Camera::at_rest(
        [width, height],
        [f + value("b1")?, f],
        [middle_x + value("cx")?, middle_y + value("cy")?],
        lens,
    ))
}

/// Width and height of the pictures, pixels.
fn size(calibration: Node) -> Result<[u32; 2], ParseError> {
    let resolution = child(calibration, "resolution");
    // A file of its own has elements.
    let side = |name: &'static str| match resolution {
        Some(node) => node.attribute(name)?.parse().ok(),
        None => child(calibration, name)?.text()?.trim().parse().ok(),
    };
    match (side("width"), side("height")) {
        (Some(width), Some(height)) => Ok([width, height]),
        _ => Err(ParseError::new(
            "the calibration has no `resolution` with width and height in pixels",
        )),
    }
}

#[cfg(test)]
mod tests {
    use crate::camera::calibration::tests::read_camera;
    use nalgebra::Vector3;

    fn file(kind: &str, parameters: &str) -> String {
        format!(
            r#"<?xml version="1.0"?><document version="2.0.0"><chunk><sensors>
<sensor id="0" label="unknown" type="{kind}"><resolution width="640" height="480"/></sensor>
<sensor id="3" label="Camera" type="{kind}"><resolution width="640" height="480"/>
<calibration type="{kind}" class="initial"><resolution width="640" height="480"/><f>1</f>
</calibration><calibration type="{kind}" class="adjusted"><resolution width="640" height="480"/>
{parameters}</calibration></sensor></sensors></chunk></document>"#
        )
    }

    /// A calibration that is saved alone is that of the sensor.
    #[test]
    fn a_calibration_of_its_own_is_read() {
        let numbers = "<f>500</f><cx>3</cx><cy>-2</cy><k1>-0.1</k1>";
        let alone = format!(
            "<calibration><projection>frame</projection><width>640</width><height>480</height>\
             {numbers}</calibration>"
        );
        let read = |text: &str| read_camera("cameras.xml", text, None).unwrap();
        assert_eq!(read(&alone), read(&file("frame", numbers)));
    }

    fn pixel(kind: &str, parameters: &str, point: [f64; 3]) -> [f64; 2] {
        let camera = read_camera("cameras.xml", &file(kind, parameters), None).unwrap();
        camera.project(&Vector3::from(point)).unwrap().into()
    }

    fn assert_near(a: [f64; 2], b: [f64; 2]) {
        assert!(
            (a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-9,
            "{a:?} {b:?}"
        );
    }

    /// The manual's equations at x = 0.5, y = 0.25, r² = 0.3125; its pixels are half a pixel more.
    #[test]
    fn pixels_are_those_of_the_manual() {
        let parameters = "<f>400</f><cx>3</cx><cy>-2</cy><b1>10</b1><k1>0.1</k1><k2>0.2</k2>\
            <p1>0.01</p1><p2>0.02</p2>";
        // 1 + 0.1 r² + 0.2 r⁴ = 1.05078125; p1 (r² + 2 x²) + 2 p2 x y = 0.008125 + 0.005,
        // p2 (r² + 2 y²) + 2 p1 x y = 0.00875 + 0.0025.
        let (x, y) = (0.5 * 1.05078125 + 0.013125, 0.25 * 1.05078125 + 0.01125);
        assert_near(
            pixel("frame", parameters, [1.0, 0.5, 2.0]),
            [320.0 + 3.0 + 410.0 * x - 0.5, 240.0 - 2.0 + 400.0 * y - 0.5],
        );
        // 45° across: x = θ = π/4, y = 0, r = θ.
        let theta = std::f64::consts::FRAC_PI_4;
        let x = theta * (1.0 + 0.1 * theta.powi(2) + 0.2 * theta.powi(4));
        let (x, y) = (x + 0.01 * 3.0 * theta.powi(2), 0.02 * theta.powi(2));
        assert_near(
            pixel("fisheye", parameters, [1.0, 0.0, 1.0]),
            [322.5 + 410.0 * x, 237.5 + 400.0 * y],
        );
        let plain = "<f>400</f><k1>0.1</k1>";
        let x = theta * (1.0 + 0.1 * theta.powi(2));
        assert_near(
            pixel("fisheye", plain, [1.0, 0.0, 1.0]),
            [319.5 + 400.0 * x, 239.5],
        );
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        let f = "<f>400</f>";
        for (text, expected) in [
            (file("frame", &format!("{f}<b2>0.5</b2>")), "`b2` is 0.5"),
            (file("frame", &format!("{f}<k4>0.5</k4>")), "`k4` is 0.5"),
            (file("frame", "<f>x</f>"), "f holds `x`"),
            (file("frame", ""), "fx is 0"),
            (file("spherical", f), "\"spherical\" is not"),
            (
                file("frame", f).replace("width=", "breadth="),
                "no `resolution`",
            ),
            ("<a/>".to_owned(), "no calibrated sensor"),
            ("<a>".to_owned(), "no valid XML"),
        ] {
            let message = read_camera("c.xml", &text, None).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
