//! One file per command: its arguments, the call of the library, and its summary.

pub mod check;
pub mod compare;
pub mod config;
pub mod converge;
pub mod convert;
pub mod demo;
pub mod export;
pub mod gyro;
pub mod init;
mod init_summary;
pub mod locate;
pub mod locate_points;
pub mod overlay;
pub mod plan;
pub mod plan_job;
pub mod project;
pub mod refine;
pub mod refine_files;
pub mod refine_memory;
pub mod refine_summary;
pub mod report;
pub mod run_job;
pub mod run_task;
pub mod shell;
pub mod simulate;
pub mod stitch;
pub mod view;
