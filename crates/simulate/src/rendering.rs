//! Rendering of single frames and batches, and of the wall itself.

use crate::fault_injection::inject_fault;
use crate::moving_objects::draw_moving_objects;
use crate::ray_casting::cast_rays;
use crate::scene::Scene;
use crate::sensor::digitise;
use crate::vignetting::Vignetting;
use crate::wall_raster::{BATCH_POINTS, MAX_TEXELS, WallRaster};
use image::DynamicImage;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::f64::consts::TAU;
use tunnelstitch_core::frames::GreyImage;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Number of rows of [`Scene::wall`] that are rendered at a time.
const STRIP_ROWS: usize = 128;

impl Scene {
    /// Renders a frame without sensor noise, faults, rounding and saturation, in grey levels.
    ///
    /// Wet patches and their reflections, cables, lamps, moving objects, vignetting, the rig's
    /// shaft, gain and bias are included.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn render_exact(&self, frame: usize) -> GreyImage {
        self.exact_frame(&self.wall_raster(self.visible_h_m[frame]), frame)
    }

    /// Renders all frames that exist like [`Self::render_exact`], with `times` as many pixels along
    /// each axis, from the same raster of the wall.
    pub fn render_finer(&self, times: u32) -> Vec<GreyImage> {
        let frames_of = |batch: FrameBatch| {
            let raster = self.wall_raster(batch.h_m);
            let finer = |(_, source): &(usize, usize)| self.render_at(&raster, *source, times);
            batch.frames.par_map(finer)
        };
        self.batches().into_iter().flat_map(frames_of).collect()
    }

    /// Renders a frame with all faults, sensor noise and rounding; `None` if it is missing.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn render(&self, frame: usize) -> Option<DynamicImage> {
        let source = self.options.bad_frames.source_frame(frame)?;
        let raster = self.wall_raster(self.visible_h_m[source]);
        Some(self.digitised_frame(&raster, source))
    }

    /// Renders the unrolled wall under its illumination, without specular reflections,
    /// cables and lamps.
    ///
    /// The result has `rows` rows of `columns` square pixels, once around from θ = 0; the first row
    /// begins at chainage `h_start_m` (metres). Each pixel is the mean of points spread over its
    /// square, as many as over a frame's pixel, of the raster that frames are cast from.
    pub fn wall(&self, columns: usize, rows: usize, h_start_m: f64) -> GreyImage {
        let n = self.options.supersample as usize;
        let pixel_m = self.tunnel.perimeter_m() / columns as f64;
        let share = |k: usize| (k as f64 + 0.5) / n as f64;
        let mut data = vec![0.0; columns * rows];
        for (strip, pixels) in data.chunks_mut(columns * STRIP_ROWS).enumerate() {
            let from_m = h_start_m + (strip * STRIP_ROWS) as f64 * pixel_m;
            let raster = self.wall_raster([from_m, from_m + STRIP_ROWS as f64 * pixel_m]);
            let lines = pixels.par_chunks_mut(columns).enumerate();
            lines.for_each(|(row, line)| {
                for (down, across) in (0..n * n).map(|k| (k / n, k % n)) {
                    let h_m = [from_m + (row as f64 + share(down)) * pixel_m; BATCH_POINTS];
                    for (part, pixels) in line.chunks_mut(BATCH_POINTS).enumerate() {
                        let column = |k: usize| (part * BATCH_POINTS + k) as f64 + share(across);
                        let theta: [f64; BATCH_POINTS] =
                            std::array::from_fn(|k| column(k) * TAU / columns as f64);
                        let (mut values, count) = ([0.0; BATCH_POINTS], pixels.len());
                        raster.sample(&theta[..count], &h_m[..count], &mut values);
                        for (pixel, value) in pixels.iter_mut().zip(&values) {
                            *pixel += value;
                        }
                    }
                }
                line.iter_mut().for_each(|pixel| *pixel /= (n * n) as f32);
            });
        }
        GreyImage::new(columns, rows, data)
    }

    /// Groups consecutive existing frames, so that the wall of each group fits into bounded memory.
    pub(super) fn batches(&self) -> Vec<FrameBatch> {
        let mut batches: Vec<FrameBatch> = Vec::new();
        for frame in 0..self.options.frames {
            let Some(source) = self.options.bad_frames.source_frame(frame) else {
                continue;
            };
            let visible = self.visible_h_m[source];
            if let Some(FrameBatch { frames, h_m }) = batches.last_mut() {
                let joined = [h_m[0].min(visible[0]), h_m[1].max(visible[1])];
                if WallRaster::row_count(joined, self.texel_m()) * self.columns <= MAX_TEXELS {
                    frames.push((frame, source));
                    *h_m = joined;
                    continue;
                }
            }
            batches.push(FrameBatch {
                frames: vec![(frame, source)],
                h_m: visible,
            });
        }
        batches
    }

    /// Paints the lit wall between two chainages, metres.
    pub(super) fn wall_raster(&self, h_m: [f64; 2]) -> WallRaster {
        let texture = self.texture.as_ref();
        WallRaster::paint(
            texture,
            self.options.light,
            self.wet_patches.as_ref(),
            self.columns,
            self.texel_m(),
            h_m,
        )
    }

    /// Renders like [`Self::render_exact`], from a raster that holds all the frame sees.
    fn exact_frame(&self, raster: &WallRaster, frame: usize) -> GreyImage {
        self.render_at(raster, frame, 1)
    }

    /// Renders an exact frame with `times` as many pixels along each axis, and correspondingly
    /// fewer sample points per pixel.
    fn render_at(&self, raster: &WallRaster, frame: usize, times: u32) -> GreyImage {
        let options = &self.options;
        let pose = |v: f64| {
            self.path
                .pose_at_row(frame, (v + 0.5) / f64::from(times) - 0.5)
        };
        let (camera, points) = (
            self.camera.upsampled(times),
            options.supersample.div_ceil(times),
        );
        let (tunnel, occluders) = (&self.tunnel, self.occluders(frame));
        let wall = cast_rays(raster, tunnel, &occluders, &camera, pose, points);
        let occluded = draw_moving_objects(options.seed, frame, options.moving, wall);
        let lit = match options.lamp_corner {
            Some(corner) => {
                Vignetting::new(corner, occluded.width(), occluded.height()).apply(occluded)
            }
            None => occluded,
        };
        let with_shaft = match self.shaft() {
            Some(shaft) => shaft.occlude(lit),
            None => lit,
        };
        self.exposure(frame).apply(with_shaft)
    }

    /// Renders a frame with its fault, sensor noise and rounding, from a raster that holds all it
    /// sees. Each frame has its own random stream of sensor noise.
    pub(super) fn digitised_frame(&self, raster: &WallRaster, frame: usize) -> DynamicImage {
        let options = &self.options;
        let exact = self.exact_frame(raster, frame);
        let image = match options.bad_frames.fault(frame) {
            Some(fault) => inject_fault(fault, options.seed, frame, exact),
            None => exact,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        rng.set_stream(1 + frame as u64);
        digitise(&image, options.noise_grey, options.bits, &mut rng)
    }

    /// Size of a texel, metres.
    fn texel_m(&self) -> f64 {
        self.tunnel.perimeter_m() / self.columns as f64
    }
}

/// Frames that are rendered from one raster of the wall.
pub(super) struct FrameBatch {
    /// Each frame with the frame whose image it shows.
    pub frames: Vec<(usize, usize)>,
    /// Minimum and maximum chainage that they see, metres.
    pub h_m: [f64; 2],
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exposure::GainBias;
    use crate::options::{Illumination, SimulateOptions, Wall};
    use tunnelstitch_geometry::camera::Camera;

    fn small() -> SimulateOptions {
        SimulateOptions {
            camera: Camera::from_vertical_fov(80, 60, 60f64.to_radians()),
            frames: 12,
            ..SimulateOptions::free()
        }
    }

    #[test]
    fn noise_has_the_given_sigma() {
        let options = SimulateOptions {
            wall: Wall::Concrete,
            noise_grey: 3.0,
            camera: Camera::from_vertical_fov(200, 150, 60f64.to_radians()),
            ..small()
        };
        let scene = Scene::new(&options).unwrap();
        let noisy = |frame| scene.render(frame).unwrap().into_luma8();
        let (exact, third) = (scene.render_exact(3), noisy(3));
        let squares: f64 = third
            .enumerate_pixels()
            .map(|(u, v, pixel)| {
                f64::from(f32::from(pixel.0[0]) - exact.at(u as usize, v as usize)).powi(2)
            })
            .sum();
        let sigma = (squares / f64::from(third.width() * third.height())).sqrt();
        // Rounding adds 1/12.
        assert!(
            (sigma / (9.0f64 + 1.0 / 12.0).sqrt() - 1.0).abs() < 0.03,
            "{sigma}"
        );
        assert!(noisy(2) != third);
    }

    #[test]
    fn a_frame_does_not_depend_on_the_raster_it_is_cast_from() {
        let scene = Scene::new(&small()).unwrap();
        let batches = scene.batches();
        assert_eq!(batches.len(), 1);
        let raster = scene.wall_raster(batches[0].h_m);
        for frame in [0, 7] {
            assert_eq!(scene.exact_frame(&raster, frame), scene.render_exact(frame));
        }
    }

    /// A pixel is the mean of the finer pixels in its square.
    #[test]
    fn finer_frames_are_of_the_same_points() {
        let scene = Scene::new(&small()).unwrap();
        let fine = &scene.render_finer(4)[5];
        let frame = scene.render_exact(5);
        assert_eq!(
            (fine.width(), fine.height()),
            (4 * frame.width(), 4 * frame.height())
        );
        let mean = |u: usize, v: usize| {
            let square = (0..16).map(|k| fine.at(4 * u + k % 4, 4 * v + k / 4));
            square.sum::<f32>() / 16.0
        };
        let (width, height) = (frame.width(), frame.height());
        let pixels = (0..width * height).map(|k| (k % width, k / width));
        let squares = pixels.map(|(u, v)| (mean(u, v) - frame.at(u, v)).powi(2));
        let rms = (squares.sum::<f32>() / (width * height) as f32).sqrt();
        assert!(rms < 0.05, "{rms}");
    }

    /// At the centre of a frame on the axis, pixels are squares of the wall.
    #[test]
    fn the_wall_agrees_with_the_frames() {
        let options = SimulateOptions {
            wall: Wall::Concrete,
            camera: Camera::from_vertical_fov(161, 121, 60f64.to_radians()),
            ..SimulateOptions::centred()
        };
        let scene = Scene::new(&options).unwrap();
        let frame = scene.render_exact(0);
        let columns = (TAU * scene.camera().fy).round() as usize;
        let pixel_m = TAU * options.tunnel.nominal_m() / columns as f64;
        // The first pixel's middle lies half a pixel off θ = 0.
        let wall = scene.wall(columns, 4, -2.0 * pixel_m);
        for (u, v) in [(0, 1), (2, 2), (3, 0)] {
            let seen: f32 = (0..2)
                .flat_map(|k| (0..2).map(move |l| (k, l)))
                .map(|(k, l)| 0.25 * frame.at(80 + u + k, 58 + v + l))
                .sum();
            assert!(
                (wall.at(u, v) - seen).abs() < 1.0,
                "{} {seen}",
                wall.at(u, v)
            );
        }
    }

    /// The bright side faces θ = 0.
    #[test]
    fn light_falls_from_one_side() {
        let options = SimulateOptions {
            wall: Wall::Concrete,
            ..SimulateOptions {
                camera: Camera::from_vertical_fov(80, 60, 60f64.to_radians()),
                ..SimulateOptions::centred()
            }
        };
        let scene = Scene::new(&options).unwrap();
        let mean = |frame: usize| {
            let data = scene.render_exact(frame);
            data.data().iter().sum::<f32>() / data.data().len() as f32
        };
        assert!(mean(0) > 2.0 * mean(6));
    }

    fn mean(image: &GreyImage) -> f32 {
        image.data().iter().sum::<f32>() / image.data().len() as f32
    }

    #[test]
    fn exposure_is_applied_to_the_noise_free_light() {
        let plain = Scene::new(&small()).unwrap();
        assert_eq!(
            plain.exposure(5),
            GainBias {
                gain: 1.0,
                bias_grey: 0.0
            }
        );
        let scene = Scene::new(&SimulateOptions {
            gain_percent: 30.0,
            bias_grey: 10.0,
            ..small()
        })
        .unwrap();
        let GainBias { gain, bias_grey } = scene.exposure(5);
        let light = plain.render_exact(5);
        for (value, light) in scene.render_exact(5).data().iter().zip(light.data()) {
            let expected = gain * f64::from(*light) + bias_grey;
            assert!((f64::from(*value) - expected).abs() < 1e-3);
        }
        assert!((gain - 1.0).abs() > 1e-3 && scene.exposure(6).gain != gain);
    }

    /// Every degradation changes the image, and none the geometry.
    #[test]
    fn degradations_leave_the_poses_unchanged() {
        let plain = Scene::new(&small()).unwrap();
        let degraded = [
            SimulateOptions {
                lamp_corner: Some(0.5),
                ..small()
            },
            SimulateOptions {
                specular_percent: 10.0,
                ..small()
            },
            SimulateOptions {
                moving: 5,
                ..small()
            },
        ];
        for options in degraded {
            let scene = Scene::new(&options).unwrap();
            assert_eq!(scene.truth(), plain.truth());
            assert_ne!(scene.render_exact(3), plain.render_exact(3), "{options:?}");
            assert_eq!(
                scene.render_exact(3),
                Scene::new(&options).unwrap().render_exact(3)
            );
        }
    }

    /// For a level camera on the axis, the water faces the camera in the middle row of the frame,
    /// and the reflection moves along the wall with the camera.
    #[test]
    fn reflections_stay_before_the_camera_and_move_over_the_wall() {
        let options = SimulateOptions {
            frames: 2,
            turn_deg: 0.0,
            advance_m: 0.5,
            jitter: None,
            light: Illumination::Even,
            ..small()
        };
        let wet = SimulateOptions {
            specular_percent: 40.0,
            ..options.clone()
        };
        let (dry, wet) = (Scene::new(&options).unwrap(), Scene::new(&wet).unwrap());
        for frame in 0..2 {
            let (dry, wet) = (dry.render_exact(frame), wet.render_exact(frame));
            let brighter = |v: usize| {
                let row = (0..80).map(|u| wet.at(u, v) - dry.at(u, v));
                row.fold(f32::MIN, f32::max)
            };
            let middle = (28..32).map(brighter).fold(f32::MIN, f32::max);
            assert!(middle > 60.0, "frame {frame}: {middle}");
            for v in (0..5).chain(55..60) {
                assert!(brighter(v) < 5.0, "frame {frame}, row {v}: {}", brighter(v));
            }
            assert!(mean(&wet) != mean(&dry));
        }
    }

    #[test]
    fn bad_frames_have_faults_and_the_others_are_unchanged() {
        let bad = SimulateOptions {
            bad_frames: "1:black,2:blurred,3:occluded,4:repeated,6-7:missing,8:repeated"
                .parse()
                .unwrap(),
            ..small()
        };
        let (good, bad) = (Scene::new(&small()).unwrap(), Scene::new(&bad).unwrap());
        let there: Vec<usize> = bad.frames().collect();
        assert_eq!(there, [0, 1, 2, 3, 4, 5, 8, 9, 10, 11]);
        for frame in [0, 5, 9] {
            assert_eq!(bad.render(frame), good.render(frame));
        }
        for frame in [1, 2, 3] {
            assert_ne!(bad.render(frame), good.render(frame));
            assert_eq!(bad.render_exact(frame), good.render_exact(frame));
        }
        let black = bad.render(1).unwrap().into_luma8();
        let brightest = black.iter().max().copied().unwrap();
        assert!((3..20).contains(&brightest), "{brightest}");
        assert_eq!(bad.render(4), bad.render(3));
        assert_eq!(bad.render(6), None);
        assert_eq!(bad.render(8), bad.render(5));
        let batched: Vec<(usize, usize)> = bad
            .batches()
            .into_iter()
            .flat_map(|batch| batch.frames)
            .collect();
        assert_eq!(batched.len(), 10);
        assert!(batched.contains(&(4, 3)) && batched.contains(&(8, 5)));
    }
}
