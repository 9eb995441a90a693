//! The stages of a refinement, one file each.
//!
//! Every stage is a function `run(setup, estimation, session) -> estimation`: it takes the estimation
//! as the stage before has left it and returns it changed. What is fixed is in
//! [`Setup`](crate::refine::setup::Setup), what a checkpoint keeps in [`state::PipelineState`]; checkpoints,
//! progress and times go through [`session::Session`].

pub mod assess;
pub mod correct_shading;
pub mod prescreen;
pub mod repair;
pub mod session;
pub mod solve;
pub mod stage;
pub mod state;
pub mod track;
pub mod validate_pairs;
