//! A simulated survey in memory.

use super::band::Band;
use super::caster::{Caster, cast};
use super::noise::derived_seed;
use super::wall::{Texture, texture};
use super::{SimulateError, SimulateOptions};
use crate::camera::Pinhole;
use crate::frames::GreyImage;
use crate::trajectory::{Jitter, Pose, spiral};
use image::GrayImage;
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};
use std::f64::consts::TAU;
use std::ops::Range;

/// How far the wall reaches from a camera along the tunnel, radii.
const REACH_RADII: f64 = 20.0;
/// Texels of a band at the most, four bytes each.
const MOST_TEXELS: usize = 1 << 26;
/// Texels over the width of a pixel where the wall is nearest.
const TEXELS_PER_PIXEL: f64 = 3.0;
/// Largest texel, metres: finer than the joints of bricks.
const LARGEST_TEXEL_M: f64 = 0.004;

/// A tunnel with its camera on its way through.
pub struct Scene {
    options: SimulateOptions,
    camera: Pinhole,
    plan: Vec<Pose>,
    truth: Vec<Pose>,
    /// Least and greatest chainage that each frame sees, metres.
    reaches: Vec<[f64; 2]>,
    texture: Box<dyn Texture>,
    /// Texels once around.
    columns: usize,
}

impl Scene {
    /// Lays out the survey: plan, true poses, wall.
    ///
    /// # Errors
    /// [`SimulateError`] for impossible options, an unusable texture, and true poses outside the tunnel or with a
    /// view along it.
    pub fn new(options: &SimulateOptions) -> Result<Self, SimulateError> {
        options.check()?;
        let camera = Pinhole::from_vertical_fov(
            options.width,
            options.height,
            options.vertical_fov_deg.to_radians(),
        );
        let plan = spiral(
            options.frames,
            options.advance_m,
            options.turn_deg.to_radians(),
        );
        let offset = Vector3::from(options.offset_m);
        let mut truth: Vec<Pose> = plan
            .iter()
            .map(|pose| Pose::new(pose.r_wc, pose.t_wc + offset))
            .collect();
        if let Some(jitter) = options.jitter {
            let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
            truth = Jitter::from(jitter).apply(&truth, &mut rng);
        }
        let reaches = (0..truth.len())
            .map(|frame| reach(frame, &truth[frame], &camera, options.radius_m))
            .collect::<Result<Vec<_>, _>>()?;
        let perimeter_m = TAU * options.radius_m;
        let texel_m = texel_m(options, &camera, &truth);
        let widest = reaches
            .iter()
            .map(|h_m| h_m[1] - h_m[0])
            .fold(0.0, f64::max);
        if perimeter_m / texel_m * widest / texel_m > 4.0 * MOST_TEXELS as f64 {
            return Err(SimulateError::Option {
                what: format!(
                    "a frame would see {perimeter_m:.0} × {widest:.0} m of wall painted in steps of {:.1} mm, which is \
                     more than memory is for; lower the radius, the field of view or the frames' size",
                    1e3 * texel_m
                ),
            });
        }
        Ok(Self {
            texture: texture(&options.wall, derived_seed(options.seed, 0), perimeter_m)?,
            columns: (perimeter_m / texel_m).ceil() as usize,
            options: options.clone(),
            camera,
            plan,
            truth,
            reaches,
        })
    }

    /// The camera.
    pub fn camera(&self) -> &Pinhole {
        &self.camera
    }

    /// The poses as planned: what the survey claims.
    pub fn plan(&self) -> &[Pose] {
        &self.plan
    }

    /// The poses as they are.
    pub fn truth(&self) -> &[Pose] {
        &self.truth
    }

    /// A frame without noise, in grey levels that are not rounded.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn render_exact(&self, frame: usize) -> GreyImage {
        self.exact(&self.band(self.reaches[frame]), frame)
    }

    /// A frame as the sensor delivers it.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn render(&self, frame: usize) -> GrayImage {
        self.noisy(&self.render_exact(frame), frame)
    }

    /// Runs of consecutive frames, each with the chainages it sees, so short that a band of the wall for each fits
    /// into bounded memory.
    pub(super) fn batches(&self) -> Vec<(Range<usize>, [f64; 2])> {
        let mut batches: Vec<(Range<usize>, [f64; 2])> = Vec::new();
        for (frame, reach) in self.reaches.iter().enumerate() {
            if let Some((frames, h_m)) = batches.last_mut() {
                let joined = [h_m[0].min(reach[0]), h_m[1].max(reach[1])];
                if Band::rows(joined, self.texel_m()) * self.columns <= MOST_TEXELS {
                    (frames.end, *h_m) = (frame + 1, joined);
                    continue;
                }
            }
            batches.push((frame..frame + 1, *reach));
        }
        batches
    }

    /// The lit wall between two chainages, metres.
    pub(super) fn band(&self, h_m: [f64; 2]) -> Band {
        let texture = self.texture.as_ref();
        Band::paint(
            texture,
            self.options.light,
            self.columns,
            self.texel_m(),
            h_m,
        )
    }

    /// A frame without noise, of a band that holds all it sees.
    pub(super) fn exact(&self, band: &Band, frame: usize) -> GreyImage {
        let pose = &self.truth[frame];
        cast(
            band,
            self.options.radius_m,
            &self.camera,
            pose,
            self.options.supersample,
        )
    }

    /// Adds the sensor's noise, a stream of its own for every frame, and rounds to whole grey levels.
    pub(super) fn noisy(&self, exact: &GreyImage, frame: usize) -> GrayImage {
        let mut rng = ChaCha8Rng::seed_from_u64(self.options.seed);
        rng.set_stream(1 + frame as u64);
        // A checked option: the noise is finite and not negative.
        let noise = Normal::new(0.0, self.options.noise_grey as f32).ok();
        GrayImage::from_fn(self.camera.width, self.camera.height, |u, v| {
            let noise = noise.map_or(0.0, |noise| noise.sample(&mut rng));
            // The cast saturates.
            image::Luma([(exact.at(u as usize, v as usize) + noise).round() as u8])
        })
    }

    fn texel_m(&self) -> f64 {
        TAU * self.options.radius_m / self.columns as f64
    }
}

/// Least and greatest chainage that a frame sees, metres.
///
/// # Errors
/// [`SimulateError::CameraOutside`], [`SimulateError::LooksAlongTheAxis`].
fn reach(
    frame: usize,
    pose: &Pose,
    camera: &Pinhole,
    radius_m: f64,
) -> Result<[f64; 2], SimulateError> {
    let distance_m = pose.t_wc.x.hypot(pose.t_wc.z);
    if distance_m >= 0.99 * radius_m {
        return Err(SimulateError::CameraOutside {
            frame,
            distance_m,
            radius_m,
        });
    }
    let reach_m = REACH_RADII * radius_m;
    let too_far = SimulateError::LooksAlongTheAxis { frame, reach_m };
    // The axis's vanishing points lie where its directions project to.
    for axis in [Vector3::y(), -Vector3::y()] {
        let x_c = pose.r_wc.inverse_transform_vector(&axis);
        if let Some(pixel) = camera.project(&x_c)
            && camera.sees(&pixel, -1.0)
        {
            return Err(too_far);
        }
    }
    let caster = Caster {
        radius_m,
        t: pose.t_wc,
    };
    let mut reach = [f64::INFINITY, f64::NEG_INFINITY];
    // Without a vanishing point inside, h takes its extremes on the border.
    for pixel in camera.border(64, 0.5) {
        let ray = pose.r_wc * camera.ray(pixel.x, pixel.y);
        let (_, h_m) = caster.hit(&ray);
        reach = [reach[0].min(h_m), reach[1].max(h_m)];
    }
    // The border is followed in steps; 1 % covers what bulges between them.
    let margin_m = 0.01 * (reach[1] - reach[0]);
    let reach = [reach[0] - margin_m, reach[1] + margin_m];
    if reach.iter().all(|h_m| (h_m - pose.t_wc.y).abs() < reach_m) {
        Ok(reach)
    } else {
        Err(too_far)
    }
}

/// Size of a texel: a third of a pixel where a camera comes nearest to the wall, but of one at half the radius at
/// the finest, metres.
fn texel_m(options: &SimulateOptions, camera: &Pinhole, truth: &[Pose]) -> f64 {
    let farthest = truth
        .iter()
        .map(|pose| pose.t_wc.x.hypot(pose.t_wc.z))
        .fold(0.0, f64::max);
    let nearest = (options.radius_m - farthest).max(0.5 * options.radius_m);
    (nearest / camera.fy / TEXELS_PER_PIXEL).min(LARGEST_TEXEL_M)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::Wall;
    use crate::survey::PriorSection;

    fn small() -> SimulateOptions {
        SimulateOptions {
            width: 80,
            height: 60,
            frames: 12,
            ..SimulateOptions::free()
        }
    }

    #[test]
    fn noise_has_the_sigma_asked_for() {
        let options = SimulateOptions {
            wall: Wall::Concrete,
            noise_grey: 3.0,
            width: 200,
            height: 150,
            ..small()
        };
        let scene = Scene::new(&options).unwrap();
        let (exact, noisy) = (scene.render_exact(2), scene.render(2));
        let squares: f64 = noisy
            .enumerate_pixels()
            .map(|(u, v, pixel)| {
                f64::from(f32::from(pixel.0[0]) - exact.at(u as usize, v as usize)).powi(2)
            })
            .sum();
        let sigma = (squares / f64::from(noisy.width() * noisy.height())).sqrt();
        // Rounding adds 1/12.
        assert!(
            (sigma / (9.0f64 + 1.0 / 12.0).sqrt() - 1.0).abs() < 0.03,
            "{sigma}"
        );
        assert!(scene.render(3) != noisy);
    }

    #[test]
    fn a_frame_does_not_depend_on_the_band_it_is_cast_from() {
        let scene = Scene::new(&small()).unwrap();
        let batches = scene.batches();
        assert_eq!(batches.len(), 1);
        let band = scene.band(batches[0].1);
        for frame in [0, 7] {
            assert_eq!(scene.exact(&band, frame), scene.render_exact(frame));
        }
    }

    #[test]
    fn off_centre_frames_stand_where_the_paper_put_them() {
        let scene = Scene::new(&SimulateOptions::off_centre()).unwrap();
        for (planned, real) in scene.plan().iter().zip(scene.truth()) {
            assert_eq!(planned.t_wc.norm(), 0.0);
            assert_eq!(real.t_wc, Vector3::new(0.5, 0.0, 0.5));
            assert_eq!(planned.r_wc, real.r_wc);
        }
    }

    #[test]
    fn jitter_depends_on_the_seed_and_not_on_the_picture() {
        let truth = |options: SimulateOptions| Scene::new(&options).unwrap().truth().to_vec();
        let first = truth(small());
        assert_eq!(
            first,
            truth(SimulateOptions {
                noise_grey: 0.0,
                width: 64,
                ..small()
            })
        );
        assert_ne!(first, truth(SimulateOptions { seed: 2, ..small() }));
    }

    #[test]
    fn poses_that_leave_the_tunnel_or_look_along_it_are_named() {
        let jitter = |rotation_sigma_deg, sigma_m| SimulateOptions {
            jitter: Some(PriorSection {
                rotation_sigma_deg,
                translation_sigma_m: [sigma_m; 3],
                ..PriorSection::default()
            }),
            frames: 100,
            ..small()
        };
        let message = |options: &SimulateOptions| Scene::new(options).err().unwrap().to_string();
        let outside = message(&jitter(0.0, 5.0));
        assert!(
            outside.contains("frame") && outside.contains("off the axis"),
            "{outside}"
        );
        let along = message(&jitter(40.0, 0.01));
        assert!(along.contains("along the tunnel"), "{along}");
    }

    /// The bright side faces θ = 0.
    #[test]
    fn light_falls_from_one_side() {
        let options = SimulateOptions {
            wall: Wall::Concrete,
            ..SimulateOptions {
                width: 80,
                height: 60,
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
}
