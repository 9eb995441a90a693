//! Light that depends on the camera: its lamp, and fog.

use crate::fog::Fog;
use crate::lamp_light::{LampLight, PosedLamp};
use crate::tunnel::Tunnel;
use crate::wall_intersection::WallHit;
use nalgebra::Vector3;
use tunnelstitch_geometry::trajectory::Pose;

/// Light of the camera's lamp through fog, where there are any.
#[derive(Clone, Copy, Default)]
pub(super) struct WallLight<'a> {
    /// The lamp.
    pub lamp: Option<&'a LampLight>,
    /// The fog.
    pub fog: Option<Fog>,
}

/// Change of the radiance of a wall point on its way to the camera: `L ← gain · L + added`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PointLight {
    /// Factor.
    pub gain: f32,
    /// Grey levels.
    pub added: f32,
}

impl PointLight {
    /// Light of a pixel at which the lens shows nothing.
    pub const NONE: Self = Self {
        gain: f32::NAN,
        added: f32::NAN,
    };
}

impl WallLight<'_> {
    /// True if there is neither lamp nor fog.
    pub fn is_none(&self) -> bool {
        self.lamp.is_none() && self.fog.is_none()
    }

    /// Distance of sight along the tunnel, metres.
    pub fn reach_m(&self) -> Option<f64> {
        self.fog.map(|fog| fog.reach_m)
    }

    /// The lamp of a camera with the given pose.
    pub fn lamp_at(&self, pose: &Pose) -> Option<PosedLamp> {
        self.lamp.map(|lamp| lamp.at(pose))
    }

    /// Light of a wall point that the camera at `t`, whose chainage is `camera_h_m` and whose lamp
    /// is `lamp`, sees along direction `d`.
    pub fn at(
        &self,
        tunnel: &Tunnel,
        lamp: Option<&PosedLamp>,
        (t, camera_h_m): (&Vector3<f64>, f64),
        d: &Vector3<f64>,
        hit: &WallHit,
    ) -> PointLight {
        let [mut gain, mut added] = [1.0, 0.0];
        if let Some(lamp) = lamp {
            let point = t + d * hit.lambda;
            let normal = tunnel.inward_normal(&point, hit.h_m);
            gain = lamp.irradiance(&point, &normal);
            added = lamp.sheen(&point, &normal, d);
        }
        if let Some(fog) = &self.fog {
            let [share, grey] = fog.at((hit.h_m - camera_h_m).abs());
            [gain, added] = [share * gain, share * added + grey];
        }
        PointLight {
            gain: gain as f32,
            added: added as f32,
        }
    }
}
