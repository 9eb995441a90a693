//! Light that moves with the camera, by what overlapping frames show of the same wall.

use super::calibration::PhotometricCalibration;
use super::observation::Observation;
use super::priors::Priors;
use nalgebra::Vector3;
use std::ops::Range;
use tunnelstitch_core::frames::{CameraLight, Falloff, LAMP_TERMS, Lamp, SHADING_TERMS, Shading};
use tunnelstitch_geometry::camera::Cameras;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::numerics::significance::chi_squared_bounds;
use tunnelstitch_geometry::surface::{Surface, mean_radius_m};
use tunnelstitch_geometry::trajectory::Pose;

/// Frames that light is estimated from which is the same in all, at the most.
pub const MAX_LIGHT_FRAMES: usize = 60;

/// The frames that such light is estimated from, of `count`: the middle ones.
pub fn light_frames(count: usize) -> Range<usize> {
    let first = count.saturating_sub(MAX_LIGHT_FRAMES) / 2;
    first..(first + MAX_LIGHT_FRAMES).min(count)
}

/// Linearisations of a lamp's light, each at the place found before.
const LAMP_ITERATIONS: usize = 5;

/// A point of the wall with the observations that frames make of it, in which gain and bias are
/// known and the light is not.
#[derive(Clone, Debug)]
pub struct ObservedPoint {
    /// The point, metres.
    pub x_w: Vector3<f64>,
    /// The wall's unit normal there.
    pub normal: Vector3<f64>,
    /// The observations.
    pub seen: Vec<Observation>,
}

impl ObservedPoint {
    /// The point as some of the frames observe it, counted from the first of them.
    pub fn by(&self, frames: &Range<usize>) -> Self {
        let seen = self.seen.iter().filter(|one| frames.contains(&one.frame));
        let counted = seen.map(|one| one.in_frame(one.frame - frames.start));
        Self {
            seen: counted.collect(),
            ..*self
        }
    }
}

/// A shading that all frames have in common, and a lamp, if there is one.
#[derive(Clone, Debug, PartialEq)]
pub struct LightModel {
    /// The shading.
    pub shading: Shading,
    /// The lamp.
    pub lamp: Option<Lamp>,
}

impl LightModel {
    /// Even light on pictures of `size` pixels.
    pub fn even(size: (usize, usize)) -> Self {
        Self {
            shading: Shading::none(size),
            lamp: None,
        }
    }

    /// The light by which frames at `poses` agree best where they overlap, linearised at this one,
    /// with its calibration; None if they do not overlap. A lamp is moved if `moves_lamp`.
    pub fn refined(
        &self,
        points: &[ObservedPoint],
        poses: &[Pose],
        moves_lamp: bool,
    ) -> Option<(Self, PhotometricCalibration)> {
        let observed: Vec<Vec<Observation>> = (points.iter())
            .map(|point| {
                let seen = point.seen.iter();
                seen.map(|one| self.lit(one, point, &poses[one.frame], moves_lamp))
                    .collect()
            })
            .collect();
        let (shading, lamp) = (&self.shading, self.lamp.as_ref());
        let priors = Priors::default();
        let found = PhotometricCalibration::solve(&observed, poses.len(), shading, lamp, &priors)?;
        let refined = Self {
            shading: self.shading.changed(&found.shading),
            lamp: self.lamp.map(|lamp| lamp.changed(&found.lamp)),
        };
        Some((refined, found))
    }

    /// A light with a lamp that moves with the camera, by which frames at `poses` agree better than
    /// by this shading alone, refined, by more than chance: with N independent readings and
    /// variances v of the residuals, `N ln(v_without/v_with)` exceeds the quantile of χ² of the
    /// lamp's unknowns that noise alone exceeds with the probability `false_alarm_rate`. None if
    /// frames agree as well without.
    ///
    /// A frame has as many independent readings of the light as there are terms of the shading,
    /// however many points it shows ([`PhotometricCalibration::solve`]).
    pub fn with_lamp(
        &self,
        points: &[ObservedPoint],
        poses: &[Pose],
        surface: &dyn Surface,
        false_alarm_rate: f64,
    ) -> Option<(Self, PhotometricCalibration)> {
        let (_, without) = self.refined(points, poses, false)?;
        let at_camera = Self {
            shading: self.shading.clone(),
            lamp: Some(Lamp::at_camera(mean_radius_m(surface))),
        };
        let mut lit = at_camera.refined(points, poses, true)?;
        for _ in 1..LAMP_ITERATIONS {
            lit = lit.0.refined(points, poses, true)?;
        }
        let independent = (poses.len() * SHADING_TERMS) as f64;
        let gain = independent * (without.variance / lit.1.variance).ln();
        let (_, least) = chi_squared_bounds(2.0 * false_alarm_rate, LAMP_TERMS as f64)?;
        (gain > least).then_some(lit)
    }

    /// This light over full-size frames of `cameras` at `poses`.
    pub fn over(self, surface: &dyn Surface, cameras: &Cameras, poses: &[Pose]) -> CameraLight {
        let falloffs = |lamp: Lamp| {
            let frames: Vec<usize> = (0..poses.len()).collect();
            let falloff = |k: &usize| Falloff::new(&lamp, surface, cameras.of(*k), &poses[*k]);
            (lamp, frames.par_map(falloff))
        };
        CameraLight {
            shading: self.shading,
            lamp: self.lamp.map(falloffs),
        }
    }

    /// An observation from `pose` of the light beside this one; of the lamp's unknowns, too, if it
    /// `moves_lamp`.
    fn lit(
        &self,
        seen: &Observation,
        point: &ObservedPoint,
        pose: &Pose,
        moves_lamp: bool,
    ) -> Observation {
        let of_lamp = |lamp: &Lamp| lamp.log_falloff(pose, &point.x_w, &point.normal);
        let (log, terms) = self.lamp.as_ref().map(of_lamp).unwrap_or_default();
        let lit = seen.in_light(self.shading.log_at(&seen.pixel()) + log);
        if moves_lamp {
            lit.with_lamp(terms)
        } else {
            lit
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Vector2, Vector6};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;
    use tunnelstitch_geometry::camera::Camera;
    use tunnelstitch_geometry::surface::{Circle, WallPoint};
    use tunnelstitch_geometry::trajectory::spiral;

    const SIZE: (usize, usize) = (64, 48);
    const LAMP: Lamp = Lamp {
        position: Vector3::new(0.1, -0.05, 0.08),
        reach_m: 1.0,
    };

    fn circle() -> Circle {
        Circle::new(1.0).unwrap()
    }

    fn camera() -> Camera {
        Camera::from_vertical_fov(SIZE.0 as u32, SIZE.1 as u32, 1.0)
    }

    /// Three turns, every frame up to `off_m` off the axis and as many radians off the plan.
    fn poses(off_m: f64) -> Vec<Pose> {
        let off = |k: usize, n: usize| off_m * ((1.3 + 0.7 * n as f64) * k as f64).sin();
        let plan = spiral(36, 0.05, 30f64.to_radians()).into_iter().enumerate();
        plan.map(|(k, plan)| plan.retract(&Vector6::from_fn(|n, _| off(k, n))))
            .collect()
    }

    /// Points of a wall without shadows in the light of a lamp, observed with noise.
    fn points(poses: &[Pose], lamp: Option<Lamp>) -> Vec<ObservedPoint> {
        let (circle, camera) = (circle(), camera());
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        (0..4000)
            .map(|_| {
                let frame = circle.frame(WallPoint {
                    s_m: rng.random_range(0.0..circle.perimeter_m()),
                    h_m: rng.random_range(0.0..1.8),
                });
                let wall = rng.random_range(40.0..80.0);
                let mut point = ObservedPoint {
                    x_w: frame.x_w,
                    normal: frame.normal(),
                    seen: Vec::new(),
                };
                for (k, pose) in poses.iter().enumerate() {
                    let x_c = pose.to_camera(&frame.x_w);
                    let Some(pixel) = camera.project(&x_c).filter(is_in_picture) else {
                        continue;
                    };
                    let light = lamp.map_or(1.0, |lamp| {
                        lamp.log_at(pose, &frame.x_w, &point.normal).exp()
                    });
                    let value = wall * light + rng.sample::<f64, _>(StandardNormal);
                    let pixel = [pixel.x as f32, pixel.y as f32];
                    let one = Observation::new(k, pixel, value as f32, 1.0);
                    point.seen.extend(one);
                }
                point
            })
            .collect()
    }

    fn is_in_picture(pixel: &Vector2<f64>) -> bool {
        (0.0..64.0).contains(&pixel.x) && (0.0..48.0).contains(&pixel.y)
    }

    fn found_lamp(off_m: f64, lamp: Option<Lamp>) -> Option<Lamp> {
        let poses = poses(off_m);
        let points = points(&poses, lamp);
        let even = LightModel::even(SIZE);
        even.with_lamp(&points, &poses, &circle(), 1e-3)?.0.lamp
    }

    #[test]
    fn a_lamp_is_found_by_frames_off_the_axis() {
        let found = found_lamp(0.1, Some(LAMP)).unwrap();
        let error = (found.position - LAMP.position).norm();
        assert!(error < 0.02, "{found:?}");
    }

    #[test]
    fn even_light_is_no_lamp() {
        assert_eq!(found_lamp(0.1, None), None);
    }

    /// It then lights the same pixels alike in all frames, as a shading does.
    #[test]
    fn a_lamp_on_the_axis_is_left_to_the_shading() {
        let lamp = Lamp::at_camera(1.0);
        assert_eq!(found_lamp(0.0, Some(lamp)), None);
    }

    #[test]
    fn the_middle_frames_are_counted_from_the_first_of_them() {
        assert_eq!(light_frames(40), 0..40);
        let middle = light_frames(100);
        assert_eq!(middle, 20..80);
        let seen = [10, 20, 79, 80].map(|k| Observation::new(k, [0.0; 2], 100.0, 1.0).unwrap());
        let point = ObservedPoint {
            x_w: Vector3::zeros(),
            normal: Vector3::x(),
            seen: seen.into(),
        };
        let frames: Vec<usize> = point.by(&middle).seen.iter().map(|one| one.frame).collect();
        assert_eq!(frames, [0, 59]);
    }
}
