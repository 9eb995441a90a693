//! The stages of a refinement, one file each.
//!
//! Every stage is a function `run(setup, estimation, session) -> estimation`: it takes the
//! estimation as the stage before has left it and returns it changed.
//!
//! | what | file |
//! | --- | --- |
//! | list of the stages, rules of the solves | [`plan`] |
//! | what is fixed | [`setup`] |
//! | what changes, and what a checkpoint keeps of it | [`state`] |
//! | checkpoints, progress, times | [`session`] |
//! | final poses | [`placement`] |
//! | shares of the work, for the display of progress | [`work`] |
//! | dispatch | [`run`](mod@run) |

pub mod assess;
pub mod begin;
pub mod correct_shading;
pub mod placement;
pub mod plan;
pub mod prescreen;
pub mod resolve_aliases;
pub mod run;
pub mod session;
pub mod setup;
pub mod shape;
pub mod solve;
pub mod state;
pub mod track;
pub mod validate_pairs;
pub mod work;
