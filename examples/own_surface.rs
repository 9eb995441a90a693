//! Stitches a panorama in a tunnel of one's own shape: a tapered pipe.
//!
//! A shape implements [`Surface`]: the intersection of a ray with the wall, point and tangents of
//! the wall at (s, h), the period of s, the gauge, and a test whether a camera is inside.
//! Refinement, rendering and evaluation take it like the shapes of the crate.
//!
//! Run it with `cargo run --release --example own_surface`; it writes `tapered-pipe.png`.

use image::{DynamicImage, GrayImage, Luma};
use nalgebra::Vector3;
use std::error::Error;
use std::f64::consts::TAU;
use tunnelstitch::camera::Camera;
use tunnelstitch::frames::FrameSet;
use tunnelstitch::progress::Silent;
use tunnelstitch::render::{Layout, StitchOptions, stitch};
use tunnelstitch::surface::{Gauge, Hit, Surface, SurfaceError, WallFrame, WallPoint};
use tunnelstitch::trajectory::{Shutter, spiral};

/// A pipe about the world's y axis whose radius grows linearly: `ρ(y) = r + k y`.
///
/// Wall coordinates: `s = r θ`, the arc length where y = 0; `h = y`.
#[derive(Debug)]
struct TaperedPipe {
    /// r, metres.
    radius_m: f64,
    /// k, metres per metre.
    slope: f64,
}

impl TaperedPipe {
    fn radius_at_m(&self, y: f64) -> f64 {
        self.radius_m + self.slope * y
    }
}

impl Surface for TaperedPipe {
    /// The smallest positive root of `(t_x + λ d_x)² + (t_z + λ d_z)² = (r + k (t_y + λ d_y))²`.
    fn hit(&self, t: &Vector3<f64>, d: &Vector3<f64>) -> Result<Hit, SurfaceError> {
        self.check_inside(t)?;
        let rho = self.radius_at_m(t.y);
        let drift = self.slope * d.y;
        let a = d.x * d.x + d.z * d.z - drift * drift;
        let b = d.x * t.x + d.z * t.z - rho * drift;
        let c = t.x * t.x + t.z * t.z - rho * rho;
        // From inside c < 0, so the roots have opposite signs where a > 0.
        let root = (b * b - a * c).sqrt();
        let range = (-b + root) / a;
        if !(range.is_finite() && range > 0.0) {
            return Err(SurfaceError::Parallel);
        }
        let x_w = t + d * range;
        let theta = x_w.x.atan2(x_w.z).rem_euclid(TAU);
        Ok(Hit {
            range,
            x_w,
            wall: WallPoint {
                s_m: self.radius_m * theta,
                h_m: x_w.y,
            },
        })
    }

    fn frame(&self, wall: WallPoint) -> WallFrame {
        let (sin, cos) = (wall.s_m / self.radius_m).sin_cos();
        let rho = self.radius_at_m(wall.h_m);
        let stretch = rho / self.radius_m;
        WallFrame {
            x_w: Vector3::new(rho * sin, wall.h_m, rho * cos),
            e_s: Vector3::new(stretch * cos, 0.0, -stretch * sin),
            e_h: Vector3::new(self.slope * sin, 1.0, self.slope * cos),
        }
    }

    fn perimeter_m(&self) -> f64 {
        TAU * self.radius_m
    }

    /// It may turn about its axis; a shift along it would change the radius.
    fn gauge(&self) -> Gauge {
        Gauge::revolved()
    }

    fn check_inside(&self, t: &Vector3<f64>) -> Result<(), SurfaceError> {
        let (distance_m, wall_m) = (t.x.hypot(t.z), self.radius_at_m(t.y));
        if !distance_m.is_finite() {
            Err(SurfaceError::NotFinite)
        } else if distance_m >= wall_m {
            Err(SurfaceError::CameraOutside { distance_m, wall_m })
        } else {
            Ok(())
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let pipe = TaperedPipe {
        radius_m: 0.5,
        slope: 0.1,
    };
    let camera = Camera::from_vertical_fov(320, 240, 60f64.to_radians());
    let poses = spiral(24, 0.05, 30f64.to_radians());
    let mut pictures: Vec<DynamicImage> = Vec::new();
    for pose in &poses {
        let mut picture = GrayImage::new(camera.width, camera.height);
        for (u, v, pixel) in picture.enumerate_pixels_mut() {
            if let Some(ray) = camera.ray(f64::from(u), f64::from(v)) {
                let WallPoint { s_m, h_m } = pipe.hit(&pose.t_wc, &(pose.r_wc * ray))?.wall;
                // Squares of 10 cm where the radius is 0.5 m.
                let dark = ((20.0 * s_m / TAU).floor() + (10.0 * h_m).floor()) % 2.0 == 0.0;
                *pixel = Luma([if dark { 70 } else { 180 }]);
            }
        }
        pictures.push(picture.into());
    }
    let frames = FrameSet::in_memory(pictures);
    let options = StitchOptions::default();
    let shutter = Shutter::default();
    let panorama = stitch(&pipe, camera, &frames, &poses, &shutter, &options, &Silent)?;
    println!(
        "{:.0} % of the panorama is covered",
        100.0 * panorama.coverage()
    );
    panorama
        .into_image(Layout::ThetaRight)
        .save("tapered-pipe.png")?;
    println!("wrote tapered-pipe.png");
    Ok(())
}
