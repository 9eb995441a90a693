//! In the place of storage, in programs that are built without it.

use super::error::StorageError;
use super::storage_url::StorageUrl;
use std::io::Write;
use std::path::Path;

/// An object on storage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Object {
    /// Its key.
    pub key: String,
    /// Its size, bytes.
    pub bytes: u64,
    /// Identity of its content.
    pub etag: String,
}

/// Storage that is not there.
#[derive(Debug)]
pub enum Store {}

impl Store {
    /// Says that there is none.
    ///
    /// # Errors
    /// Always [`StorageError::NotBuilt`].
    pub fn open(url: &StorageUrl) -> Result<Self, StorageError> {
        let url = url.to_string();
        Err(StorageError::NotBuilt { url })
    }

    /// The objects below a key.
    ///
    /// # Errors
    /// There is no storage.
    pub fn list(&self, _key: &str) -> Result<Vec<Object>, StorageError> {
        match *self {}
    }

    /// The content of an object.
    ///
    /// # Errors
    /// There is no storage.
    pub fn get(&self, _object: &Object, _out: &mut dyn Write) -> Result<(), StorageError> {
        match *self {}
    }

    /// Puts a file.
    ///
    /// # Errors
    /// There is no storage.
    pub fn put(&self, _key: &str, _file: &Path) -> Result<Object, StorageError> {
        match *self {}
    }

    /// Removes an object.
    ///
    /// # Errors
    /// There is no storage.
    pub fn delete(&self, _key: &str) -> Result<(), StorageError> {
        match *self {}
    }
}
