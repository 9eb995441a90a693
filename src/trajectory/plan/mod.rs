//! The plan: what the carrier was told to do.
//!
//! A [`Station`] is where the carrier stands while a frame is taken. Stations come from even motion
//! ([`UniformMotion`]) or from a table ([`PlanTable`]); a [`Mounting`] says how the camera sits on the
//! carrier, and makes poses of stations.

mod mounting;
mod station;
mod table;
mod uniform_motion;

pub use mounting::Mounting;
pub use station::{Station, spiral};
pub use table::PlanTable;
pub use uniform_motion::{Rate, UniformMotion};
