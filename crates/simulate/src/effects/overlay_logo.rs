//! Logo of a burnt-in overlay.

/// Diameter of the logo, a share of the frame's height.
const DIAMETER: f64 = 0.16;
/// Distance of the logo from the upper and the right border, a share of the frame's height.
const MARGIN: f64 = 0.03;
/// Outer radius of the rim, and of the disc within it, as shares of the logo's radius.
const RINGS: [f64; 2] = [1.0, 0.8];
/// Grey levels of the rim, of the disc and of the arch on it.
const TONES: [f32; 3] = [235.0, 45.0, 200.0];

/// Grey level of the logo at a pixel of frames of `width × height` pixels: a disc with a rim and
/// the arch of a tunnel, in the upper right corner. `None` beside it.
pub(super) fn logo_grey(width: usize, height: usize, u: usize, v: usize) -> Option<f32> {
    let radius = 0.5 * DIAMETER * height as f64;
    let from_border = MARGIN * height as f64 + radius;
    let x = (u as f64 - (width as f64 - 0.5 - from_border)) / radius;
    let y = (v as f64 - (from_border - 0.5)) / radius;
    let distance = x.hypot(y);
    // The arch: a half ring above, two straight legs below.
    let aside = if y < 0.0 { distance } else { x.abs() };
    let is_arch = (0.3..0.55).contains(&aside) && y < 0.5;
    if distance > RINGS[0] {
        None
    } else if distance > RINGS[1] {
        Some(TONES[0])
    } else if is_arch {
        Some(TONES[2])
    } else {
        Some(TONES[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn the_logo_is_a_disc_in_the_upper_right_corner() {
        let (width, height) = (640, 480);
        let pixels = (0..width * height).map(|k| (k % width, k / width));
        let inside: Vec<(usize, usize)> = pixels
            .filter(|(u, v)| logo_grey(width, height, *u, *v).is_some())
            .collect();
        let area = PI * (0.08 * 480.0f64).powi(2);
        assert!((inside.len() as f64 / area - 1.0).abs() < 0.02);
        let right = inside
            .iter()
            .all(|(u, v)| *u > 540 && *u < 628 && *v < 93 && *v > 12);
        assert!(right);
        let tones = inside
            .iter()
            .filter_map(|(u, v)| logo_grey(width, height, *u, *v));
        let arch = tones.filter(|tone| *tone == TONES[2]).count();
        assert!(arch > inside.len() / 20, "{arch}");
    }
}
