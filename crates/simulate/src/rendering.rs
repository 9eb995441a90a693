//! Rendering of single frames and batches, and of the wall itself.

use crate::effects::darkness::dimming_factor;
use crate::effects::effect_chain::EffectChain;
use crate::effects::sensor::quantise;
use crate::ray_casting::{Scenery, cast_rays};
use crate::scene::Scene;
use crate::wall_raster::{MAX_TEXELS, TexelGrid, WallPaint, WallRaster};
use crate::wall_stretches::{WallStretch, unite};
use crate::wall_view::WallRasters;
use image::DynamicImage;
use tunnelstitch_core::frames::GreyImage;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Maximum points of the texture along each side of a coarse texel.
const MAX_TEXTURE_POINTS: usize = 3;
/// Frames whose light decides how much a dark survey is dimmed.
const MEASURED_FRAMES: usize = 6;

impl Scene {
    /// Renders a frame without faults, sensor noise, tone curve, overlay, rounding and saturation,
    /// in grey levels.
    ///
    /// Wet patches and their reflections, cables, lamps, motion blur, moving objects, vignetting,
    /// the rig's shaft, the lens's faults, flicker, gain and bias are included.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn render_exact(&self, frame: usize) -> GreyImage {
        self.exact_frame(&self.rasters(&self.stretches(frame)), frame)
    }

    /// Renders all frames that exist like [`Self::render_exact`], with `times` as many pixels along
    /// each axis, from the same raster of the wall.
    pub fn render_finer(&self, times: u32) -> Vec<GreyImage> {
        let chain = EffectChain::of_light(&self.options, times, self.dimming);
        let frames_of = |batch: FrameBatch| {
            let rasters = self.rasters(&batch.stretches);
            let finer = |(_, source): &(usize, usize)| {
                let points = self.options.supersample.div_ceil(times);
                chain.apply(*source, self.cast_frame(&rasters, *source, times, points))
            };
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
        let rasters = self.rasters(&self.stretches(source));
        Some(self.digitised_frame(&rasters, source))
    }

    /// Groups consecutive existing frames, so that the wall of each group fits into bounded memory.
    pub(super) fn batches(&self) -> Vec<FrameBatch> {
        self.batches_of(0..self.options.pictures())
    }

    /// Groups those of some frames that exist.
    fn batches_of(&self, frames: impl Iterator<Item = usize>) -> Vec<FrameBatch> {
        let mut batches: Vec<FrameBatch> = Vec::new();
        for frame in frames {
            let Some(source) = self.options.bad_frames.source_frame(frame) else {
                continue;
            };
            let own = self.stretches(source);
            if let Some(FrameBatch { frames, stretches }) = batches.last_mut() {
                let joined = unite(stretches, &own);
                if self.texel_count(&joined) <= MAX_TEXELS {
                    frames.push((frame, source));
                    *stretches = joined;
                    continue;
                }
            }
            batches.push(FrameBatch {
                frames: vec![(frame, source)],
                stretches: own,
            });
        }
        batches
    }

    /// Paints stretches of the lit wall.
    pub(super) fn rasters(&self, stretches: &[WallStretch]) -> WallRasters {
        WallRasters::new(stretches, |stretch| self.paint(stretch))
    }

    /// Paints a stretch of the lit wall.
    pub(super) fn paint(&self, stretch: &WallStretch) -> WallRaster {
        let paint = WallPaint {
            texture: self.texture.as_ref(),
            light: self.options.light,
            wet_patches: self.wet_patches.as_ref(),
        };
        WallRaster::paint(&paint, self.texel_grid(stretch), stretch.h_m)
    }

    /// The texels of a stretch of wall.
    fn texel_grid(&self, stretch: &WallStretch) -> TexelGrid {
        let coarseness = stretch.coarseness();
        let columns = self.columns.div_ceil(coarseness);
        TexelGrid {
            columns,
            texel_m: self.tunnel.perimeter_m() / columns as f64,
            points: coarseness.min(MAX_TEXTURE_POINTS),
        }
    }

    /// Number of texels of stretches of wall.
    pub(super) fn texel_count(&self, stretches: &[WallStretch]) -> usize {
        let texels = stretches.iter().map(|stretch| {
            let grid = self.texel_grid(stretch);
            grid.columns * WallRaster::row_count(stretch.h_m, grid.texel_m)
        });
        texels.sum()
    }

    /// Renders like [`Self::render_exact`], from rasters that hold all the frame sees.
    fn exact_frame(&self, rasters: &WallRasters, frame: usize) -> GreyImage {
        let light = self.cast_frame(rasters, frame, 1, self.options.supersample);
        self.on_light.apply(frame, light)
    }

    /// Casts the rays of a frame with `times` as many pixels along each axis and `points` sample
    /// points along each side of a pixel, shared out between sub-exposures.
    fn cast_frame(
        &self,
        rasters: &WallRasters,
        frame: usize,
        times: u32,
        points: u32,
    ) -> GreyImage {
        let camera = self.cameras().of(frame).upsampled(times);
        let scenery = Scenery {
            tunnel: &self.tunnel,
            wall: rasters.view(&self.stretches(frame)),
            light: self.light(),
            occluders: self.occluders(frame),
        };
        let exposures = self.motion.exposure_times();
        // No fewer points than two along each side, if there are as many.
        let shared = f64::from(points) / (exposures.len() as f64).sqrt();
        let points = (shared.round() as u32).max(points.min(2));
        let mut images = exposures.iter().map(|time| {
            let pose = |row: usize, v: f64| {
                let v = (v + 0.5) / f64::from(times) - 0.5;
                self.motion.pose(frame, row / times as usize, v, *time)
            };
            cast_rays(&scenery, &camera, pose, points)
        });
        let first = images.next();
        let mut sum = first.unwrap_or_else(|| GreyImage::new(0, 0, Vec::new()));
        for image in images {
            for (sum, value) in sum.data_mut().iter_mut().zip(image.data()) {
                *sum += value;
            }
        }
        if exposures.len() > 1 {
            let share = 1.0 / exposures.len() as f32;
            sum.data_mut().iter_mut().for_each(|value| *value *= share);
        }
        sum
    }

    /// Renders a frame with its fault, sensor noise and rounding, from rasters that hold all it
    /// sees. Each frame has its own random stream of sensor noise.
    pub(super) fn digitised_frame(&self, rasters: &WallRasters, frame: usize) -> DynamicImage {
        let exact = self.exact_frame(rasters, frame);
        quantise(&self.in_camera.apply(frame, exact), self.options.bits)
    }

    /// Finds the factor that makes the survey dark, by the light of some of its frames.
    pub(super) fn find_dimming(&self) -> f64 {
        let stride = self.frames().count().div_ceil(MEASURED_FRAMES);
        let light_of = |batch: FrameBatch| {
            let rasters = self.rasters(&batch.stretches);
            let light = |(_, source): &(usize, usize)| {
                let light = self.cast_frame(&rasters, *source, 1, 1);
                self.on_light.apply(*source, light)
            };
            batch.frames.par_map(light)
        };
        let measured = self.batches_of(self.frames().step_by(stride));
        let light: Vec<GreyImage> = measured.into_iter().flat_map(light_of).collect();
        dimming_factor(&light, self.options.effects.gamma.unwrap_or(1.0))
    }

    /// Size of the finest texels, metres.
    pub(super) fn texel_m(&self) -> f64 {
        self.tunnel.perimeter_m() / self.columns as f64
    }
}

/// Frames that are rendered from the same rasters of the wall.
pub(super) struct FrameBatch {
    /// Each frame with the frame whose image it shows.
    pub frames: Vec<(usize, usize)>,
    /// Stretches of wall that they see.
    pub stretches: Vec<WallStretch>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::exposure::GainBias;
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
        let rasters = scene.rasters(&batches[0].stretches);
        for frame in [0, 7] {
            assert_eq!(
                scene.exact_frame(&rasters, frame),
                scene.render_exact(frame)
            );
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
