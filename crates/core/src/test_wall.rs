//! A wall with a known texture and frames of it, for tests.

use crate::frames::GreyImage;
use nalgebra::Vector3;
use std::f64::consts::TAU;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::surface::{Circle, Surface, WallPoint};
use tunnelstitch_geometry::trajectory::{Pose, so3, spiral};

/// Grey value of a wall point; the second argument is the perimeter, metres.
pub type Texture = fn(WallPoint, f64) -> f64;

/// A tunnel of 1 m radius with frames of its wall.
pub struct TestWall {
    pub circle: Circle,
    pub camera: Camera,
    pub poses: Vec<Pose>,
    texture: Texture,
}

/// Smooth, periodic around the tunnel, grey 48–208; the shortest wave is 0.31 m along the wall.
pub fn waves(wall: WallPoint, perimeter_m: f64) -> f64 {
    let turns = TAU * wall.s_m / perimeter_m;
    128.0
        + 50.0 * (20.0 * turns + 3.0 * wall.h_m).sin()
        + 30.0 * (13.0 * wall.h_m - 4.0 * turns).cos()
}

impl TestWall {
    /// Makes fourteen frames once around, each off the axis and turned a little differently.
    pub fn ring(texture: Texture) -> Self {
        let poses = spiral(14, 0.03, 30f64.to_radians())
            .into_iter()
            .enumerate()
            .map(|(k, plan)| {
                let k = k as f64;
                let turn = Vector3::new((1.3 * k).sin(), (2.1 * k).cos(), (0.7 * k).sin()) * 0.08;
                let shift = Vector3::new((0.9 * k).cos(), (1.7 * k).sin(), (2.3 * k).cos()) * 0.12;
                Pose::new(plan.r_wc * so3::exp(&turn), plan.t_wc + shift)
            })
            .collect();
        Self::new(poses, texture)
    }

    /// Makes one frame from the origin towards θ = 0.
    pub fn one(texture: Texture) -> Self {
        Self::new(vec![Pose::identity()], texture)
    }

    fn new(poses: Vec<Pose>, texture: Texture) -> Self {
        Self {
            circle: Circle::new(1.0).unwrap(),
            camera: Camera::from_vertical_fov(160, 120, 60f64.to_radians()),
            poses,
            texture,
        }
    }

    pub fn perimeter_m(&self) -> f64 {
        self.circle.perimeter_m()
    }

    /// Draws the frames: the texture at each pixel centre's wall point.
    pub fn frames(&self) -> Vec<GreyImage> {
        self.poses.iter().map(|pose| self.frame(pose)).collect()
    }

    /// Draws the frames as samples of 8 bits, each changed by `change(frame, u, v, value)`.
    pub fn samples(&self, change: impl Fn(usize, usize, usize, f32) -> f32) -> Vec<Vec<u8>> {
        let width = self.camera.width as usize;
        let of_frame = |(k, frame): (usize, GreyImage)| {
            let values = frame.data().iter().enumerate();
            let changed = values.map(|(at, value)| change(k, at % width, at / width, *value));
            changed.map(|value| value.round() as u8).collect()
        };
        self.frames()
            .into_iter()
            .enumerate()
            .map(of_frame)
            .collect()
    }

    fn frame(&self, pose: &Pose) -> GreyImage {
        let (width, height) = (self.camera.width, self.camera.height);
        let mut data = Vec::new();
        for v in 0..height {
            for u in 0..width {
                let ray = self.camera.ray(f64::from(u), f64::from(v)).unwrap();
                let ray = pose.r_wc * ray;
                let hit = self.circle.hit(&pose.t_wc, &ray).unwrap();
                data.push((self.texture)(hit.wall, self.perimeter_m()) as f32);
            }
        }
        GreyImage::new(width as usize, height as usize, data)
    }
}
