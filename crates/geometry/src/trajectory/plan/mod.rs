//! Motion plans of the carrier.
//!
//! A [`Station`] is the carrier's planned position and rotation at a frame. Stations come from
//! uniform motion ([`UniformMotion`]) or from a table ([`PlanTable`]); the [`Mounting`] of the
//! camera on the carrier converts stations to poses.

mod mounting;
mod station;
mod table;
mod uniform_motion;

pub use mounting::Mounting;
pub use station::{Station, spiral};
pub use table::PlanTable;
pub use uniform_motion::{Rate, UniformMotion};
