//! Tracking: initial estimates for the global solve.
//!
//! ```text
//! prescreening → alternating_calibration → track ─┬→ pose_prediction → registration
//!  (first_light)  (shading_correction)            └→ windows
//! ```
//!
//! Prescreening rejects frames that show nothing; the mean of the others shows the light.
//! Tracking registers one frame after another: the prior predicts a pose, the correlation search
//! compares the unwrapped frame with a reference mosaic of its neighbours, and the hypotheses are
//! refined and chosen from. Sliding windows keep the error bounded. While shading or camera are
//! only roughly known, tracking alternates with their calibration. A focal length that is hardly
//! known is searched for before, by pairs of neighbours ([`focal_search`]). [`lamp_search`] finds a
//! lamp once poses are good.

pub mod alternating_calibration;
pub mod candidate;
pub mod correlation_search;
pub mod correlator;
pub mod first_light;
pub mod focal_search;
pub mod lamp_search;
pub mod light_model;
pub mod neighbour_pairs;
pub mod neighbours;
pub mod pose_prediction;
pub mod pose_separation;
pub mod prescreening;
pub mod reference_mosaic;
pub mod registration;
pub mod search_across;
pub mod search_along;
pub mod search_grid;
pub mod shading_correction;
pub mod tile_views;
pub mod track;
pub mod windows;
