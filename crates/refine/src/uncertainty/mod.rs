//! The stated uncertainty, and tests of the model that it rests on.
//!
//! ```text
//! exposure_equations → covariance, model_error
//! covariance, frame_sigma ──→ overdispersion ─┐
//! observed_curvature → observability ─────────┴→ solution_uncertainty
//! observability → calibration_report, rolling_shutter_test
//! ```
//!
//! A solution's covariance follows from its normal equations and the scatter of its scores. Frames
//! whose residuals scatter more than noise are overdispersed, and shared parameters that the data
//! hardly narrow down are unobservable. The rolling-shutter test estimates the readout time, and
//! the Cramér–Rao bound states what any estimator could reach.

pub mod bend_report;
pub mod calibration_report;
pub mod covariance;
pub mod covariance_file;
pub mod cramer_rao;
pub mod exposure_equations;
pub mod frame_sigma;
pub mod masked_report;
pub mod model_error;
pub mod observability;
pub mod observed_curvature;
pub mod overdispersion;
pub mod pixel_jacobians;
pub mod registration_sigma;
pub mod rolling_shutter_test;
pub mod shape_report;
pub mod shared_parameter_names;
pub mod solution_uncertainty;
pub mod total_covariance;
