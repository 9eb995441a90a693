//! Atomic files and folders: written under a temporary name beside the target, synchronised to
//! disk, then renamed. Neither a killed program nor a power failure leaves a partial result. Those
//! of one result appear together ([`OutputSet`]).
//!
//! Unfinished files are removed when writing fails, and by [`remove_unfinished`] when the program
//! is interrupted. Files abandoned by a killed program are removed by the next program that writes
//! into the folder: a temporary file is locked as long as its writer lives, and an unlocked one is
//! abandoned.

mod durable;
mod error;
mod error_keeper;
mod exchange;
mod file;
mod output_set;
mod parent;
mod staged;
mod temporary;
mod write;

pub use durable::sync_files;
pub use error::WriteError;
pub use error_keeper::ErrorKeeper;
pub use file::{check_folder, create_folder, remove_file};
pub use output_set::OutputSet;
pub use parent::parent_folder;
pub use staged::{ScratchFolder, StagedFolder};
pub use temporary::remove_unfinished;
pub use write::{write, write_text};
