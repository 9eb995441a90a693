//! The stated uncertainty, and tests of the model that it rests on.

pub mod covariance;
pub mod covariance_file;
pub mod cramer_rao;
pub mod observability;
pub mod overdispersion;
pub mod rolling_shutter_test;
pub mod solution_uncertainty;
