//! The panorama: inverse warp and feathered mean.

use super::{
    Canvas, FrameStack, Interpolation, Panorama, Picture, Placement, RenderError, Tile, tiles,
};
use crate::camera::Pinhole;
use crate::progress::Progress;
use crate::surface::Surface;
use nalgebra::{Matrix3, Vector2, Vector3};
use rayon::prelude::*;

/// Draws the canvas from placed frames.
///
/// Each pixel centre is taken to its wall point `x_w`, to every frame by `x_c = R_wcᵀ (x_w − t_wc)` and the
/// camera's projection, and gets `Σ w_i I_i(u_i, v_i) / Σ w_i` over the frames that see it, with the feather
/// `w = tent(u) tent(v)` that falls linearly from 1 in the middle of the frame to zero at its outer edge. A
/// pixel that no frame sees is a hole: transparent.
///
/// Frames are added in their order, so the bytes do not depend on the number of threads.
///
/// # Errors
/// [`RenderError::Count`] unless there is one placement per frame.
pub fn render(
    surface: &dyn Surface,
    frames: &FrameStack,
    placements: &[Placement],
    canvas: &Canvas,
    interpolation: Interpolation,
    progress: &dyn Progress,
) -> Result<Panorama, RenderError> {
    let pictures = frames.pictures();
    if pictures.len() != placements.len() {
        return Err(RenderError::Count {
            poses: placements.len(),
            frames: pictures.len(),
        });
    }
    let views: Vec<View> = pictures
        .iter()
        .zip(placements)
        .map(|(picture, placement)| View::new(frames.camera(), picture, placement))
        .collect();
    let channels = frames.channels();
    let bytes = channels + 1;
    let stride = canvas.columns as usize * bytes;
    let mut pixels = vec![0u8; canvas.pixels() * bytes];
    let bands = tiles(surface, canvas, placements);
    progress.start("panorama", bands.iter().map(Vec::len).sum());
    let mut rest = pixels.as_mut_slice();
    let mut jobs = Vec::with_capacity(bands.len());
    for band in bands {
        let rows = band.first().map_or(0, |tile| tile.rows as usize);
        let (rows, below) = rest.split_at_mut(rows * stride);
        rest = below;
        jobs.push((band, rows));
    }
    jobs.into_par_iter().for_each(|(band, rows)| {
        let drawn: Vec<Vec<u8>> = band
            .par_iter()
            .map(|tile| {
                let points = tile.points(surface, canvas);
                let drawn = match channels {
                    1 => draw::<1>(tile, &points, &views, interpolation),
                    _ => draw::<3>(tile, &points, &views, interpolation),
                };
                progress.advance(1);
                drawn
            })
            .collect();
        for (tile, drawn) in band.iter().zip(&drawn) {
            let (start, length) = (tile.column as usize * bytes, tile.columns as usize * bytes);
            for (row, source) in rows
                .chunks_exact_mut(stride)
                .zip(drawn.chunks_exact(length))
            {
                row[start..start + length].copy_from_slice(source);
            }
        }
    });
    progress.finish();
    Ok(Panorama::new(*canvas, channels, pixels))
}

/// A frame ready to be looked up.
struct View<'a> {
    camera: &'a Pinhole,
    picture: &'a Picture,
    r_cw: Matrix3<f64>,
    t_cw: Vector3<f64>,
}

impl<'a> View<'a> {
    fn new(camera: &'a Pinhole, picture: &'a Picture, placement: &Placement) -> Self {
        let r_cw = placement
            .pose
            .r_wc
            .inverse()
            .to_rotation_matrix()
            .into_inner();
        Self {
            camera,
            picture,
            r_cw,
            t_cw: -(r_cw * placement.pose.t_wc),
        }
    }

    /// The pixel that shows `x_w`, if this frame sees it.
    #[inline]
    fn pixel(&self, x_w: &Vector3<f64>) -> Option<Vector2<f64>> {
        let x_c = self.r_cw * x_w + self.t_cw;
        self.camera
            .project(&x_c)
            .filter(|pixel| self.camera.sees(pixel, 0.0))
    }

    /// `tent(u) tent(v)`: 1 in the middle, falling to 0 half a pixel beyond the outermost pixel centres.
    #[inline]
    fn feather(&self, pixel: &Vector2<f64>) -> f32 {
        let tent = |u: f64, width: u32| {
            let width = f64::from(width);
            (u + 0.5).min(width - 0.5 - u) * (2.0 / width)
        };
        (tent(pixel.x, self.camera.width) * tent(pixel.y, self.camera.height)) as f32
    }
}

/// The pixels of one tile: `C` samples and alpha each.
fn draw<const C: usize>(
    tile: &Tile,
    points: &[Vector3<f64>],
    views: &[View],
    interpolation: Interpolation,
) -> Vec<u8> {
    let mut sums = vec![[0f32; C]; points.len()];
    let mut weights = vec![0f32; points.len()];
    for frame in &tile.frames {
        let view = &views[*frame];
        for ((x_w, sum), weight) in points.iter().zip(&mut sums).zip(&mut weights) {
            let Some(pixel) = view.pixel(x_w) else {
                continue;
            };
            let w = view.feather(&pixel);
            let value: [f32; C] = view.picture.sample(pixel.x, pixel.y, interpolation);
            for (sum, value) in sum.iter_mut().zip(value) {
                *sum += w * value;
            }
            *weight += w;
        }
    }
    let mut pixels = Vec::with_capacity(points.len() * (C + 1));
    for (sum, weight) in sums.iter().zip(&weights) {
        if *weight > 0.0 {
            // The cast saturates: a cubic overshoots at edges.
            pixels.extend(sum.map(|sum| (sum / weight).round() as u8));
            pixels.push(u8::MAX);
        } else {
            pixels.extend([0; C]);
            pixels.push(0);
        }
    }
    pixels
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Silent;
    use crate::render::{Layout, StitchOptions, on_the_axis, place};
    use crate::test_wall::{self, TestWall};

    fn draw_wall(wall: &TestWall, ppm: f64) -> Panorama {
        let placements = place(&wall.circle, &wall.camera, &wall.poses).unwrap();
        let canvas = Canvas::of_placements(&wall.circle, &placements, ppm).unwrap();
        let stack = wall.stack();
        render(
            &wall.circle,
            &stack,
            &placements,
            &canvas,
            Interpolation::Bicubic,
            &Silent,
        )
        .unwrap()
    }

    /// The golden test: off-centre, turned cameras; the texture is known everywhere.
    #[test]
    fn the_panorama_is_the_texture() {
        let wall = TestWall::ring(test_wall::waves);
        let panorama = draw_wall(&wall, 60.0);
        let canvas = *panorama.canvas();
        let (grey, covered) = panorama.grey();
        let (mut squares, mut count, mut worst) = (0.0, 0usize, 0f64);
        for row in 0..canvas.rows {
            for column in 0..canvas.columns {
                let at = row as usize * canvas.columns as usize + column as usize;
                if covered[at] {
                    let error = f64::from(grey.data()[at])
                        - test_wall::waves(canvas.wall(column, row), wall.perimeter_m());
                    squares += error * error;
                    worst = worst.max(error.abs());
                    count += 1;
                }
            }
        }
        assert!(count * 10 > canvas.pixels() * 7, "{count} pixels covered");
        // Frames and panorama are rounded to whole grey levels: 0.29 each where one frame sees the wall.
        let rms = (squares / count as f64).sqrt();
        assert!(rms < 0.45, "{rms} grey levels");
        assert!(worst < 2.0, "{worst} grey levels");
        // Across θ = 0 the step is the texture's own.
        let mut across = 0;
        for row in 0..canvas.rows as usize {
            let (first, last) = (
                row * canvas.columns as usize,
                (row + 1) * canvas.columns as usize - 1,
            );
            if covered[first] && covered[last] {
                across += 1;
                let step = test_wall::waves(canvas.wall(0, row as u32), wall.perimeter_m())
                    - test_wall::waves(
                        canvas.wall(canvas.columns - 1, row as u32),
                        wall.perimeter_m(),
                    );
                let drawn = f64::from(grey.data()[first] - grey.data()[last]);
                assert!((drawn - step).abs() < 2.0);
            }
        }
        assert!(
            across > canvas.rows / 2,
            "{across} rows covered across the wrap"
        );
    }

    #[test]
    fn a_mark_on_the_wall_is_not_mirrored_and_chainage_right_is_a_turn() {
        // Bright towards larger θ and larger h from the point that the first camera looks at.
        let wall = TestWall::one(|point, perimeter_m| {
            let s = crate::surface::shortest_arc(point.s_m, perimeter_m);
            if s > 0.0 && point.h_m > 0.0 {
                250.0
            } else if s > 0.0 {
                150.0
            } else {
                50.0
            }
        });
        let panorama = draw_wall(&wall, 60.0);
        let (columns, rows) = (panorama.canvas().columns, panorama.canvas().rows);
        let upright = panorama.clone().into_image(Layout::ThetaRight).to_luma8();
        assert_eq!(upright.dimensions(), (columns, rows));
        let near = 20;
        // Just right of θ = 0, lower half: bright. Upper half: middling. Left of it (the last columns): dark.
        assert_eq!(upright.get_pixel(near, rows * 3 / 4).0, [250]);
        assert_eq!(upright.get_pixel(near, rows / 4).0, [150]);
        assert_eq!(upright.get_pixel(columns - near, rows / 4).0, [50]);
        let turned = panorama.into_image(Layout::ChainageRight).to_luma8();
        assert_eq!(turned.dimensions(), (rows, columns));
        for (x, y, pixel) in turned.enumerate_pixels() {
            assert_eq!(pixel, upright.get_pixel(columns - 1 - y, x));
        }
    }

    #[test]
    fn what_no_frame_sees_is_transparent() {
        let wall = TestWall::one(|_, _| 200.0);
        let panorama = draw_wall(&wall, 30.0);
        let columns = panorama.canvas().columns;
        let rows = panorama.canvas().rows;
        assert!(panorama.coverage() > 0.1 && panorama.coverage() < 0.3);
        let image = panorama.into_image(Layout::ThetaRight).to_luma_alpha8();
        assert_eq!(image.get_pixel(0, rows / 2).0, [200, 255]);
        assert_eq!(image.get_pixel(columns / 2, rows / 2).0, [0, 0]);
    }

    #[test]
    fn the_bytes_do_not_depend_on_the_threads() {
        let wall = TestWall::ring(test_wall::waves);
        let draw = |threads| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap()
                .install(|| draw_wall(&wall, 50.0))
        };
        assert!(draw(1) == draw(2));
    }

    #[test]
    fn colour_frames_give_the_same_picture_in_colour() {
        let wall = TestWall::one(test_wall::waves);
        let stack = wall.stack();
        let colour = stack
            .pictures()
            .iter()
            .map(|picture| picture.clone().into_colour())
            .collect();
        let colour = FrameStack::from_pictures(wall.camera, colour);
        let placements = place(&wall.circle, &wall.camera, &wall.poses).unwrap();
        let canvas = Canvas::of_placements(&wall.circle, &placements, 40.0).unwrap();
        let draw = |stack| {
            render(
                &wall.circle,
                stack,
                &placements,
                &canvas,
                StitchOptions::default().interpolation,
                &Silent,
            )
            .unwrap()
            .into_image(Layout::ThetaRight)
        };
        let (grey, colour) = (draw(&stack), draw(&colour));
        assert_eq!(colour.color(), image::ColorType::Rgba8);
        assert_eq!(grey.color(), image::ColorType::La8);
        assert_eq!(grey.to_rgba8(), colour.to_rgba8());
    }

    /// The paper's zoom effect: an off-centre camera that is treated as centred puts the wall elsewhere.
    #[test]
    fn ignoring_the_offset_moves_the_camera_to_the_axis_only() {
        let wall = TestWall::ring(test_wall::waves);
        for (pose, moved) in wall.poses.iter().zip(on_the_axis(&wall.poses)) {
            assert_eq!((moved.t_wc.x, moved.t_wc.z), (0.0, 0.0));
            assert_eq!((moved.t_wc.y, moved.r_wc), (pose.t_wc.y, pose.r_wc));
        }
    }
}
