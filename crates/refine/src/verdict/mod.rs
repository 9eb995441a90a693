//! The verdict: which frames are right, whether the prior agrees, and whether the result may be
//! used.
//!
//! ```text
//! frame_verdict ──→ prior_test ──→ bridging ──→ survey_verdict
//! ```
//!
//! [`frame_verdict`] turns the evidence about a frame into one decision with its reason, and
//! [`prior_test`] compares the refined steps with the initial ones. Frames that are not photometric
//! get their poses by the prior ([`bridging`]); a survey without any keeps its initial poses.
//! [`survey_verdict`] says in one sentence what may be done with the result, [`length_scale`] how
//! sure its lengths are, [`rig_report`] how the cameras of a rig are mounted, and
//! [`other_readings`] in which other reading of the survey its frames fit.

pub mod bridging;
pub mod frame_verdict;
pub mod length_scale;
pub mod other_readings;
pub mod prior_test;
pub mod rig_report;
pub mod survey_verdict;
