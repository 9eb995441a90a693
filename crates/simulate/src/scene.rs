//! Simulated survey in memory.

use crate::effects::effect_chain::EffectChain;
use crate::effects::exposure::{Exposures, GainBias};
use crate::effects::overlay::Overlay;
use crate::effects::rig_shaft::RigShaft;
use crate::error::SimulateError;
use crate::fittings::layout::FittingLayout;
use crate::fittings::occlusion::Occluders;
use crate::fog::Fog;
use crate::frame_motion::FrameMotion;
use crate::lamp_light::LampLight;
use crate::lining::segment_joints::JointedWall;
use crate::options::{SIDE_VIEW_DEG, SimulateOptions};
use crate::planned_path::plan;
use crate::procedural_noise::RandomStream;
use crate::texture::open::open_texture;
use crate::texture::wall_texture::WallTexture;
use crate::tunnel::Tunnel;
use crate::visible_wall::{MAX_DISTANCE_RADII, texel_size_m, visible_chainage};
use crate::wall_light::WallLight;
use crate::wall_raster::MAX_TEXELS;
use crate::wall_stretches::{WallStretch, stretches_of_view};
use crate::wet_patches::WetPatches;
use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;
use tunnelstitch_geometry::camera::{Camera, Cameras};
use tunnelstitch_geometry::trajectory::{Jitter, Pose};

/// A tunnel and the path of the camera, or of a rig, through it.
pub struct Scene {
    pub(super) options: SimulateOptions,
    cameras: Cameras,
    plan: Vec<Pose>,
    /// The planned and the true poses of a rig's body.
    bodies: Option<[Vec<Pose>; 2]>,
    pub(super) motion: FrameMotion,
    /// Minimum and maximum chainage that each frame sees, metres.
    pub(super) visible_h_m: Vec<[f64; 2]>,
    pub(super) tunnel: Tunnel,
    pub(super) texture: Box<dyn WallTexture>,
    pub(super) wet_patches: Option<WetPatches>,
    fittings: FittingLayout,
    lamp: Option<LampLight>,
    fog: Option<Fog>,
    exposures: Exposures,
    /// Factor by which the light of a dark survey is dimmed.
    pub(super) dimming: Option<f64>,
    /// Effects on the light of the frames.
    pub(super) on_light: EffectChain,
    /// Effects of the camera on the exposed frames.
    pub(super) in_camera: EffectChain,
    /// Number of texels around the section.
    pub(super) columns: usize,
}

impl Scene {
    /// Builds the survey: plan, true poses and wall.
    ///
    /// # Errors
    /// [`SimulateError`] for impossible options, an unusable texture, and true poses outside the
    /// tunnel or, where the camera is to look at the wall beside it, with a view along it.
    pub fn new(options: &SimulateOptions) -> Result<Self, SimulateError> {
        options.validate()?;
        let cameras = options.cameras();
        let plan = plan(options);
        let offset = Vector3::from(options.offset_m);
        let mut truth: Vec<Pose> = plan
            .iter()
            .map(|pose| Pose::new(pose.r_wc, pose.t_wc + offset))
            .collect();
        if let Some(jitter) = options.jitter {
            let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
            truth = Jitter::from(jitter).apply(&truth, &mut rng);
        }
        // Both are defined along a straight axis, and then follow the real one.
        let tunnel = Tunnel::new(options)?;
        let [plan, truth] = [plan, truth]
            .map(|poses| -> Vec<Pose> { poses.iter().map(|pose| tunnel.to_world(pose)).collect() });
        let mut bodies = None;
        let [plan, truth] = match options.rig {
            Some(rig) => {
                let mounts = rig.mounts();
                let placed = [&plan, &truth].map(|poses| of_cameras(poses, &mounts));
                bodies = Some([plan, truth]);
                placed
            }
            None => [plan, truth],
        };
        let texel_m = texel_size_m(&tunnel, cameras.of(0), &truth);
        let motion = FrameMotion::new(options, truth, &tunnel);
        let fog = (options.view_deg != SIDE_VIEW_DEG).then(|| Fog::new(&tunnel));
        let visible_h_m = (0..options.pictures())
            .map(|frame| visible_chainage(frame, &motion, cameras.of(frame), &tunnel, fog))
            .collect::<Result<Vec<_>, _>>()?;
        let perimeter_m = tunnel.perimeter_m();
        let lamp = match &options.camera_lamp {
            Some(lamp) => Some(LampLight::new(lamp, &plan[0], cameras.of(0), &tunnel)?),
            None => None,
        };
        let texture = open_texture(
            &options.wall,
            RandomStream::WallTexture.seed(options.seed),
            perimeter_m,
        )?;
        let mut scene = Self {
            texture: match tunnel.lining().and_then(|lining| lining.segments.clone()) {
                Some(rings) => Box::new(JointedWall::new(texture, rings)),
                None => texture,
            },
            fittings: FittingLayout::new(&options.fittings, options.seed, &tunnel)?,
            wet_patches: (options.specular_percent > 0.0)
                .then(|| WetPatches::new(options.seed, options.specular_percent, perimeter_m)),
            columns: (perimeter_m / texel_m).ceil() as usize,
            tunnel,
            on_light: EffectChain::of_light(options, 1, None),
            in_camera: EffectChain::of_camera(options),
            exposures: Exposures::new(options),
            dimming: None,
            lamp,
            fog,
            options: options.clone(),
            cameras,
            plan,
            bodies,
            motion,
            visible_h_m,
        };
        scene.check_texels()?;
        if options.effects.dark {
            scene.dimming = Some(scene.find_dimming());
            scene.on_light = EffectChain::of_light(options, 1, scene.dimming);
        }
        Ok(scene)
    }

    /// Refuses a view of more wall than memory is for.
    fn check_texels(&self) -> Result<(), SimulateError> {
        let most = (0..self.options.pictures())
            .map(|frame| self.texel_count(&self.stretches(frame)))
            .max();
        if most.unwrap_or(0) <= 4 * MAX_TEXELS {
            return Ok(());
        }
        let perimeter_m = self.tunnel.perimeter_m();
        let widest_m = self.visible_h_m.iter().map(|h_m| h_m[1] - h_m[0]);
        Err(SimulateError::Option {
            what: format!(
                "a frame would see {perimeter_m:.0} × {:.0} m of wall painted in steps of {:.1} \
                 mm, which is more than memory is for; lower the radius, the field of view or the \
                 frames' size",
                widest_m.fold(0.0, f64::max),
                1e3 * self.texel_m()
            ),
        })
    }

    /// The camera; of a rig, the first.
    pub fn camera(&self) -> &Camera {
        self.cameras.of(0)
    }

    /// The cameras.
    pub fn cameras(&self) -> &Cameras {
        &self.cameras
    }

    /// The planned and the true poses that the survey's files hold: of a rig, those of its body.
    pub(super) fn given_poses(&self) -> [&[Pose]; 2] {
        match &self.bodies {
            Some([plan, truth]) => [plan, truth],
            None => [self.plan(), self.truth()],
        }
    }

    /// The planned poses of the frames, which become the survey's initial poses.
    pub fn plan(&self) -> &[Pose] {
        &self.plan
    }

    /// The true poses, at the time of each frame's middle row.
    pub fn truth(&self) -> &[Pose] {
        self.motion.poses()
    }

    /// Deviation of the lining from the nominal radius at an angle (radians, from twelve o'clock
    /// towards three) and a chainage (metres), metres outwards; 0 of a wall that is as planned.
    pub fn lining_deviation_m(&self, theta: f64, h_m: f64) -> f64 {
        self.tunnel.deviation_m(theta, h_m)
    }

    /// True if a cable or a lamp hides a point (world, metres) from a frame.
    pub fn is_hidden(&self, frame: usize, x_w: &Vector3<f64>) -> bool {
        let t = self.truth()[frame].t_wc;
        let d = x_w - t;
        let occluders = self.occluders(frame);
        occluders.towards(&t, [d; 4]).grey(t, d, None).is_some()
    }

    /// Gain and bias of a frame.
    pub fn exposure(&self, frame: usize) -> GainBias {
        self.exposures.of_frame(frame)
    }

    /// The indices of all frames that exist, in order.
    pub fn frames(&self) -> impl Iterator<Item = usize> + '_ {
        let bad_frames = &self.options.bad_frames;
        (0..self.options.pictures()).filter(|frame| bad_frames.source_frame(*frame).is_some())
    }

    /// Minimum and maximum chainage of the wall that any frame sees, metres.
    pub(super) fn seen_h_m(&self) -> [f64; 2] {
        let hull = |a: [f64; 2], b: &[f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        self.visible_h_m.iter().fold(none, hull)
    }

    /// The stretches of wall that a frame sees.
    pub(super) fn stretches(&self, frame: usize) -> Vec<WallStretch> {
        let seen_h_m = self.visible_h_m[frame];
        if self.fog.is_none() {
            return vec![WallStretch::near(seen_h_m)];
        }
        let camera_h_m = self.tunnel.chainage_m(&self.truth()[frame].t_wc);
        stretches_of_view(seen_h_m, camera_h_m, self.tunnel.perimeter_m() / TAU)
    }

    /// The cables and lamps that a frame may show.
    pub(super) fn occluders(&self, frame: usize) -> Occluders {
        let (camera_h_m, [from_m, to_m]) = (
            self.tunnel.chainage_m(&self.truth()[frame].t_wc),
            self.visible_h_m[frame],
        );
        // Farther away, they would be thinner than a pixel.
        let far_m = MAX_DISTANCE_RADII * self.tunnel.perimeter_m() / TAU;
        let h_m = [
            from_m.min(camera_h_m).max(camera_h_m - far_m),
            to_m.max(camera_h_m).min(camera_h_m + far_m),
        ];
        Occluders::new(self.fittings.solids(&self.tunnel, h_m), self.options.light)
    }

    /// Light that depends on the camera.
    pub(super) fn light(&self) -> WallLight<'_> {
        WallLight {
            lamp: self.lamp.as_ref(),
            fog: self.fog,
        }
    }

    /// The overlay that is burnt into the frames, if there is one.
    pub(super) fn overlay(&self) -> Option<Overlay> {
        let size = self.cameras.size().map(|side| side as usize);
        let overlay = |parts| Overlay::new(parts, size, self.options.interval_s);
        self.options.effects.overlay.map(overlay)
    }

    /// The shaft of the rig, if it is visible.
    pub(super) fn shaft(&self) -> Option<RigShaft> {
        let percent = self.options.shaft_percent;
        let [width, height] = self.cameras.size().map(|side| side as usize);
        (percent > 0.0).then(|| RigShaft::new(percent, width, height))
    }
}

/// The poses of the cameras of a rig in turn, moment by moment.
fn of_cameras(bodies: &[Pose], mounts: &[Pose]) -> Vec<Pose> {
    let of_body = |body: &Pose| -> Vec<Pose> {
        let cameras = mounts.iter();
        cameras.map(|mount| body.after(mount)).collect()
    };
    bodies.iter().flat_map(of_body).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_core::survey::PriorSection;

    fn small() -> SimulateOptions {
        SimulateOptions {
            camera: Camera::from_vertical_fov(80, 60, 60f64.to_radians()),
            frames: 12,
            ..SimulateOptions::free()
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
}
