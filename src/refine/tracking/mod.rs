//! Initial estimates: one frame after another is registered on the wall that its predecessors show.

pub mod alternating_calibration;
pub mod correlation_search;
pub mod prescreening;
pub mod reference_mosaic;
pub mod registration;
pub mod shading_correction;
pub mod track;
