//! Effects on a frame between the light of the scene and the written picture.
//!
//! Each effect is a small step from image to image in a file of its own; `effect_chain` has their
//! order. All random parts follow from the seed and the frame.
//!
//! | file | content |
//! | --- | --- |
//! | `effect_options` | which effects there are |
//! | `frame_effect` | interface of an effect |
//! | `effect_chain` | their order |
//! | `moving_objects`, `vignetting`, `rig_shaft` | before the lens |
//! | `defocus`, `lens_dust` | the lens |
//! | `flicker`, `darkness`, `exposure_steps`, `exposure` | amount of light |
//! | `fault_injection` | faults of single frames |
//! | `sensor`, `tone_curve` | noise, transfer, quantisation |
//! | `overlay`, `overlay_text`, `overlay_logo` | text and logo that are burnt in |

pub(super) mod darkness;
mod defocus;
pub(super) mod effect_chain;
pub(super) mod effect_options;
pub(super) mod exposure;
mod exposure_steps;
mod fault_injection;
pub(super) mod flicker;
mod frame_effect;
mod lens_dust;
mod moving_objects;
pub(super) mod overlay;
mod overlay_logo;
mod overlay_text;
pub(super) mod rig_shaft;
pub(super) mod sensor;
mod tone_curve;
mod vignetting;
