//! Files and folders that are complete or absent: written under a temporary name beside the target,
//! put on the disk, then renamed. So neither a killed program nor a power failure leaves half of
//! one.
//!
//! What is unfinished is removed when writing fails, and by [`remove_unfinished`] when the program
//! is interrupted. What a killed program has left in a folder is removed by the next that writes
//! into it: a temporary name is locked for as long as its writer lives, and one that is not locked
//! is nobody's.

mod durable;
mod error;
mod file;
mod parent;
mod staged;
mod temporary;

pub(crate) use durable::sync_files;
pub use error::WriteError;
pub use file::{create_folder, remove_file, write, write_text};
pub(crate) use parent::parent_folder;
pub use staged::{ScratchFolder, StagedFolder};
pub use temporary::remove_unfinished;
