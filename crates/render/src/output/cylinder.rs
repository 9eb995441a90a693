//! Cylindrical projection of one photo.

use crate::sampling::picture::Picture;
use crate::sampling::sample::{Sample, Samples};
use image::DynamicImage;
use rayon::prelude::*;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::numerics::kernel::{Interpolation, Kernel};

/// A photo on the unit cylinder around its camera, unrolled.
#[derive(Clone, Debug)]
pub struct CylinderPicture {
    /// Picture, with alpha 0 outside the photo.
    pub image: DynamicImage,
    /// `û` of the first column and `v̂` of the first row, pixels: where the crop begins.
    pub origin_px: [i64; 2],
}

/// Projects a photo onto the cylinder of radius 1 around the camera's y axis, with square pixels of
/// the photo's own focal length:
///
/// `û = fx θ + cx`, `v̂ = fy h + cy`, `θ = atan x`, `h = y / √(x² + 1)`, `x = (u − cx)/fx`,
/// `y = (v − cy)/fy` (pixels, radians, and lengths in units of the radius).
///
/// Each pixel of the result is taken back by `x = tan θ`, `y = h √(x² + 1)`. The result is cropped
/// to what the photo covers. `photo` must be as large as the camera's pictures.
///
/// Source: arXiv 1806.10278, Section III.
pub fn project(photo: &Picture, camera: &Camera, interpolation: Interpolation) -> CylinderPicture {
    let [left, right, top, bottom] = extent(camera);
    // Rounding errors do not cost a row or a column.
    let (ceil, floor) = (
        |value: f64| (value - 1e-9).ceil() as i64,
        |value: f64| (value + 1e-9).floor() as i64,
    );
    let (first_u, first_v) = (ceil(left), ceil(top));
    let width = (floor(right) - first_u + 1).max(1) as usize;
    let height = (floor(bottom) - first_v + 1).max(1) as usize;
    let kernel = Kernel::new(interpolation, 1.0);
    let (origin, size) = ([first_u, first_v], [width, height]);
    let channels = photo.format().channels;
    let samples: Samples = match (photo.samples(), channels) {
        (Samples::Eight(_), 1) => unroll::<u8, 1>(photo, camera, &kernel, origin, size).into(),
        (Samples::Eight(_), _) => unroll::<u8, 3>(photo, camera, &kernel, origin, size).into(),
        (Samples::Sixteen(_), 1) => unroll::<u16, 1>(photo, camera, &kernel, origin, size).into(),
        (Samples::Sixteen(_), _) => unroll::<u16, 3>(photo, camera, &kernel, origin, size).into(),
    };
    let image = samples.into_image([width as u32, height as u32], channels);
    // The photo's outermost points may lie between two columns of the result, and reach no whole
    // row.
    let [x, y, width, height] = covered(&image);
    CylinderPicture {
        image: image.crop_imm(x, y, width, height),
        origin_px: [origin[0] + i64::from(x), origin[1] + i64::from(y)],
    }
}

/// Box around all pixels that are not transparent: first column and row, width and height; all of
/// the picture if there are none.
fn covered(image: &DynamicImage) -> [u32; 4] {
    let (mut from, mut to) = ([u32::MAX; 2], [0; 2]);
    for (x, y, pixel) in image.to_luma_alpha8().enumerate_pixels() {
        if pixel[1] > 0 {
            from = [from[0].min(x), from[1].min(y)];
            to = [to[0].max(x + 1), to[1].max(y + 1)];
        }
    }
    if from[0] < to[0] {
        [from[0], from[1], to[0] - from[0], to[1] - from[1]]
    } else {
        [0, 0, image.width(), image.height()]
    }
}

/// Focal lengths on the axis along u and v, pixels: the radius of the cylinder.
fn focal_lengths(camera: &Camera) -> [f64; 2] {
    [camera.fx, camera.fy].map(|focal_px| focal_px * camera.lens.axis_scale())
}

/// Maps a pixel of the photo to the unrolled cylinder; `None` where the lens shows nothing.
pub fn to_cylinder(camera: &Camera, u: f64, v: f64) -> Option<[f64; 2]> {
    let ray = camera.ray(u, v)?;
    let theta = ray.x.atan2(ray.z);
    let h = ray.y / ray.x.hypot(ray.z);
    let [fx, fy] = focal_lengths(camera);
    Some([fx * theta + camera.cx, fy * h + camera.cy])
}

/// Maps a pixel of the unrolled cylinder to the photo; `None` where the lens shows nothing, behind
/// a pinhole for one.
pub fn from_cylinder(camera: &Camera, u_hat: f64, v_hat: f64) -> Option<[f64; 2]> {
    let [fx, fy] = focal_lengths(camera);
    let theta = (u_hat - camera.cx) / fx;
    if theta.abs() >= std::f64::consts::PI {
        return None;
    }
    let h = (v_hat - camera.cy) / fy;
    let (sin, cos) = theta.sin_cos();
    let pixel = camera.project(&nalgebra::Vector3::new(sin, h, cos))?;
    Some([pixel.x, pixel.y])
}

/// Points along each of a photo's edges that are mapped to find the cylinder's extent. A higher
/// value is more exact for lenses with strong distortion.
const STEPS_PER_EDGE: usize = 64;

/// Smallest and largest û, smallest and largest v̂ of the photo's pixel centres.
///
/// They lie on the photo's border: û and v̂ are smooth and one-to-one.
fn extent(camera: &Camera) -> [f64; 4] {
    let mut border = camera.border(STEPS_PER_EDGE, 0.0);
    // Without distortion h has its extremes at the sides and in the column where x is nearest to
    // zero.
    let last = [camera.width - 1, camera.height - 1].map(f64::from);
    let middle = from_cylinder(camera, camera.cx.round(), camera.cy).map_or(0.0, |[u, _]| u);
    let middle = middle.clamp(0.0, last[0]);
    border.extend([0.0, last[1]].map(|v| nalgebra::Vector2::new(middle, v)));
    let mut extent = [
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::INFINITY,
        f64::NEG_INFINITY,
    ];
    for [u_hat, v_hat] in border
        .iter()
        .filter_map(|pixel| to_cylinder(camera, pixel.x, pixel.y))
    {
        extent = [
            extent[0].min(u_hat),
            extent[1].max(u_hat),
            extent[2].min(v_hat),
            extent[3].max(v_hat),
        ];
    }
    extent
}

fn unroll<T: Sample, const C: usize>(
    photo: &Picture,
    camera: &Camera,
    kernel: &Kernel,
    origin: [i64; 2],
    [width, height]: [usize; 2],
) -> Vec<T> {
    let mut pixels = vec![T::default(); width * height * (C + 1)];
    pixels
        .par_chunks_exact_mut(width * (C + 1))
        .enumerate()
        .for_each(|(row, out)| {
            let v_hat = (origin[1] + row as i64) as f64;
            for (column, pixel) in out.chunks_exact_mut(C + 1).enumerate() {
                let u_hat = (origin[0] + column as i64) as f64;
                let seen = from_cylinder(camera, u_hat, v_hat)
                    .filter(|[u, v]| camera.is_in_image(&nalgebra::Vector2::new(*u, *v), -1e-9));
                if let Some([u, v]) = seen {
                    let value = photo.at(u as f32, v as f32, kernel);
                    for (sample, value) in pixel.iter_mut().take(C).zip(value) {
                        *sample = T::nearest(value);
                    }
                    pixel[C] = T::nearest(T::WHITE);
                }
            }
        });
    pixels
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera::from_vertical_fov(161, 121, 60f64.to_radians())
    }

    #[test]
    fn the_two_maps_are_inverse() {
        let camera = camera();
        for (u, v) in [(0.0, 0.0), (160.0, 30.0), (80.0, 60.0), (17.5, 119.25)] {
            let [u_hat, v_hat] = to_cylinder(&camera, u, v).unwrap();
            let [again_u, again_v] = from_cylinder(&camera, u_hat, v_hat).unwrap();
            assert!((again_u - u).abs() < 1e-9 && (again_v - v).abs() < 1e-9);
        }
        assert!(from_cylinder(&camera, camera.cx + 2.0 * camera.fx, 0.0).is_none());
    }

    /// Section III by hand: the corner of a 60° photo.
    #[test]
    fn a_corner_lands_where_the_equations_say() {
        let camera = camera();
        let f = 60.5 / 30f64.to_radians().tan();
        let x: f64 = -80.0 / f;
        let [u_hat, v_hat] = to_cylinder(&camera, 0.0, 0.0).unwrap();
        assert!((u_hat - (f * x.atan() + 80.0)).abs() < 1e-9);
        assert!((v_hat - (-60.0 / (x * x + 1.0).sqrt() + 60.0)).abs() < 1e-9);
    }

    #[test]
    fn the_crop_is_tight_and_the_middle_column_stays() {
        let camera = camera();
        let data: Vec<u8> = (0..161 * 121).map(|k| (k / 161) as u8).collect();
        let photo = Picture::new(161, 121, 1, data);
        let cylinder = project(&photo, &camera, Interpolation::Bicubic);
        let image = cylinder.image.to_luma_alpha8();
        // At θ = 0 rows are kept: v̂ = v, from the first to the last.
        assert_eq!(image.height(), 121);
        assert_eq!(cylinder.origin_px[1], 0);
        let middle = (80 - cylinder.origin_px[0]) as u32;
        for row in 0..121 {
            assert_eq!(image.get_pixel(middle, row).0, [row as u8, 255]);
        }
        // Each side column is covered somewhere, its corner is not.
        for column in [0, image.width() - 1] {
            assert_eq!(image.get_pixel(column, 0).0, [0, 0]);
            assert_eq!(image.get_pixel(column, 60).0[1], 255);
        }
    }
}
