//! Derivatives of points of the wall by the unknowns: of the point that a pixel shows, and of sums
//! of such.

use crate::model::context::EstimationContext;
use crate::parameters::calibration::{
    BEND_INDEX, BEND_PARAMETERS, INTRINSIC_PARAMETERS, Kappa, SHARED_PARAMETERS,
};
use crate::parameters::frame_estimate::{FRAME_PARAMETERS, FrameStep};
use crate::parameters::shape::ShapeModel;
use crate::parameters::unseen_errors::UnseenError;
use nalgebra::{Matrix2x6, SMatrix, Vector2};
use std::collections::BTreeMap;
use tunnelstitch_geometry::surface::{
    WallFrame, WallPoint, bend_jacobian, lens_jacobian, wall_jacobian,
};
use tunnelstitch_geometry::trajectory::Pose;

/// Derivative of a point of the wall, `(s, h)`, by the unknowns of one slot.
pub type SlotJacobian = SMatrix<f64, 2, FRAME_PARAMETERS>;
/// Derivative of a point of the wall, `(s, h)`, by the shared parameters.
pub type KappaJacobian = SMatrix<f64, 2, SHARED_PARAMETERS>;

/// Derivatives of a point of the wall by all unknowns on which it depends.
#[derive(Clone, Debug, Default)]
pub struct PointJacobians {
    /// By slots.
    pub slots: BTreeMap<usize, SlotJacobian>,
    /// By the shared parameters.
    pub shared: KappaJacobian,
    /// By the displacement of the wall, τ, and where.
    pub wall: Option<(Vector2<f64>, WallPoint)>,
}

impl PointJacobians {
    /// Adds `share` times the derivatives of the wall point of a fixed pixel: by its frame, the
    /// slot `k`, and the shared parameters.
    pub fn add_pixel(&mut self, k: usize, pixel: &PixelJacobians, share: f64) {
        let pose = self.slots.entry(k).or_default();
        let mut target = pose.fixed_columns_mut::<6>(0);
        target += pixel.pose * share;
        self.shared += pixel.shared * share;
    }

    /// Movement of the point by steps of the slots and of the shared parameters.
    pub fn moved(&self, step: impl Fn(usize) -> FrameStep, shared: &Kappa) -> Vector2<f64> {
        let of_slots = self.slots.iter();
        let of_slots = of_slots.map(|(slot, jacobian)| jacobian * step(*slot));
        of_slots.sum::<Vector2<f64>>() + self.shared * shared
    }

    /// Movement of the point by an error that is not seen.
    pub fn moved_by(&self, error: &UnseenError) -> Vector2<f64> {
        let step = |slot: usize| error.frames.get(slot).copied().unwrap_or_default();
        let of_wall = self.wall.map_or(Vector2::zeros(), |(tau, at)| {
            tau * error.displacement.at(at).delta_m
        });
        self.moved(step, &error.shared) + of_wall
    }

    /// Adds the derivatives by the displacement of the wall at `wall`: τ, and `τ φᵀ` by the
    /// coefficients of the shape, if one was estimated; `first`: slot of its first block.
    pub fn add_wall(
        &mut self,
        tau: Vector2<f64>,
        wall: WallPoint,
        shape: Option<&ShapeModel>,
        first: usize,
    ) {
        self.wall = Some((tau, wall));
        for function in shape.map_or_else(Vec::new, |shape| shape.functions_at(wall)) {
            let slot = self.slots.entry(first + function.block).or_default();
            let mut target = slot.column_mut(function.component);
            target += tau * function.value;
        }
    }
}

/// Derivatives of the wall point of a fixed pixel.
pub struct PixelJacobians {
    /// `A = ∂(s, h)/∂ξ`.
    pub pose: Matrix2x6<f64>,
    /// `C = ∂(s, h)/∂κ`.
    pub shared: KappaJacobian,
    /// `τ = ∂(s, h)/∂δ`.
    pub tau: Vector2<f64>,
}

/// Derivatives of the wall point `wall` with tangents `frame`, seen through a fixed pixel of a
/// frame from its `pose`.
pub fn pixel_jacobians(
    context: &EstimationContext,
    (index, pose): (usize, &Pose),
    wall: WallPoint,
    frame: &WallFrame,
) -> PixelJacobians {
    let a = wall_jacobian(pose, frame);
    let x_c = pose.to_camera(&frame.x_w);
    let mut shared = KappaJacobian::zeros();
    shared
        .fixed_columns_mut::<INTRINSIC_PARAMETERS>(0)
        .copy_from(&lens_jacobian(pose, &a, context.cameras.of(index), &x_c));
    if context.calibration.free[BEND_INDEX] {
        let straightened = context.surface.straightened(pose);
        shared
            .fixed_columns_mut::<BEND_PARAMETERS>(BEND_INDEX)
            .copy_from(&bend_jacobian(pose, &straightened, &a, &x_c));
    }
    PixelJacobians {
        pose: a,
        shared,
        tau: -(a.fixed_columns::<3>(3) * context.nominal.frame(wall).normal()),
    }
}
