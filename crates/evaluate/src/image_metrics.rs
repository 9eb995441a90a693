//! Similarity of two panoramas: PSNR and SSIM.

use crate::error::EvaluateError;
use crate::ssim::sum_of_ssim;
use serde::{Deserialize, Serialize};
use tunnelstitch_render::Panorama;

/// Similarity of two panoramas over the pixels that both cover.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ImageMetrics {
    /// Peak signal-to-noise ratio `10 log₁₀(255² / MSE)`, decibels; `None` if the panoramas are
    /// equal or have no pixel in common.
    pub psnr_db: Option<f64>,
    /// Mean structural similarity, at most 1; `None` if no 11 × 11 window is covered by both.
    pub ssim: Option<f64>,
    /// Number of pixels that both cover.
    pub pixels: usize,
}

/// Compares two panoramas of one canvas by their grey values (luma of colour).
///
/// Only pixels that both cover count; SSIM counts only windows that are covered entirely.
///
/// # Errors
/// [`EvaluateError::Canvas`] if the canvases differ in size.
pub fn image_metrics(first: &Panorama, second: &Panorama) -> Result<ImageMetrics, EvaluateError> {
    let (grey_a, covered_a) = first.grey();
    let (grey_b, covered_b) = second.grey();
    let size_a = [grey_a.width(), grey_a.height()];
    let size_b = [grey_b.width(), grey_b.height()];
    if size_a != size_b {
        return Err(EvaluateError::Canvas {
            first: size_a,
            second: size_b,
        });
    }
    let both: Vec<bool> = covered_a
        .iter()
        .zip(&covered_b)
        .map(|(a, b)| *a && *b)
        .collect();
    let (mut squares, mut pixels) = (0.0, 0usize);
    for ((a, b), both) in grey_a.data().iter().zip(grey_b.data()).zip(&both) {
        if *both {
            squares += f64::from(a - b).powi(2);
            pixels += 1;
        }
    }
    let psnr_db = (squares > 0.0).then(|| 10.0 * (255.0 * 255.0 * pixels as f64 / squares).log10());
    let (sum, windows) = sum_of_ssim(grey_a.data(), grey_b.data(), &both, grey_a.width());
    Ok(ImageMetrics {
        psnr_db,
        ssim: (windows > 0).then(|| sum / windows as f64),
        pixels,
    })
}

#[cfg(test)]
mod tests {
    use super::super::test_pictures::pictures;
    use super::*;
    use tunnelstitch_core::progress::Silent;
    use tunnelstitch_core::test_wall::{TestWall, waves};
    use tunnelstitch_geometry::trajectory::Shutter;
    use tunnelstitch_render::{
        Canvas, Mode, Picture, PictureCache, RenderOptions, place_frames, render,
    };

    fn panorama(wall: &TestWall, mut stack: PictureCache, ppm: f64) -> Panorama {
        let placements =
            place_frames(&wall.circle, wall.camera, &wall.poses, &Shutter::default()).unwrap();
        let canvas = Canvas::of_placements(&wall.circle, &placements, ppm).unwrap();
        render(
            &wall.circle,
            &mut stack,
            &placements,
            &canvas,
            &RenderOptions {
                mode: Mode::Average,
                blend: false,
                ..RenderOptions::default()
            },
            &Silent,
        )
        .unwrap()
    }

    #[test]
    fn equal_panoramas_are_similar_and_brighter_ones_have_the_psnr_of_the_difference() {
        let wall = TestWall::one(waves);
        let flat = |value: u8| {
            let (w, h) = (wall.camera.width as usize, wall.camera.height as usize);
            let picture = Picture::new(w, h, 1, vec![value; w * h]);
            panorama(
                &wall,
                PictureCache::from_pictures(wall.camera, vec![picture]),
                50.0,
            )
        };
        let same = image_metrics(&flat(100), &flat(100)).unwrap();
        assert_eq!(same.psnr_db, None);
        assert!((same.ssim.unwrap() - 1.0).abs() < 1e-9);
        assert!(same.pixels > 1000);
        let brighter = image_metrics(&flat(100), &flat(105)).unwrap();
        let expected = 20.0 * (255.0f64 / 5.0).log10();
        assert!((brighter.psnr_db.unwrap() - expected).abs() < 1e-9);
        assert!(brighter.ssim.unwrap() < 1.0);
    }

    #[test]
    fn different_canvases_are_refused() {
        let wall = TestWall::one(waves);
        let error = image_metrics(
            &panorama(&wall, pictures(&wall), 50.0),
            &panorama(&wall, pictures(&wall), 40.0),
        );
        assert!(matches!(error, Err(EvaluateError::Canvas { .. })));
    }
}
