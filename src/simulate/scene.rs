//! A simulated survey in memory.

use super::band::{Band, RUN};
use super::caster::cast;
use super::damp::Damp;
use super::lamp::Lamp;
use super::moving::hide_behind_things;
use super::noise::Purpose;
use super::path::Path;
use super::sensor::deliver;
use super::shaft::Shaft;
use super::spoil::spoil;
use super::tunnel::{Place, Tunnel};
use super::wall::{Texture, texture};
use super::{Exposure, SimulateError, SimulateOptions};
use crate::camera::Camera;
use crate::frames::GreyImage;
use crate::trajectory::{Jitter, Pose, spiral};
use image::DynamicImage;
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// How far the wall reaches from a camera along the tunnel, radii.
const REACH_RADII: f64 = 20.0;
/// Texels of a band at the most, four bytes each, and three more where the wall is damp.
const MOST_TEXELS: usize = 1 << 26;
/// Texels over the width of a pixel where the wall is nearest.
const TEXELS_PER_PIXEL: f64 = 3.0;
/// Largest texel, metres: finer than the joints of bricks.
const LARGEST_TEXEL_M: f64 = 0.004;

/// Rows of [`Scene::wall`] that are painted at a time.
const STRIP_ROWS: usize = 128;

/// A tunnel with its camera on its way through.
pub struct Scene {
    options: SimulateOptions,
    camera: Camera,
    plan: Vec<Pose>,
    path: Path,
    /// Least and greatest chainage that each frame sees, metres.
    reaches: Vec<[f64; 2]>,
    tunnel: Tunnel,
    texture: Box<dyn Texture>,
    damp: Option<Damp>,
    /// Texels once around.
    columns: usize,
}

impl Scene {
    /// Lays out the survey: plan, true poses, wall.
    ///
    /// # Errors
    /// [`SimulateError`] for impossible options, an unusable texture, and true poses outside the
    /// tunnel or with a view along it.
    pub fn new(options: &SimulateOptions) -> Result<Self, SimulateError> {
        options.check()?;
        let camera = options.camera;
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
        // Both are laid out in a straight tunnel, and go with the real one.
        let tunnel = Tunnel::new(options)?;
        let [plan, truth] = [plan, truth]
            .map(|poses| -> Vec<Pose> { poses.iter().map(|pose| tunnel.bent(pose)).collect() });
        let texel_m = texel_m(&tunnel, &camera, &truth);
        let readout_share = 1e-3 * options.readout_ms / options.interval_s;
        let path = Path::new(truth, readout_share, camera.height);
        let reaches = (0..options.frames)
            .map(|frame| reach(frame, &path, &camera, &tunnel))
            .collect::<Result<Vec<_>, _>>()?;
        let perimeter_m = tunnel.perimeter_m();
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
            texture: texture(
                &options.wall,
                Purpose::Texture.seed(options.seed),
                perimeter_m,
            )?,
            damp: (options.specular_percent > 0.0)
                .then(|| Damp::new(options.seed, options.specular_percent, perimeter_m)),
            columns: (perimeter_m / texel_m).ceil() as usize,
            tunnel,
            options: options.clone(),
            camera,
            plan,
            path,
            reaches,
        })
    }

    /// The camera.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The poses as planned: what the survey claims.
    pub fn plan(&self) -> &[Pose] {
        &self.plan
    }

    /// The poses as they are, of each frame's middle row.
    pub fn truth(&self) -> &[Pose] {
        self.path.poses()
    }

    /// Gain and bias of a frame.
    pub fn exposure(&self, frame: usize) -> Exposure {
        Exposure::of(&self.options, frame)
    }

    /// The frames that are there, in their order.
    pub fn frames(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.options.frames).filter(|frame| self.options.bad_frames.shown(*frame).is_some())
    }

    /// A frame without noise, as if it were a good one, in grey levels that are neither rounded nor
    /// saturated: the wall with all that the light does to it (damp patches and their glints,
    /// moving things, the camera's lamp, gain and bias).
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn render_exact(&self, frame: usize) -> GreyImage {
        self.exact(&self.band(self.reaches[frame]), frame)
    }

    /// All frames that are there as [`Self::render_exact`] has them, but with `times` as many
    /// pixels along each axis, cast from the same raster.
    pub fn render_finer(&self, times: u32) -> Vec<GreyImage> {
        let frames_of = |batch: Batch| {
            let band = self.band(batch.h_m);
            let finer = |(_, shown): &(usize, usize)| self.finer(&band, *shown, times);
            batch.frames.par_iter().map(finer).collect::<Vec<_>>()
        };
        self.batches().into_iter().flat_map(frames_of).collect()
    }

    /// A frame as the sensor delivers it, good or bad; `None` if it is missing.
    ///
    /// # Panics
    /// If there is no such frame.
    pub fn render(&self, frame: usize) -> Option<DynamicImage> {
        let shown = self.options.bad_frames.shown(frame)?;
        Some(self.delivered(&self.band(self.reaches[shown]), shown))
    }

    /// The wall as it is, in the light that falls on it but without glints: `rows` rows of
    /// `columns` square pixels once around from θ = 0, the first beginning at chainage `h_start_m`
    /// (metres). Each pixel is the mean of points spread over its square, as many as over a frame's
    /// pixel, of the raster that frames are cast from.
    pub fn wall(&self, columns: usize, rows: usize, h_start_m: f64) -> GreyImage {
        let n = self.options.supersample as usize;
        let pixel_m = self.tunnel.perimeter_m() / columns as f64;
        let share = |k: usize| (k as f64 + 0.5) / n as f64;
        let mut data = vec![0.0; columns * rows];
        for (strip, pixels) in data.chunks_mut(columns * STRIP_ROWS).enumerate() {
            let from_m = h_start_m + (strip * STRIP_ROWS) as f64 * pixel_m;
            let band = self.band([from_m, from_m + STRIP_ROWS as f64 * pixel_m]);
            let lines = pixels.par_chunks_mut(columns).enumerate();
            lines.for_each(|(row, line)| {
                for (down, across) in (0..n * n).map(|k| (k / n, k % n)) {
                    let h_m = [from_m + (row as f64 + share(down)) * pixel_m; RUN];
                    for (part, pixels) in line.chunks_mut(RUN).enumerate() {
                        let column = |k: usize| (part * RUN + k) as f64 + share(across);
                        let theta: [f64; RUN] =
                            std::array::from_fn(|k| column(k) * TAU / columns as f64);
                        let (mut values, count) = ([0.0; RUN], pixels.len());
                        band.look(&theta[..count], &h_m[..count], &mut values);
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

    /// Runs of the frames that are there, each with the chainages that their pictures show, so
    /// short that a band of the wall for each fits into bounded memory.
    pub(super) fn batches(&self) -> Vec<Batch> {
        let mut batches: Vec<Batch> = Vec::new();
        for frame in 0..self.options.frames {
            let Some(shown) = self.options.bad_frames.shown(frame) else {
                continue;
            };
            let reach = self.reaches[shown];
            if let Some(Batch { frames, h_m }) = batches.last_mut() {
                let joined = [h_m[0].min(reach[0]), h_m[1].max(reach[1])];
                if Band::rows(joined, self.texel_m()) * self.columns <= MOST_TEXELS {
                    frames.push((frame, shown));
                    *h_m = joined;
                    continue;
                }
            }
            batches.push(Batch {
                frames: vec![(frame, shown)],
                h_m: reach,
            });
        }
        batches
    }

    /// The lit wall between two chainages, metres.
    pub(super) fn band(&self, h_m: [f64; 2]) -> Band {
        let texture = self.texture.as_ref();
        Band::paint(
            texture,
            self.options.light,
            self.damp.as_ref(),
            self.columns,
            self.texel_m(),
            h_m,
        )
    }

    /// [`Self::render_exact`], of a band that holds all the frame sees.
    fn exact(&self, band: &Band, frame: usize) -> GreyImage {
        self.finer(band, frame, 1)
    }

    /// The same with `times` as many pixels along each axis, and so many fewer points to each.
    fn finer(&self, band: &Band, frame: usize, times: u32) -> GreyImage {
        let options = &self.options;
        let pose = |v: f64| self.path.at_row(frame, (v + 0.5) / f64::from(times) - 0.5);
        let (camera, points) = (
            self.camera.upsampled(times),
            options.supersample.div_ceil(times),
        );
        let wall = cast(band, &self.tunnel, &camera, pose, points);
        let seen = hide_behind_things(options.seed, frame, options.moving, wall);
        let lit = match options.lamp_corner {
            Some(corner) => Lamp::new(corner, seen.width(), seen.height()).shine(seen),
            None => seen,
        };
        let before = match self.shaft() {
            Some(shaft) => shaft.hide(lit),
            None => lit,
        };
        self.exposure(frame).expose(before)
    }

    /// What hides the wall in every frame, if anything.
    pub(super) fn shaft(&self) -> Option<Shaft> {
        let percent = self.options.shaft_percent;
        let (width, height) = (self.camera.width as usize, self.camera.height as usize);
        (percent > 0.0).then(|| Shaft::new(percent, width, height))
    }

    /// The picture that a frame takes as the sensor delivers it, of a band that holds all it sees;
    /// its noise is a stream of its own.
    pub(super) fn delivered(&self, band: &Band, frame: usize) -> DynamicImage {
        let options = &self.options;
        let exact = self.exact(band, frame);
        let picture = match options.bad_frames.fault(frame) {
            Some(fault) => spoil(fault, options.seed, frame, exact),
            None => exact,
        };
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        rng.set_stream(1 + frame as u64);
        deliver(&picture, options.noise_grey, options.bits, &mut rng)
    }

    fn texel_m(&self) -> f64 {
        self.tunnel.perimeter_m() / self.columns as f64
    }
}

/// Frames that are rendered of one band of the wall.
pub(super) struct Batch {
    /// Each frame with the one whose picture it shows.
    pub frames: Vec<(usize, usize)>,
    /// Least and greatest chainage that they see, metres.
    pub h_m: [f64; 2],
}

/// Least and greatest chainage that a frame sees, metres.
///
/// # Errors
/// [`SimulateError::CameraOutside`], [`SimulateError::LooksAlongTheAxis`].
fn reach(
    frame: usize,
    path: &Path,
    camera: &Camera,
    tunnel: &Tunnel,
) -> Result<[f64; 2], SimulateError> {
    let pose = &path.poses()[frame];
    let (outward, distance_m) = tunnel.outward(&pose.t_wc);
    if outward.is_nan() || outward >= 0.99 {
        return Err(SimulateError::CameraOutside { frame, distance_m });
    }
    let reach_m = REACH_RADII * tunnel.perimeter_m() / TAU;
    let too_far = SimulateError::LooksAlongTheAxis { frame, reach_m };
    // The tunnel's vanishing points lie where its directions project to.
    let last = f64::from(camera.height - 1);
    let along = tunnel.along(&pose.t_wc);
    for axis in [along, -along] {
        for row in [0.0, 0.5 * last, last] {
            let r_wc = path.at_row(frame, row).r_wc;
            let x_c = r_wc.inverse_transform_vector(&axis);
            if let Some(pixel) = camera.project(&x_c)
                && camera.is_in_image(&pixel, -1.0)
            {
                return Err(too_far);
            }
        }
    }
    let mut reach = [f64::INFINITY, f64::NEG_INFINITY];
    // Without a vanishing point inside, h takes its extremes on the border.
    let border = camera.border(64, 0.5).into_iter();
    for (v, ray) in border.filter_map(|pixel| Some((pixel.y, camera.ray(pixel.x, pixel.y)?))) {
        let pose = path.at_row(frame, v);
        let Place { h_m, .. } = tunnel.rays(pose.t_wc).hit(&(pose.r_wc * ray));
        if h_m.is_nan() {
            return Err(too_far);
        }
        reach = [reach[0].min(h_m), reach[1].max(h_m)];
    }
    // The border is followed in steps; 1 % covers what bulges between them.
    let margin_m = 0.01 * (reach[1] - reach[0]);
    let reach = [reach[0] - margin_m, reach[1] + margin_m];
    let camera_h_m = tunnel.chainage_m(&pose.t_wc);
    if reach.iter().all(|h_m| (h_m - camera_h_m).abs() < reach_m) {
        Ok(reach)
    } else {
        Err(too_far)
    }
}

/// Size of a texel: a third of a pixel where a camera comes nearest to the wall, but of one at half
/// the radius at the finest, metres.
fn texel_m(tunnel: &Tunnel, camera: &Camera, truth: &[Pose]) -> f64 {
    let outward = truth.iter().map(|pose| tunnel.outward(&pose.t_wc).0);
    let nearest_m = tunnel.nearest_m() * (1.0 - outward.fold(0.0, f64::max)).max(0.5);
    (nearest_m / camera.fy / TEXELS_PER_PIXEL).min(LARGEST_TEXEL_M)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::{Light, Wall};
    use crate::survey::PriorSection;

    fn small() -> SimulateOptions {
        SimulateOptions {
            camera: Camera::from_vertical_fov(80, 60, 60f64.to_radians()),
            frames: 12,
            ..SimulateOptions::free()
        }
    }

    #[test]
    fn noise_has_the_sigma_asked_for() {
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
    fn a_frame_does_not_depend_on_the_band_it_is_cast_from() {
        let scene = Scene::new(&small()).unwrap();
        let batches = scene.batches();
        assert_eq!(batches.len(), 1);
        let band = scene.band(batches[0].h_m);
        for frame in [0, 7] {
            assert_eq!(scene.exact(&band, frame), scene.render_exact(frame));
        }
    }

    /// A pixel is the mean of the fine ones in its square.
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
                camera: Camera::from_vertical_fov(64, 60, 60f64.to_radians()),
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

    /// Where a frame of a centred camera looks straight at the wall, its pixels are squares of the
    /// wall.
    #[test]
    fn the_wall_is_what_frames_show() {
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

    fn mean(picture: &GreyImage) -> f32 {
        picture.data().iter().sum::<f32>() / picture.data().len() as f32
    }

    #[test]
    fn exposure_is_applied_to_the_noise_free_light() {
        let plain = Scene::new(&small()).unwrap();
        assert_eq!(
            plain.exposure(5),
            Exposure {
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
        let Exposure { gain, bias_grey } = scene.exposure(5);
        let light = plain.render_exact(5);
        for (value, light) in scene.render_exact(5).data().iter().zip(light.data()) {
            let expected = gain * f64::from(*light) + bias_grey;
            assert!((f64::from(*value) - expected).abs() < 1e-3);
        }
        assert!((gain - 1.0).abs() > 1e-3 && scene.exposure(6).gain != gain);
    }

    /// Every hardship changes the picture, and none the geometry.
    #[test]
    fn hardships_leave_the_poses_alone() {
        let plain = Scene::new(&small()).unwrap();
        let hard = [
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
        for options in hard {
            let scene = Scene::new(&options).unwrap();
            assert_eq!(scene.truth(), plain.truth());
            assert_ne!(scene.render_exact(3), plain.render_exact(3), "{options:?}");
            assert_eq!(
                scene.render_exact(3),
                Scene::new(&options).unwrap().render_exact(3)
            );
        }
    }

    /// On the axis and level, the water faces the camera where the wall is nearest: in the middle
    /// row of the frame. An advance of the camera takes the glint along.
    #[test]
    fn glints_stay_before_the_camera_and_move_over_the_wall() {
        let options = SimulateOptions {
            frames: 2,
            turn_deg: 0.0,
            advance_m: 0.5,
            jitter: None,
            light: Light::Even,
            ..small()
        };
        let damp = SimulateOptions {
            specular_percent: 40.0,
            ..options.clone()
        };
        let (dry, damp) = (Scene::new(&options).unwrap(), Scene::new(&damp).unwrap());
        for frame in 0..2 {
            let (dry, damp) = (dry.render_exact(frame), damp.render_exact(frame));
            let brighter = |v: usize| {
                let row = (0..80).map(|u| damp.at(u, v) - dry.at(u, v));
                row.fold(f32::MIN, f32::max)
            };
            let middle = (28..32).map(brighter).fold(f32::MIN, f32::max);
            assert!(middle > 60.0, "frame {frame}: {middle}");
            for v in (0..5).chain(55..60) {
                assert!(brighter(v) < 5.0, "frame {frame}, row {v}: {}", brighter(v));
            }
            assert!(mean(&damp) != mean(&dry));
        }
    }

    #[test]
    fn bad_frames_are_bad_and_the_others_as_they_were() {
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
