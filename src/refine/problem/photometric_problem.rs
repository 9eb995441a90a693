//! The photometric problem over a run of frames at one pyramid level: cost and normal equations.

use crate::camera::{Camera, Sweep};
use crate::frames::Pyramid;
use crate::refine::joint::joint_block::WallModel;
use crate::refine::linear::bordered_system::SharedBorder;
use crate::refine::linear::normal_equations::{Block, NormalEquations, Pattern};
use crate::refine::linear::sparse_cholesky::{FactorError, SymbolicFactorisation};
use crate::refine::model::context::{EstimationContext, FrameWindow};
use crate::refine::model::problem_error::ProblemError;
use crate::refine::parameters::calibration::{INTRINSIC_PARAMETERS, Kappa, RADIUS_INDEX};
use crate::refine::parameters::frame_estimate::{FrameEstimate, FrameStep};
use crate::refine::problem::block_sums::BlockSums;
use crate::refine::problem::linearisation::{FrameContribution, Linearisation};
use crate::refine::problem::unknown_texture::UnknownTexture;
use crate::refine::samples::footprints::footprint;
use crate::refine::samples::sampling::Sampling;
use crate::refine::samples::tile_coverage::{FrameImages, TileCoverage};
use crate::refine::samples::visibility::{Exclusions, PosedFrame};
use crate::refine::tiles::denoising::Denoiser;
use crate::refine::tiles::frame_samples::SampledFrame;
use crate::refine::tiles::grid::WallGrid;
use crate::refine::tiles::residual_weighting::NoiseModel;
use crate::surface::{Surface, lens_jacobian, viewing_distance, wall_jacobian};
use nalgebra::Vector5;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Arc;

/// Blocks of tiles worked on before their sums are added up: bounds the memory, whatever the
/// length.
const BATCH: usize = 64;
/// Samples over a frame's height, at least.
const LEAST_ROWS: u32 = 90;
/// A camera looks no farther than this many radii, when the lattice is laid out.
const LONGEST_VIEW_RADII: f64 = 3.0;
/// Largest gain that a step may lead to, standard deviations of the prior. A frame that fits
/// nowhere is tempted to say nothing, with a gain of naught, which rounding then makes something
/// of.
const MOST_GAIN_SIGMA: f64 = 10.0;
/// Stiffness of the gauge at the first frame over that of its pixels.
const GAUGE_TIE: f64 = 1e6;

/// The cost of a run of frames on a fixed set of wall samples.
///
/// `participants` are sampled; of them the `active` frames are estimated and the others held. The
/// wall is worked through in stretches along the tunnel, so that memory for frames and samples does
/// not grow with its length.
///
/// With a rolling shutter, the motion of each camera during its picture is that of the poses the
/// problem was made with, and stays as it is. A step of a frame by ξ changes its neighbours' motion
/// by `readout/(2 interval) ξ`, a few hundredths, and what is left of that is taken up by the next
/// solve.
pub struct PhotometricProblem<'a> {
    pub(super) scene: EstimationContext<'a>,
    pub(super) sampling: Sampling,
    pub(super) pictures: FrameImages<'a>,
    pub(super) camera: Camera,
    pub(super) grid: WallGrid,
    pub(super) participants: Range<usize>,
    pub(super) active: Range<usize>,
    pub(super) held: Vec<FrameEstimate>,
    /// Motion of each participant's camera if its readout took a second.
    pub(super) rates: Vec<Sweep>,
    pub(super) coverage: TileCoverage<'a>,
    /// The first active frame that is compared, counted from the first active one: the gauge is
    /// tied there.
    pub(super) tied: Option<usize>,
    /// Number of frames that are compared.
    pub(super) compared: usize,
    pub(super) pattern: Pattern,
    pub(super) symbolic: SymbolicFactorisation,
    pub(super) sigma: f64,
    pub(super) noise: NoiseModel,
    /// Takes the noise from the fused texture for its slopes.
    pub(super) denoiser: Option<Denoiser>,
    /// What is known of the wall, if it is solved for jointly with the poses.
    pub(super) wall: Option<WallModel>,
    /// What lessens the information of slopes, if they are not to count as known.
    pub(super) unknown_texture: Option<UnknownTexture>,
    /// True if the shared unknowns are estimated.
    pub(super) calibrates: bool,
}

impl<'a> PhotometricProblem<'a> {
    /// Chooses the wall samples for the present estimates and estimates the noise from the
    /// residuals there.
    ///
    /// # Errors
    /// [`ProblemError`].
    pub fn new(
        scene: &EstimationContext<'a>,
        sampling: Sampling,
        members: FrameWindow,
    ) -> Result<Self, ProblemError> {
        let Sampling {
            level,
            density,
            information,
            ..
        } = sampling;
        let FrameWindow {
            participants,
            active,
            estimates,
            compared,
        } = members;
        let camera = scene.camera.at_level(level);
        let compared_frames = compared.iter().filter(|compared| **compared).count();
        let tied = active
            .clone()
            .position(|frame| compared[frame - participants.start]);
        let rate = |frame| scene.sweep_rate(frame, &participants, estimates);
        let rates: Vec<Sweep> = participants.clone().map(rate).collect();
        let readout_s = scene.calibration.readout_s(&scene.kappa);
        let placed = participants
            .clone()
            .into_par_iter()
            .zip(estimates.par_iter().zip(compared.par_iter()))
            .map(|(frame, (estimate, compared))| {
                if !compared {
                    return Ok(None);
                }
                let pose = estimate.pose;
                let sweep = rates[frame - participants.start].times(readout_s);
                Ok(Some(PosedFrame {
                    pose,
                    sweep,
                    footprint: footprint(scene, &camera.sweeping(&sweep), frame, &pose)?,
                    active: active.contains(&frame),
                }))
            })
            .collect::<Result<Vec<Option<PosedFrame>>, ProblemError>>()?;
        let pixel_size_m = pixel_on_wall(scene.surface, &camera, placed.iter().flatten());
        let grid = WallGrid::new(
            scene.surface,
            pixel_size_m,
            density.max(least_density(camera.height)),
        );
        let pictures = FrameImages {
            frames: scene.frames,
            first: participants.start,
            level,
        };
        let hidden = Exclusions {
            ignored: scene.ignored,
            mask: scene.frames.mask(&camera),
        };
        let coverage = TileCoverage::new(
            scene.surface,
            grid,
            camera,
            pictures,
            hidden,
            information,
            placed,
        )?;
        let slot = |k: &usize| {
            let frame = participants.start + k;
            active.contains(&frame).then(|| frame - active.start)
        };
        let covisible = coverage.pairs.iter();
        let covisible = covisible.filter_map(|(a, b)| slot(a).zip(slot(b)));
        let pattern = Pattern::new(active.len(), covisible.chain(scene.prior.pairs(&active)));
        let symbolic =
            SymbolicFactorisation::new(&pattern).map_err(|source| ProblemError::Factor {
                first: active.start,
                last: active.end - 1,
                source,
            })?;
        let mut problem = Self {
            scene: *scene,
            sampling,
            pictures,
            camera,
            grid,
            held: estimates.to_vec(),
            rates,
            coverage,
            tied,
            compared: compared_frames,
            pattern,
            symbolic,
            participants,
            active,
            sigma: 1.0,
            noise: NoiseModel {
                floor: 1.0,
                steepness: 0.0,
            },
            denoiser: None,
            wall: None,
            unknown_texture: None,
            calibrates: false,
        };
        problem.estimate_noise()?;
        if sampling.joint {
            problem.wall = problem.learn_wall()?;
        }
        Ok(problem)
    }

    /// The same for frames without noise, weighted as if each pixel had noise of `sigma` grey
    /// levels: no residual is rejected, and all slopes are texture.
    pub fn with_known_noise(self, sigma: f64) -> Self {
        Self {
            sigma,
            noise: NoiseModel {
                floor: f32::MAX,
                steepness: 0.0,
            },
            denoiser: None,
            ..self
        }
    }

    /// The same with the information that is left where the texture is known by its spectrum only.
    pub fn with_unknown_texture(self, texture: &UnknownTexture) -> Self {
        Self {
            unknown_texture: Some(texture.clone()),
            ..self
        }
    }

    /// The same with the scene's shared unknowns estimated, too; all participants must be active.
    pub fn calibrating(self) -> Self {
        Self {
            calibrates: self.scene.calibration.has_free_parameters() && self.held_frames() == 0,
            ..self
        }
    }

    /// The shared unknowns that the problem was made with.
    pub fn kappa(&self) -> Kappa {
        self.scene.kappa
    }

    /// The estimates of the active frames that the problem was made with.
    pub fn start(&self) -> Vec<FrameEstimate> {
        let first = self.active.start - self.participants.start;
        self.held[first..first + self.active.len()].to_vec()
    }

    /// The block pattern of the normal matrix.
    pub fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// The symbolic factorisation of the normal matrix.
    pub fn symbolic(&self) -> &SymbolicFactorisation {
        &self.symbolic
    }

    /// Number of tiles that are compared.
    pub fn tiles(&self) -> usize {
        self.coverage.tiles
    }

    /// True if the wall is solved for jointly with the poses: if it was asked for, and there is
    /// something between the pixels to be solved for.
    pub fn is_joint(&self) -> bool {
        self.wall.is_some()
    }

    /// Share of the wall that is compared.
    pub fn share_of_wall(&self) -> f64 {
        self.coverage.tiles as f64 / self.coverage.all_tiles.max(1) as f64
    }

    /// Estimated noise of a pixel, 1-σ in grey levels.
    pub fn sigma(&self) -> f64 {
        self.sigma
    }

    /// Turns a factorisation failure into an error that names the frames.
    pub fn factor_error(&self, source: FactorError) -> ProblemError {
        ProblemError::Factor {
            first: self.active.start,
            last: self.active.end - 1,
            source,
        }
    }

    /// The camera at full size with the motion of a participant's.
    pub fn camera_of(&self, participant: usize) -> Camera {
        let readout_s = self.scene.calibration.readout_s(&self.scene.kappa);
        let sweep = self.rates[participant].times(readout_s);
        self.scene.camera.sweeping(&sweep)
    }

    /// The frames of a stretch at the given estimates of all participants, seen by `camera` (of the
    /// level), read out in `readout_s`.
    fn views<'s>(
        &self,
        stretch: usize,
        pictures: &'s [Arc<Pyramid>],
        estimates: &[FrameEstimate],
        camera: Camera,
        readout_s: f64,
    ) -> Vec<SampledFrame<'s>> {
        let frames = self.coverage.frames(stretch).iter();
        frames
            .zip(pictures)
            .map(|(k, picture)| {
                SampledFrame::new(
                    picture.level(self.sampling.level),
                    camera.sweeping(&self.rates[*k].times(readout_s)),
                    &estimates[*k],
                )
                .interpolated(self.sampling.interpolation)
            })
            .collect()
    }

    /// The same as the problem was made.
    pub(super) fn held_views<'s>(
        &self,
        stretch: usize,
        pictures: &'s [Arc<Pyramid>],
    ) -> Vec<SampledFrame<'s>> {
        let readout_s = self.scene.calibration.readout_s(&self.scene.kappa);
        self.views(stretch, pictures, &self.held, self.camera, readout_s)
    }

    fn with_active(&self, active: &[FrameEstimate]) -> Vec<FrameEstimate> {
        let mut estimates = self.held.clone();
        let first = self.active.start - self.participants.start;
        estimates[first..first + active.len()].copy_from_slice(active);
        estimates
    }

    /// True if a frame can be so: its camera inside the tunnel, its gain within
    /// [`MOST_GAIN_SIGMA`].
    pub fn is_feasible(&self, estimate: &FrameEstimate) -> bool {
        let most_gain = MOST_GAIN_SIGMA * self.scene.prior.log_gain_sigma;
        let inside = self.scene.surface.check_inside(&estimate.pose.t_wc);
        inside.is_ok() && estimate.log_gain.abs() <= most_gain
    }

    /// Cost and normal equations at the given estimates of the active frames and the problem's own
    /// shared unknowns.
    ///
    /// # Errors
    /// As [`PhotometricProblem::linearise_at`].
    pub fn linearise(&self, active: &[FrameEstimate]) -> Result<Linearisation, ProblemError> {
        self.linearise_at(active, &self.scene.kappa)
    }

    /// Cost and normal equations at the given estimates of the active frames and shared unknowns.
    ///
    /// A lens that folds the picture costs infinitely much.
    ///
    /// The same sums in the same order whatever the number of threads.
    ///
    /// # Errors
    /// [`ProblemError::Frame`] if a frame has to be read again and cannot be.
    pub fn linearise_at(
        &self,
        active: &[FrameEstimate],
        kappa: &Kappa,
    ) -> Result<Linearisation, ProblemError> {
        let estimates = self.with_active(active);
        let mut normal = NormalEquations::zeros(&self.pattern);
        let mut frames = vec![FrameContribution::default(); self.active.len()];
        let mut scatter = vec![Block::zeros(); self.pattern.blocks()];
        let mut border = self
            .calibrates
            .then(|| SharedBorder::zeros(self.active.len()));
        let calibration = self.scene.calibration;
        let Some(lens) = calibration.camera(kappa) else {
            return Ok(Linearisation {
                cost: f64::INFINITY,
                normal,
                scatter,
                frames,
                border_scatter: border.clone(),
                border,
            });
        };
        let mut border_scatter = border.clone();
        let mut cost = 0.0;
        for stretch in 0..self.coverage.len() {
            let visibility = self.coverage.visibility(stretch)?;
            let pictures = self.pictures.of(self.coverage.frames(stretch))?;
            let camera = lens.at_level(self.sampling.level);
            let views = self.views(
                stretch,
                &pictures,
                &estimates,
                camera,
                calibration.readout_s(kappa),
            );
            for batch in visibility.blocks.chunks(BATCH) {
                let sums: Vec<BlockSums> = batch
                    .par_iter()
                    .map(|block| self.sum_block(stretch, &visibility, block, &views, &lens))
                    .collect();
                for sum in sums {
                    cost += sum.cost;
                    sum.add_to(&self.pattern, &mut normal, &mut scatter, &mut frames);
                    if let Some(((lens, border), scatter)) = sum
                        .lens
                        .as_ref()
                        .zip(border.as_mut())
                        .zip(border_scatter.as_mut())
                    {
                        lens.add_to(&sum.slots, &sum.gradient, border, scatter);
                    }
                }
            }
        }
        let information = self.sigma.powi(-2);
        cost *= information;
        normal.blocks.iter_mut().for_each(|b| *b *= information);
        normal.gradient.iter_mut().for_each(|g| *g *= information);
        scatter
            .iter_mut()
            .for_each(|b| *b *= information * information);
        if let (Some(border), Some(scatter)) = (&mut border, &mut border_scatter) {
            border.scale(information);
            scatter.scale(information * information);
        }
        cost += self.add_prior(&estimates, kappa, &mut normal, border.as_mut());
        if let Some(border) = &mut border {
            cost += calibration.prior_cost(kappa) - self.volume() * kappa[RADIUS_INDEX];
            border.gradient[RADIUS_INDEX] -= self.volume();
            border.close(&calibration, kappa);
        }
        if self.held_frames() == 0 {
            let tied = self.tied.unwrap_or(0);
            self.tie_gauge(tied, &active[tied], &mut normal);
        }
        Ok(Linearisation {
            cost,
            normal,
            scatter,
            frames,
            border,
            border_scatter,
        })
    }

    /// By how much the logarithm of the volume that the pixels leave to the positions grows with
    /// that of the radius.
    ///
    /// Pixels fix the 3N − 1 coordinates of N positions (not the one along the axis) in units of
    /// the radius. In metres, where the prior is a density, they leave a volume that grows as
    /// `r^(3N − 1)`. Without this term the radius would shrink until the steps had no noise at all.
    fn volume(&self) -> f64 {
        if self.scene.calibration.free[RADIUS_INDEX] {
            (3 * self.compared) as f64 - 1.0
        } else {
            0.0
        }
    }

    pub(super) fn held_frames(&self) -> usize {
        self.participants.len() - self.active.len()
    }

    /// The prior's part of the normal matrix at the given estimates of the active frames, and of
    /// its border.
    pub fn prior_information(
        &self,
        active: &[FrameEstimate],
        kappa: &Kappa,
    ) -> (Vec<Block>, SharedBorder) {
        let mut normal = NormalEquations::zeros(&self.pattern);
        let mut border = SharedBorder::zeros(self.active.len());
        let estimates = self.with_active(active);
        self.add_prior(&estimates, kappa, &mut normal, Some(&mut border));
        border.close(&self.scene.calibration, kappa);
        (normal.blocks, border)
    }

    /// Adds the prior of the poses and exposures at the `estimates` of all participants; returns
    /// its cost.
    fn add_prior(
        &self,
        estimates: &[FrameEstimate],
        kappa: &Kappa,
        normal: &mut NormalEquations,
        border: Option<&mut SharedBorder>,
    ) -> f64 {
        self.scene.prior.add(
            &self.participants,
            estimates,
            &self.active,
            &self.scene.calibration.datum(kappa),
            &self.pattern,
            normal,
            border,
        )
    }

    /// Stiffens the first compared frame against moving along the gauge, where the pixels say
    /// nothing and rounding would otherwise decide. Neither cost nor gradient change: where the
    /// trajectory stands along the gauge is settled in closed form, by
    /// [`crate::refine::model::prior::Prior::align_gauge`].
    fn tie_gauge(&self, slot: usize, first: &FrameEstimate, normal: &mut NormalEquations) {
        let Some(place) = self.pattern.block_index(slot, slot) else {
            return;
        };
        let pose_block = normal.blocks[place].fixed_view::<6, 6>(0, 0).into_owned();
        for direction in self.scene.surface.gauge().directions(&first.pose) {
            let stiffness = (direction.transpose() * pose_block * direction)[0]
                / direction.norm_squared().powi(2);
            let tie = direction * direction.transpose() * (GAUGE_TIE * stiffness);
            let mut block = normal.blocks[place].fixed_view_mut::<6, 6>(0, 0);
            block += tie;
        }
    }

    /// How many freedoms of the poses the tie of the gauge takes.
    pub fn constrained_gauge_freedoms(&self) -> usize {
        match self.held_frames() {
            0 => self.scene.surface.gauge().freedoms(),
            _ => 0,
        }
    }

    pub(super) fn slot(&self, participant: usize) -> Option<usize> {
        let frame = self.participants.start + participant;
        self.active
            .contains(&frame)
            .then(|| frame - self.active.start)
    }

    /// A pixel of the pictures compared, in pixels of full size.
    pub fn pixel_px(&self) -> f64 {
        2f64.powi(self.sampling.level as i32)
    }

    /// How far a step, with `shared` that of the shared unknowns, moves the wall under each active
    /// frame, in pixels of full size: the largest over the frame's middle and corners.
    pub fn wall_step_px(
        &self,
        active: &[FrameEstimate],
        step: &[FrameStep],
        shared: &Kappa,
    ) -> Vec<f64> {
        let lens = shared.fixed_rows::<INTRINSIC_PARAMETERS>(0).into_owned();
        active
            .iter()
            .zip(step)
            .map(|(estimate, step)| self.frame_step_px(estimate, step, &lens) * self.pixel_px())
            .collect()
    }

    fn frame_step_px(
        &self,
        estimate: &FrameEstimate,
        step: &FrameStep,
        lens: &Vector5<f64>,
    ) -> f64 {
        let xi: nalgebra::Vector6<f64> = step.fixed_rows::<6>(0).into();
        let pose = &estimate.pose;
        (self.camera.probes().into_iter())
            .filter_map(|ray_c| {
                let ray = pose.r_wc * ray_c;
                let hit = self.scene.surface.hit(&pose.t_wc, &ray).ok()?;
                let wall = self.scene.surface.frame(hit.wall);
                let a = wall_jacobian(pose, &wall);
                let mut moved = a * xi;
                if self.calibrates {
                    let x_c = ray_c * hit.range;
                    moved += lens_jacobian(pose, &a, &self.scene.camera, &x_c) * lens;
                }
                Some(moved.norm() * self.camera.fy / hit.range)
            })
            .fold(0.0, f64::max)
    }
}

/// Wall samples per pixel along each axis, at least: one, but more at coarse levels, where whole
/// tiles of pixels would leave much of the frame's border unused.
fn least_density(rows: u32) -> f64 {
    (f64::from(LEAST_ROWS) / f64::from(rows)).ceil().max(1.0)
}

/// A pixel's width on the wall in the median frame's middle, metres. Frames that look along the
/// tunnel do not count.
fn pixel_on_wall<'p>(
    surface: &dyn Surface,
    camera: &Camera,
    placed: impl Iterator<Item = &'p PosedFrame>,
) -> f64 {
    let mut ranges: Vec<f64> = placed
        .filter_map(|frame| viewing_distance(surface, &frame.pose).ok())
        .collect();
    ranges.sort_unstable_by(f64::total_cmp);
    let middle = ranges.get(ranges.len() / 2);
    let radius_m = surface.perimeter_m() / std::f64::consts::TAU;
    middle
        .copied()
        .unwrap_or(radius_m)
        .min(LONGEST_VIEW_RADII * radius_m)
        / camera.fy
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::FrameCache;
    use crate::refine::model::prior::Prior;
    use crate::refine::parameters::calibration::{Calibration, SHARED_PARAMETERS};
    use crate::refine::parameters::frame_estimate::FRAME_PARAMETERS;
    use crate::refine::test_scene::{prior, scene};
    use crate::refine::tiles::interpolation::Interpolation;
    use crate::test_wall::{TestWall, waves};
    use nalgebra::Vector6;
    use std::borrow::Cow;

    /// A ring of frames of a smooth wall, each with an exposure of its own, and estimates near the
    /// truth.
    struct Ring {
        wall: TestWall,
        frames: FrameCache,
        prior: Prior,
        calibration: Calibration,
        estimates: Vec<FrameEstimate>,
    }

    /// Deterministic numbers in −1..1.
    fn number(k: usize, salt: f64) -> f64 {
        (12.9898 * (k as f64 + 1.0) + 78.233 * salt).sin()
    }

    impl Ring {
        fn new(off_by: f64) -> Self {
            let wall = TestWall::ring(waves);
            let exposed = |(k, frame): (usize, crate::frames::GreyImage)| {
                let (gain, bias) = ((0.1 * number(k, 1.0)).exp(), 4.0 * number(k, 2.0));
                let data = frame.data().iter().map(|v| gain as f32 * v + bias as f32);
                let image =
                    crate::frames::GreyImage::new(frame.width(), frame.height(), data.collect());
                (gain, bias, Pyramid::new(image, 1))
            };
            let (mut frames, mut estimates) = (Vec::new(), Vec::new());
            for (k, frame) in wall.frames().into_iter().enumerate() {
                let (gain, bias, pyramid) = exposed((k, frame));
                frames.push(pyramid);
                let xi = Vector6::from_fn(|n, _| off_by * number(k, 3.0 + n as f64));
                estimates.push(FrameEstimate {
                    pose: wall.poses[k].retract(&xi),
                    log_gain: gain.ln() + off_by * number(k, 9.0),
                    bias: bias + 1e3 * off_by * number(k, 10.0),
                });
            }
            let prior = independent_prior(&wall.poses);
            Self {
                calibration: Calibration {
                    free: [true; SHARED_PARAMETERS],
                    sigma: Kappa::repeat(1.0),
                    ..Calibration::none(&wall.camera)
                },
                wall,
                frames: FrameCache::of_pyramids(frames),
                prior,
                estimates,
            }
        }

        fn problem(&self) -> PhotometricProblem<'_> {
            self.problem_with(1.0)
        }

        fn sampling(&self) -> Sampling {
            Sampling {
                density: 2.0,
                ..Sampling::of(0)
            }
        }

        /// That of a solve for wall and poses together.
        fn joint(&self) -> Sampling {
            Sampling {
                interpolation: Interpolation::Bicubic,
                variance_weighting: true,
                joint: true,
                ..self.sampling()
            }
        }

        fn problem_with(&self, information: f64) -> PhotometricProblem<'_> {
            self.problem_of(Sampling {
                information,
                ..self.sampling()
            })
        }

        fn problem_of(&self, sampling: Sampling) -> PhotometricProblem<'_> {
            let scene = EstimationContext {
                calibration: self.calibration,
                ..scene(&self.wall, &self.frames, &self.prior)
            };
            let all = 0..self.estimates.len();
            let members = FrameWindow {
                participants: all.clone(),
                active: all,
                estimates: &self.estimates,
                compared: Cow::Owned(vec![true; self.estimates.len()]),
            };
            PhotometricProblem::new(&scene, sampling, members).unwrap()
        }
    }

    /// Central differences of the cost against the gradient, unknown by unknown. The texture is
    /// eliminated and the loss robust; where frames agree but for their small displacements, the
    /// fused texture's gradient is each frame's own, so the two must agree up to what sampling
    /// leaves (1 to 3 %). (The frames have no noise, so the loss is as narrow as it ever gets, and
    /// residuals must be well inside: at its shoulders S needs more reweightings to be the
    /// minimiser than are worth their time on real data.)
    #[test]
    fn the_gradient_is_the_derivative_of_the_cost() {
        let ring = Ring::new(1e-4);
        check_gradient(&ring, &ring.problem());
        check_gradient(
            &ring,
            &ring.problem_of(Sampling {
                interpolation: Interpolation::Bicubic,
                variance_weighting: true,
                ..ring.sampling()
            }),
        );
    }

    /// With the wall solved for, the gradient is not quite the derivative of what pixels cost (x is
    /// held by its roughness, too), but it must change as the normal equations say, along every
    /// unknown.
    #[test]
    fn the_joint_gradient_changes_as_the_normal_equations_say() {
        let ring = Ring::new(1e-4);
        let problem = ring.problem_of(ring.joint());
        let normal = problem.linearise(&ring.estimates).unwrap().normal;
        let steps = [2e-4, 2e-4, 2e-4, 2e-4, 2e-4, 2e-4, 1e-3, 0.1];
        for (unknown, step) in steps.into_iter().enumerate() {
            // The first frame stays: the equations hold it for the gauge's sake.
            let mut direction: Vec<f64> = (0..ring.estimates.len())
                .map(|k| step * number(k, 20.0 + unknown as f64))
                .collect();
            direction[0] = 0.0;
            let slope = |amount: f64| {
                let moved: Vec<_> = (ring.estimates.iter().zip(&direction))
                    .map(|(estimate, d)| {
                        let mut step = FrameStep::zeros();
                        step[unknown] = amount * d;
                        estimate.retract(&step)
                    })
                    .collect();
                let gradient = problem.linearise(&moved).unwrap().normal.gradient;
                let along = gradient.iter().zip(&direction);
                along.map(|(g, d)| g[unknown] * d).sum::<f64>()
            };
            let change = 0.5 * (slope(1.0) - slope(-1.0));
            let mut foretold = 0.0;
            for i in 0..direction.len() {
                for j in i..direction.len() {
                    if let Some(place) = problem.pattern().block_index(i, j) {
                        let term = normal.blocks[place][(unknown, unknown)];
                        let twice = if i == j { 1.0 } else { 2.0 };
                        foretold += twice * term * direction[i] * direction[j];
                    }
                }
            }
            let ratio = change / foretold;
            assert!((0.9..1.1).contains(&ratio), "unknown {unknown}: {ratio}");
        }
    }

    fn check_gradient(ring: &Ring, problem: &PhotometricProblem) {
        let gradient = problem.linearise(&ring.estimates).unwrap().normal.gradient;
        let steps = [2e-4, 2e-4, 2e-4, 2e-4, 2e-4, 2e-4, 1e-3, 0.1];
        for unknown in 0..FRAME_PARAMETERS {
            let (mut error, mut size) = (0.0f64, 0.0f64);
            for frame in 0..ring.estimates.len() {
                let cost = |amount: f64| {
                    let mut step = FrameStep::zeros();
                    step[unknown] = amount;
                    let mut moved = ring.estimates.clone();
                    moved[frame] = moved[frame].retract(&step);
                    problem.linearise(&moved).unwrap().cost
                };
                let h = steps[unknown];
                let numeric = (cost(h) - cost(-h)) / (2.0 * h);

                error += (numeric - gradient[frame][unknown]).powi(2);
                size += numeric.powi(2);
            }
            let relative = (error / size).sqrt();
            assert!(relative < 0.05, "unknown {unknown}: {relative}");
        }
    }

    /// The same for what all frames share.
    #[test]
    fn the_shared_gradient_is_the_derivative_of_the_cost() {
        let ring = Ring::new(1e-4);
        let problem = ring.problem().with_shared_parameters();
        let mut kappa = Kappa::zeros();
        kappa
            .fixed_rows_mut::<5>(0)
            .copy_from_slice(&[2e-4, 0.02, -0.02, 3e-4, -3e-4]);
        let at = |kappa: &Kappa| problem.linearise_at(&ring.estimates, kappa).unwrap();
        let gradient = at(&kappa).border.unwrap().gradient;
        let steps = [2e-4, 0.02, 0.02, 5e-4, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3];
        for (k, h) in steps.into_iter().enumerate() {
            let moved = |amount: f64| {
                let mut kappa = kappa;
                kappa[k] += amount;
                at(&kappa).cost
            };
            let numeric = (moved(h) - moved(-h)) / (2.0 * h);
            let relative = (numeric - gradient[k]).abs() / numeric.abs();
            assert!(
                relative < 0.05,
                "unknown {k}: {numeric} and {}",
                gradient[k]
            );
        }
    }

    /// Half of the information is in less than half of the wall, and the same unknowns are found
    /// from it.
    #[test]
    fn half_the_information_is_in_less_than_half_of_the_wall() {
        let ring = Ring::new(1e-4);
        let (all, half) = (ring.problem(), ring.problem_with(0.5));
        assert!((0.2..0.5).contains(&half.share_of_wall()));
        let trace = |problem: &PhotometricProblem| -> f64 {
            let at = problem.linearise(&ring.estimates).unwrap();
            let poses = at.normal.blocks.iter();
            problem.sigma().powi(2)
                * poses
                    .map(|b| b.fixed_view::<6, 6>(0, 0).trace())
                    .sum::<f64>()
        };
        let share = trace(&half) / trace(&all);
        assert!((0.4..0.65).contains(&share), "{share}");
    }

    #[test]
    fn no_camera_leaves_the_tunnel_and_no_frame_falls_silent() {
        let ring = Ring::new(1e-4);
        let problem = ring.problem();
        let estimate = ring.estimates[2];
        assert!(problem.is_feasible(&estimate));
        let mut outside = estimate;
        outside.pose.t_wc.z += 2.0 * ring.wall.circle.perimeter_m() / std::f64::consts::TAU;
        assert!(!problem.is_feasible(&outside));
        let silent = FrameEstimate {
            log_gain: -14.0,
            ..estimate
        };
        assert!(!problem.is_feasible(&silent));
    }

    /// From 2 mrad and 2 mm off to the truth, along the gauge's freedoms, in undamped steps.
    #[test]
    fn gauss_newton_steps_lower_the_cost_to_the_truth() {
        let ring = Ring::new(2e-3);
        steps_lead_to_the_truth(&ring, &ring.problem());
        steps_lead_to_the_truth(&ring, &ring.problem_of(ring.joint()));
    }

    fn steps_lead_to_the_truth(ring: &Ring, problem: &PhotometricProblem) {
        let mut estimates = ring.estimates.clone();
        let start = problem.linearise(&estimates).unwrap().cost;
        for _ in 0..6 {
            let at = problem.linearise(&estimates).unwrap();
            let factor = problem
                .symbolic()
                .factorise(problem.pattern(), &at.normal, 0.0)
                .unwrap();
            let step = factor.step(&at.normal.gradient);
            estimates = estimates
                .iter()
                .zip(&step)
                .map(|(estimate, step)| estimate.retract(step))
                .collect();
        }
        let end = problem.linearise(&estimates).unwrap().cost;
        assert!(end < 0.1 * start, "{start} → {end}");
        let poses: Vec<_> = estimates.iter().map(|e| e.pose).collect();
        let motion = ring.wall.circle.gauge().align(&poses, &ring.wall.poses);
        for (pose, truth) in poses.iter().zip(&ring.wall.poses) {
            let error = truth.local(&motion.apply(pose)).norm();
            assert!(error < 4e-4, "{error}");
        }
    }
}
