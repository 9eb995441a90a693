//! The beginning of a refinement.

use crate::model::frame_states::FrameStates;
use crate::parameters::calibration::Kappa;
use crate::parameters::unseen_errors::UnseenErrors;
use crate::stages::plan::plan_stages;
use crate::stages::setup::Setup;
use crate::stages::state::PipelineState;
use crate::verdict::other_readings::OtherReadings;
use tunnelstitch_core::frames::PictureNoise;

/// The state before the first stage.
pub fn begin(setup: &Setup) -> PipelineState {
    let frames = FrameStates {
        estimates: Vec::new(),
        rejections: vec![None; setup.count()],
        kappa: Kappa::zeros(),
    };
    PipelineState {
        stages: plan_stages(setup.options),
        over: Vec::new(),
        noise: PictureNoise::default(),
        has_common_light: true,
        is_lamp_ruled_out: false,
        readings: OtherReadings::Untried,
        dispersion: 1.0,
        frames,
        kappa: Kappa::zeros(),
        free: setup.calibration.free,
        tested: setup.calibration.tested,
        shape: None,
        unseen: UnseenErrors::default(),
        tracking: None,
        solve: None,
        levels: Vec::new(),
        unobservable: Vec::new(),
    }
}
