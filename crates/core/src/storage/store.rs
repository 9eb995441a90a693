//! Objects on storage, by the crate `object_store`, for callers that wait.
//!
//! Requests that fail are repeated by that crate, with growing pauses.

use super::error::StorageError;
use super::storage_url::{Scheme, StorageUrl};
use futures_util::TryStreamExt;
use object_store::aws::AmazonS3Builder;
use object_store::azure::MicrosoftAzureBuilder;
use object_store::buffered::BufWriter;
use object_store::gcp::GoogleCloudStorageBuilder;
use object_store::local::LocalFileSystem;
use object_store::path::Path as Key;
use object_store::{ObjectMeta, ObjectStore, ObjectStoreExt};
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use std::sync::Arc;
use tokio::io::AsyncWriteExt;
use tokio::runtime::{Builder, Runtime};

/// Bytes of a file that are sent at a time; a larger file is sent in several parts.
const PART_BYTES: usize = 8 << 20;

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

impl From<ObjectMeta> for Object {
    fn from(meta: ObjectMeta) -> Self {
        Self {
            key: meta.location.to_string(),
            bytes: meta.size,
            // Without one, the time of the last change.
            etag: meta
                .e_tag
                .unwrap_or_else(|| meta.last_modified.to_rfc3339()),
        }
    }
}

/// The storage of a bucket.
#[derive(Debug)]
pub struct Store {
    url: StorageUrl,
    store: Arc<dyn ObjectStore>,
    runtime: Runtime,
}

impl Store {
    /// Opens the bucket of an address with the credentials of the environment.
    ///
    /// # Errors
    /// An environment that is incomplete.
    pub fn open(url: &StorageUrl) -> Result<Self, StorageError> {
        let bucket = url.bucket();
        let store: Result<Arc<dyn ObjectStore>, object_store::Error> = match url.scheme() {
            Scheme::S3 => {
                let builder = AmazonS3Builder::from_env().with_bucket_name(bucket);
                builder.build().map(|store| Arc::new(store) as _)
            }
            Scheme::Azure => {
                let builder = MicrosoftAzureBuilder::from_env().with_container_name(bucket);
                builder.build().map(|store| Arc::new(store) as _)
            }
            Scheme::Google => {
                let builder = GoogleCloudStorageBuilder::from_env().with_bucket_name(bucket);
                builder.build().map(|store| Arc::new(store) as _)
            }
            Scheme::File => Ok(Arc::new(LocalFileSystem::new())),
        };
        let runtime = Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build();
        let refused = |what: String| StorageError::Refused {
            url: url.to_string(),
            what,
        };
        Ok(Self {
            url: url.clone(),
            store: store.map_err(|error| refused(error.to_string()))?,
            runtime: runtime.map_err(|error| refused(error.to_string()))?,
        })
    }

    /// The object of a key, or all objects below it, by their keys; empty if there is none.
    ///
    /// # Errors
    /// Storage that refuses or fails.
    pub fn list(&self, key: &str) -> Result<Vec<Object>, StorageError> {
        let prefix = self.key(key)?;
        let listed = async {
            match self.store.head(&prefix).await {
                Ok(meta) => return Ok(vec![meta]),
                Err(object_store::Error::NotFound { .. }) => {}
                Err(error) => return Err(error),
            }
            self.store.list(Some(&prefix)).try_collect().await
        };
        let listed: Vec<ObjectMeta> = self
            .runtime
            .block_on(listed)
            .map_err(|e| self.fail(key, &e))?;
        let mut objects: Vec<Object> = listed.into_iter().map(Object::from).collect();
        objects.sort_by(|a, b| a.key.cmp(&b.key));
        Ok(objects)
    }

    /// Writes the content of an object.
    ///
    /// # Errors
    /// Storage that refuses or fails; a writer that does.
    pub fn get(&self, object: &Object, out: &mut dyn Write) -> Result<(), StorageError> {
        let key = self.key(&object.key)?;
        let fail = |error: object_store::Error| self.fail(&object.key, &error);
        let got = self.runtime.block_on(self.store.get(&key)).map_err(fail)?;
        let mut parts = got.into_stream();
        while let Some(part) = self.runtime.block_on(parts.try_next()).map_err(fail)? {
            out.write_all(&part).map_err(|error| StorageError::Mirror {
                url: self.of(&object.key),
                what: error.to_string(),
            })?;
        }
        Ok(())
    }

    /// Puts a file, which is there as a whole or not at all.
    ///
    /// # Errors
    /// Storage that refuses or fails; a file that cannot be read.
    pub fn put(&self, key: &str, path: &Path) -> Result<Object, StorageError> {
        let mut file = File::open(path).map_err(|error| self.unread(key, &error))?;
        let place = self.key(key)?;
        let mut writer =
            BufWriter::with_capacity(Arc::clone(&self.store), place.clone(), PART_BYTES);
        loop {
            let mut part = Vec::new();
            let taken = Read::by_ref(&mut file)
                .take(PART_BYTES as u64)
                .read_to_end(&mut part);
            if taken.map_err(|error| self.unread(key, &error))? == 0 {
                break;
            }
            let sent = self.runtime.block_on(writer.put(part.into()));
            sent.map_err(|error| self.fail(key, &error))?;
        }
        let ended = self.runtime.block_on(writer.shutdown());
        ended.map_err(|error| self.unread(key, &error))?;
        let meta = self.runtime.block_on(self.store.head(&place));
        meta.map(Object::from)
            .map_err(|error| self.fail(key, &error))
    }

    /// Removes an object, if it is there.
    ///
    /// # Errors
    /// Storage that refuses or fails.
    pub fn delete(&self, key: &str) -> Result<(), StorageError> {
        let place = self.key(key)?;
        match self.runtime.block_on(self.store.delete(&place)) {
            Err(object_store::Error::NotFound { .. }) | Ok(()) => Ok(()),
            Err(error) => Err(self.fail(key, &error)),
        }
    }

    fn key(&self, key: &str) -> Result<Key, StorageError> {
        Key::parse(key).map_err(|error| StorageError::Access {
            url: self.of(key),
            what: error.to_string(),
        })
    }

    fn of(&self, key: &str) -> String {
        let root = self.url.root();
        format!("{root}{key}")
    }

    fn fail(&self, key: &str, error: &object_store::Error) -> StorageError {
        let (url, what) = (self.of(key), without_queries(&error.to_string()));
        match error {
            object_store::Error::PermissionDenied { .. }
            | object_store::Error::Unauthenticated { .. } => StorageError::Refused { url, what },
            _ => StorageError::Access { url, what },
        }
    }

    fn unread(&self, key: &str, error: &std::io::Error) -> StorageError {
        StorageError::Mirror {
            url: self.of(key),
            what: error.to_string(),
        }
    }
}

/// A text in one line, with addresses without their queries, which may have signatures.
fn without_queries(text: &str) -> String {
    let words = text
        .split_whitespace()
        .map(|word| match word.split_once('?') {
            Some((address, _)) if address.contains("://") => address,
            _ => word,
        });
    words.collect::<Vec<&str>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_have_no_signatures() {
        let text = "Error performing\nGET https://a.net/c/k?sig=S%3D&se=1 in 3 ms: what? no";
        let expected = "Error performing GET https://a.net/c/k in 3 ms: what? no";
        assert_eq!(without_queries(text), expected);
    }
}
