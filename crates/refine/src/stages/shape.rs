//! The wall's shape between solves: begun before the first at full size, with the lens and, in a
//! straight tunnel, a curvature; its strengths learned after it.

use crate::model::problem_error::ProblemError;
use crate::parameters::calibration::{
    BEND_INDEX, BEND_PARAMETERS, INTRINSIC_PARAMETERS, Kappa, SHARED_PARAMETERS,
};
use crate::parameters::frame_estimate::FrameEstimate;
use crate::parameters::shape::{Shape, ShapeModel};
use crate::parameters::shape_functions::ShapeStep;
use crate::parameters::shape_limits::{
    FIRST_FINEST_COLUMNS, MAX_PRIOR_SIGMAS, MAX_STRENGTH_SIGMAS, with_finer_lattice,
};
use crate::parameters::unseen_errors::UnseenErrors;
use crate::samples::footprints::{extent_h_m, footprints};
use crate::solver::gauss_newton::Solution;
use crate::solver::shape_evidence::{LearnedShape, learn_shape};
use crate::stages::setup::Setup;
use crate::stages::state::PipelineState;
use std::ops::Range;
use tunnelstitch_geometry::numerics::significance::chi_squared_bounds;

/// The lens in κ.
const LENS: Range<usize> = 0..INTRINSIC_PARAMETERS;
/// The curvature in κ.
const BEND: Range<usize> = BEND_INDEX..BEND_INDEX + BEND_PARAMETERS;
/// Rate at which a scale of no use is kept until the dense solves, which see more than the ones
/// before.
const KEPT_RATE: f64 = 0.3;
/// Factor by which a strength, or the information of pixels against it, may change without a new
/// solve; the estimate hardly depends on it.
pub const MAX_STRENGTH_CHANGE: f64 = 1.3;

/// Begins to estimate the shape, and the lens with it, if the options ask for it.
///
/// # Errors
/// [`ProblemError::Placement`].
pub fn begin(setup: &Setup, state: &mut PipelineState) -> Result<(), ProblemError> {
    if state.shape.is_some() || setup.shape_sigma_m == 0.0 {
        return Ok(());
    }
    let context = setup.context(state);
    let extent = match &setup.wall {
        Some(wall) => wall.shape.model.extent_h_m(),
        None => extent_h_m(&footprints(&context, &state.frames)?),
    };
    let perimeter_m = context.nominal.perimeter_m();
    let known = context.displacement.map(|field| field.lattice().origin);
    let model = ShapeModel::new(
        perimeter_m,
        known.unwrap_or_default(),
        extent,
        FIRST_FINEST_COLUMNS,
        setup.shape_sigma_m,
    );
    state.shape = Some(match &setup.wall {
        Some(wall) => wall.start(model),
        None => Shape::nominal(model),
    });
    for k in LENS.filter(|k| setup.calibration.has_intrinsic(*k)) {
        state.free[k] = true;
    }
    state.free[BEND].fill(setup.may_bend());
    Ok(())
}

/// Shared parameters κ and frames where a solve begins.
pub type Start = (Kappa, Vec<FrameEstimate>);

/// Takes over the unknowns of a solution; false if its shape is not adopted.
pub fn take_over(
    setup: &Setup,
    state: &mut PipelineState,
    solution: &Solution,
    start: &Start,
) -> bool {
    let solved = &solution.unknowns;
    state.frames.estimates.clone_from(&solved.frames);
    state.kappa = solved.kappa;
    let shape = state.shape.take().map(|shape| Shape {
        coefficients: solved.shape.clone(),
        ..shape
    });
    shape.is_none_or(|shape| adopt(setup, state, shape, start))
}

/// Adopts a shape. One far beyond its prior means that something else is wrong: then it returns
/// false, the wall and the lens are those given, or the wall that fits measured points, and the
/// frames where they were at the start, for it has bent their poses, too.
fn adopt(setup: &Setup, state: &mut PipelineState, mut shape: Shape, start: &Start) -> bool {
    let most_m = MAX_PRIOR_SIGMAS * setup.shape_sigma_m;
    let is_plausible = |block: &ShapeStep| (0.0..=most_m).contains(&block.amax());
    let is_adopted = shape.coefficients.iter().all(is_plausible);
    if !is_adopted {
        (state.kappa, state.frames.estimates) = start.clone();
        shape.model.scales.clear();
        shape.model.dropped.clear();
        shape.coefficients.clear();
        state.unseen = UnseenErrors::default();
        if let Some(wall) = &setup.wall {
            shape.clone_from(&wall.shape);
        }
        fix_shared(setup, state);
    }
    state.shape = Some(shape);
    is_adopted
}

/// Fixes the shared parameters that were not asked for at their given values.
fn fix_shared(setup: &Setup, state: &mut PipelineState) {
    let asked_for = setup.calibration.free;
    state.tested.fill(false);
    let given = |k: usize| state.free[k] && !asked_for[k];
    let kappa = Kappa::from_fn(|k, _| if given(k) { 0.0 } else { state.kappa[k] });
    state.free = std::array::from_fn(|k| state.free[k] && asked_for[k]);
    setup.replace_kappa(state, kappa);
}

/// Learns the strengths of the shape at a full-size solution, and whether the lens differs from the
/// given one, and the tunnel from a straight one. Returns true if that changes anything; the state
/// is then where the new solve should end, or at the start if the shape is not adopted. `start`: of
/// the solve; `is_dense`: the solution has the samples of the last solves.
pub fn learn(
    setup: &Setup,
    state: &mut PipelineState,
    (solution, start): (&Solution, &Start),
    is_dense: bool,
) -> bool {
    let most_m = MAX_STRENGTH_SIGMAS * setup.shape_sigma_m;
    let alpha = match is_dense {
        true => setup.options.false_alarm_rate,
        false => KEPT_RATE,
    };
    let Some(learned) = learn_shape(solution, most_m, alpha) else {
        return false;
    };
    let kappa = solution.linearised_at.kappa;
    let of_lens = LENS.filter(|k| setup.calibration.has_intrinsic(*k)).count();
    let alarm_rate = setup.options.false_alarm_rate;
    let is_lens_changed =
        is_changed::<INTRINSIC_PARAMETERS>(&learned, &kappa, (LENS, of_lens), alarm_rate);
    let is_bent =
        is_changed::<BEND_PARAMETERS>(&learned, &kappa, (BEND, BEND_PARAMETERS), alarm_rate);
    let has_equations = |k: usize| state.free[k] || state.tested[k];
    let free = std::array::from_fn(|k| match k {
        _ if LENS.contains(&k) && is_lens_changed => has_equations(k),
        _ if BEND.contains(&k) && is_bent => has_equations(k),
        _ => state.free[k] && setup.calibration.free[k],
    });
    let tested: [bool; SHARED_PARAMETERS] = std::array::from_fn(|k| has_equations(k) && !free[k]);
    let held = std::array::from_fn(|k| tested[k].then(|| -kappa[k]));
    let Some((step, shared)) = learned.step_holding(&held) else {
        return false;
    };
    let mut shape = learned.shape_after(&step);
    let dropped = learned.dropped_scales(most_m, setup.options.false_alarm_rate);
    let limits = dropped.iter().map(|scale| scale.limit);
    shape.model.dropped.extend(limits);
    let shape = with_finer_lattice(shape);
    let before = solution.problem.shape().map(|before| &before.model);
    if free == state.free && before.is_some_and(|before| !is_rescaled(before, &shape.model)) {
        return false;
    }
    let stepped = solution
        .problem
        .stepped(&solution.linearised_at, &step, &shared);
    let unseen = std::mem::take(&mut state.unseen);
    let solves = state.levels.len() as u64;
    state.unseen = unseen.plus(learned.unseen_errors(&dropped, &tested, solves));
    (state.free, state.tested) = (free, tested);
    setup.replace_kappa(state, stepped.kappa);
    for (estimate, stepped) in state.frames.estimates.iter_mut().zip(stepped.frames) {
        if solution.problem.is_feasible(&stepped) {
            *estimate = stepped;
        }
    }
    adopt(setup, state, shape, start);
    true
}

/// True if the N shared parameters `which`, of which `count` exist, differ from the given ones by
/// more than chance: `κᵀ Σ⁻¹ κ`, Σ their covariance, is a χ² variable if they do not. `kappa`:
/// those where the equations are.
fn is_changed<const N: usize>(
    learned: &LearnedShape,
    kappa: &Kappa,
    (which, count): (Range<usize>, usize),
    false_alarm_rate: f64,
) -> bool {
    let Some((step, information)) = learned.shared() else {
        return false;
    };
    let Some(covariance) = information.cholesky().map(|factor| factor.inverse()) else {
        return false;
    };
    let change = (kappa + step).fixed_rows::<N>(which.start).into_owned();
    let covariance = covariance.fixed_view::<N, N>(which.start, which.start);
    let Some(of_change) = covariance.into_owned().cholesky() else {
        return false;
    };
    let square = change.dot(&of_change.solve(&change));
    let bounds = chi_squared_bounds(2.0 * false_alarm_rate, count as f64);
    bounds.is_some_and(|(_, most)| square > most)
}

/// True if scales come or go, or change their strength.
fn is_rescaled(before: &ShapeModel, after: &ShapeModel) -> bool {
    before.scales.len() != after.scales.len()
        || before
            .scales
            .iter()
            .zip(&after.scales)
            .any(|(before, after)| {
                let ratio = after.sigma_m / before.sigma_m;
                before.functions != after.functions
                    || !(1.0 / MAX_STRENGTH_CHANGE..MAX_STRENGTH_CHANGE).contains(&ratio)
            })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::RefineInput;
    use crate::options::RefineOptions;
    use crate::stages;
    use image::DynamicImage;
    use nalgebra::{UnitQuaternion, Vector3};
    use std::sync::Arc;
    use tunnelstitch_core::frames::FrameSet;
    use tunnelstitch_geometry::camera::Camera;
    use tunnelstitch_geometry::surface::Circle;
    use tunnelstitch_geometry::trajectory::{Jitter, JitterModel, Pose, StampedPose};

    /// Poses of frames along the tunnel, displaced along it.
    fn poses(displaced_m: f64) -> Vec<Pose> {
        let place = |k: i32| Vector3::new(0.0, 0.1 * f64::from(k) + displaced_m, 0.0);
        let pose = |k| Pose::new(UnitQuaternion::identity(), place(k));
        (0..4).map(pose).collect()
    }

    /// A shape within ten times its prior takes its frames along; one beyond that does not.
    #[test]
    fn frames_go_back_where_a_shape_is_not_believed() {
        let stamped = |(k, pose)| StampedPose {
            time_s: k as f64,
            pose,
        };
        let initial: Vec<_> = poses(0.0).into_iter().enumerate().map(stamped).collect();
        let frames = FrameSet::in_memory(initial.iter().map(|_| DynamicImage::new_luma8(64, 48)));
        let prior = Jitter {
            model: JitterModel::Independent,
            rotation_sigma_rad: 0.05,
            translation_sigma_m: [0.05; 3],
        };
        let camera = Camera::from_vertical_fov(64, 48, 1.0);
        let circle = Arc::new(Circle::new(3.0).unwrap());
        let input = RefineInput::new(camera, circle, &frames, &initial, prior);
        let options = RefineOptions::default();
        let setup = Setup::new(input, &options).unwrap();
        let estimates = |displaced_m| -> Vec<FrameEstimate> {
            let poses = poses(displaced_m).into_iter();
            poses.map(FrameEstimate::at).collect()
        };
        for (sigmas, is_believed) in [(9.0, true), (11.0, false)] {
            let mut state = stages::begin::begin(&setup);
            state.frames.estimates = estimates(0.0);
            let start = (state.kappa, state.frames.estimates.clone());
            begin(&setup, &mut state).unwrap();
            let mut shape = state.shape.clone().unwrap();
            assert!(!shape.coefficients.is_empty());
            for block in &mut shape.coefficients {
                block.fill(sigmas * setup.shape_sigma_m);
            }
            state.frames.estimates = estimates(0.02);
            assert_eq!(adopt(&setup, &mut state, shape, &start), is_believed);
            let place_m = state.frames.estimates[1].pose.t_wc.y;
            let expected_m = if is_believed { 0.12 } else { 0.1 };
            assert!((place_m - expected_m).abs() < 1e-12, "{place_m}");
            let adopted = state.shape.unwrap();
            assert_eq!(adopted.coefficients.is_empty(), !is_believed);
            assert_eq!(adopted.model.scales.is_empty(), !is_believed);
        }
    }
}
