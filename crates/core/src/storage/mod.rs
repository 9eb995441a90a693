//! Object storage (`s3://`, `az://`, `gs://`) and the folder of this machine that mirrors it.
//!
//! Everything works on files. What a command reads from storage is fetched to a [`Mirror`] first,
//! what it writes is put there when it is complete. The mirror has the folders of the storage, so
//! that relative paths in files hold in both.
//!
//! ```text
//! StorageUrl ─> Store (list, get, put: the crate object_store) <─> Mirror (files, their ETags)
//! ```
//!
//! Credentials come from the environment alone, and no file has them.

mod error;
mod mirror;
mod storage_url;
#[cfg(feature = "storage")]
mod store;
#[cfg(not(feature = "storage"))]
#[path = "no_store.rs"]
mod store;

pub use error::StorageError;
pub use mirror::Mirror;
pub use storage_url::{Scheme, StorageUrl};
