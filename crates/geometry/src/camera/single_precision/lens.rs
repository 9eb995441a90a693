//! The choice of the lens model in single precision.

use super::angle::{FovF32, ThinPrismFisheyeF32};
use super::fisheye::KannalaBrandtF32;
use super::perspective::{BrownConradyF32, PinholeF32};
use super::polynomial::OcamF32;
use super::project::{LensLoop, ProjectF32};
use super::rolling_shutter::RollingShutter;
use super::sphere::{DoubleSphereF32, EucmF32, MeiF32};
use super::wide_angle::WideAngleF32;
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;

/// A lens model in single precision.
#[derive(Clone, Copy, Debug)]
pub enum LensF32 {
    /// No distortion.
    Pinhole(PinholeF32),
    /// [`crate::camera::BrownConrady`].
    BrownConrady(BrownConradyF32),
    /// [`crate::camera::KannalaBrandt`].
    KannalaBrandt(KannalaBrandtF32),
    /// The other models.
    WideAngle(WideAngleF32),
    /// No distortion, with a rolling shutter.
    RollingPinhole(RollingShutter<PinholeF32>),
    /// [`crate::camera::BrownConrady`], with a rolling shutter.
    RollingBrownConrady(RollingShutter<BrownConradyF32>),
    /// [`crate::camera::KannalaBrandt`], with a rolling shutter.
    RollingKannalaBrandt(RollingShutter<KannalaBrandtF32>),
    /// The other models, with a rolling shutter.
    RollingWideAngle(RollingShutter<WideAngleF32>),
}

impl LensF32 {
    /// Converts the lens and the sweep of a camera.
    pub fn new(camera: &Camera) -> Self {
        let lens = Self::at_rest(&camera.lens);
        if camera.sweep.is_none() {
            return lens;
        }
        match lens {
            Self::Pinhole(lens) => Self::RollingPinhole(RollingShutter::new(lens, camera)),
            Self::BrownConrady(lens) => {
                Self::RollingBrownConrady(RollingShutter::new(lens, camera))
            }
            Self::KannalaBrandt(lens) => {
                Self::RollingKannalaBrandt(RollingShutter::new(lens, camera))
            }
            Self::WideAngle(lens) => Self::RollingWideAngle(RollingShutter::new(lens, camera)),
            rolling => rolling,
        }
    }

    fn at_rest(lens: &Lens) -> Self {
        match lens {
            Lens::BrownConrady(lens) if lens.is_distortion_free() => Self::Pinhole(PinholeF32),
            Lens::BrownConrady(lens) => Self::BrownConrady(BrownConradyF32::new(lens)),
            Lens::KannalaBrandt(lens) => Self::KannalaBrandt(KannalaBrandtF32::new(
                |theta| lens.radius(theta).0,
                lens.field_of_view().limit_rad(),
            )),
            Lens::Mei(lens) => Self::WideAngle(WideAngleF32::Mei(MeiF32::new(lens))),
            Lens::DoubleSphere(lens) => {
                Self::WideAngle(WideAngleF32::DoubleSphere(DoubleSphereF32::new(lens)))
            }
            Lens::Eucm(lens) => Self::WideAngle(WideAngleF32::Eucm(EucmF32::new(lens))),
            Lens::Fov(lens) => Self::WideAngle(WideAngleF32::Fov(FovF32::new(lens))),
            Lens::ThinPrismFisheye(lens) => Self::WideAngle(WideAngleF32::ThinPrismFisheye(
                ThinPrismFisheyeF32::new(lens),
            )),
            Lens::Ocam(lens) => Self::WideAngle(WideAngleF32::Ocam(OcamF32::new(lens))),
        }
    }

    /// Runs a loop with the lens model.
    #[inline(always)]
    pub fn run(self, work: impl LensLoop) {
        match self {
            Self::Pinhole(lens) => work.run(lens),
            Self::BrownConrady(lens) => work.run(lens),
            Self::KannalaBrandt(lens) => work.run(lens),
            Self::WideAngle(lens) => lens.run(work),
            Self::RollingPinhole(lens) => work.run(lens),
            Self::RollingBrownConrady(lens) => work.run(lens),
            Self::RollingKannalaBrandt(lens) => work.run(lens),
            Self::RollingWideAngle(lens) => lens.run(work),
        }
    }
}

impl ProjectF32 for LensF32 {
    #[inline(always)]
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        match self {
            Self::Pinhole(lens) => lens.project_f32(x, y, z),
            Self::BrownConrady(lens) => lens.project_f32(x, y, z),
            Self::KannalaBrandt(lens) => lens.project_f32(x, y, z),
            Self::WideAngle(lens) => lens.project_f32(x, y, z),
            Self::RollingPinhole(lens) => lens.project_f32(x, y, z),
            Self::RollingBrownConrady(lens) => lens.project_f32(x, y, z),
            Self::RollingKannalaBrandt(lens) => lens.project_f32(x, y, z),
            Self::RollingWideAngle(lens) => lens.project_f32(x, y, z),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::brown_conrady::{BrownCoefficients, BrownConrady};
    use crate::camera::kannala_brandt::KannalaBrandt;
    use crate::camera::lens_tests::{limit_rad, wide_angle_lenses};
    use crate::camera::sweep::Sweep;
    use nalgebra::Vector3;

    fn compare(lens: &Lens, within: f64, directions: impl Iterator<Item = Vector3<f64>>) {
        let mut seen = 0;
        for x_c in directions {
            let (x, y, z) = (x_c.x as f32, x_c.y as f32, x_c.z as f32);
            let (p, q, shown) = LensF32::at_rest(lens).project_f32(x, y, z);
            let exact = lens.project(&Vector3::new(f64::from(x), f64::from(y), f64::from(z)));
            assert_eq!(shown, exact.is_some(), "{lens:?} {x_c}");
            if let Some(exact) = exact {
                let error = (f64::from(p) - exact.x).hypot(f64::from(q) - exact.y);
                assert!(error < within, "{lens:?} {x_c}: {error}");
                seen += 1;
            }
        }
        assert!(seen > 100);
    }

    /// Directions up to `limit` radians off the axis (and a little beyond), at distances of 0.5 to
    /// 5 m.
    fn directions(limit: f64) -> impl Iterator<Item = Vector3<f64>> {
        (0..1000).map(move |k| {
            let theta = limit * 1.05 * f64::from(k) / 1000.0;
            let turn = 2.4 * f64::from(k);
            let (sin, cos) = theta.sin_cos();
            Vector3::new(sin * turn.cos(), sin * turn.sin(), cos) * (0.5 + f64::from(k % 10) * 0.5)
        })
    }

    #[test]
    fn single_precision_projects_as_double_does() {
        compare(&Lens::default(), 1e-6, directions(1.0));
        let brown = |k, p| Lens::BrownConrady(BrownConrady::new(BrownCoefficients { k, p }));
        compare(&Lens::radial(-0.28, 0.07), 1e-6, directions(1.0));
        let tangential = brown([-0.3, 0.1, -0.02, 0.0, 0.0, 0.0], [1e-3, -2e-3]);
        compare(&tangential, 1e-6, directions(0.8));
        let rational = brown([4.1, 2.0, 0.1, 4.4, 3.1, 0.45], [-4e-4, 6e-4]);
        compare(&rational, 3e-6, directions(1.1));
        let fisheye = |k| Lens::KannalaBrandt(KannalaBrandt::new(k));
        compare(&fisheye([0.0; 4]), 1e-6, directions(2.0));
        let real = [-0.01, 0.005, -0.004, 0.0007];
        compare(&fisheye(real), 1e-6, directions(1.6));
        let narrow = KannalaBrandt::new(real).limited_to(1.2);
        compare(&Lens::KannalaBrandt(narrow), 1e-6, directions(1.2));
    }

    /// Compares all other models within 160° (the image of the widest lens) and the limit.
    #[test]
    fn wide_angle_lenses_project_as_in_double_precision() {
        for lens in wide_angle_lenses() {
            let limit = limit_rad(lens);
            // Nearly parallel to the image plane of a model that reaches infinity, rounding grows.
            let shown = directions(limit.min(2.8)).filter(|x_c| {
                let slope = lens
                    .project(x_c)
                    .map(|_| lens.jacobian(x_c).norm() * x_c.norm());
                slope.is_none_or(|slope| slope < 20.0)
            });
            compare(lens, 2e-5, shown);
        }
    }

    /// Compares the expansion with the exact pose of the row: a wall at 1 to 5 m, 90 °/s over 20 ms
    /// about any axis, 640 × 480 px.
    #[test]
    fn a_moving_camera_projects_to_a_thousandth_of_a_pixel() {
        let fisheye = KannalaBrandt::new([-0.01, 0.005, -0.004, 0.0007]);
        let known = [
            Lens::default(),
            Lens::radial(-0.1, 0.02),
            Lens::KannalaBrandt(fisheye),
        ];
        let wide = wide_angle_lenses();
        for lens in known.iter().chain(wide) {
            for k in 0..200 {
                let direction = |salt: f64| {
                    let number = |axis: f64| (12.9898 * f64::from(k) + 78.233 * axis + salt).sin();
                    Vector3::new(number(1.0), number(2.0), number(3.0)).normalize()
                };
                let camera = Camera {
                    lens: *lens,
                    sweep: Sweep {
                        omega_rad: direction(0.1) * 0.0314,
                        nu_m: direction(0.2) * 0.01,
                    },
                    ..Camera::from_vertical_fov(640, 480, 60f64.to_radians())
                };
                let single = LensF32::new(&camera);
                for (u, v) in [
                    (0.0, 0.0),
                    (639.0, 10.0),
                    (320.0, 239.5),
                    (5.0, 479.0),
                    (500.0, 300.0),
                ] {
                    let far = 1.0 + f64::from(k % 5);
                    // Lenses that magnify the edge of their field of view are not for pictures of
                    // this size.
                    let Some(ray) = camera
                        .ray(u, v)
                        .filter(|ray| lens.jacobian(ray).norm() < 3.0 && ray.z > -0.5 * ray.norm())
                    else {
                        continue;
                    };
                    let x_c = camera.origin(v) + ray * far;
                    let (p, q, shown) =
                        single.project_f32(x_c.x as f32, x_c.y as f32, x_c.z as f32);
                    let (du, dv) = (
                        camera.fx * f64::from(p) + camera.cx - u,
                        camera.fy * f64::from(q) + camera.cy - v,
                    );
                    assert!(shown && du.hypot(dv) < 1e-3, "{lens:?} {u} {v}: {du} {dv}");
                }
            }
        }
    }

    #[test]
    fn a_camera_at_rest_has_the_lens_itself() {
        let camera = Camera::from_vertical_fov(640, 480, 1.0);
        assert!(matches!(LensF32::new(&camera), LensF32::Pinhole(_)));
    }
}
