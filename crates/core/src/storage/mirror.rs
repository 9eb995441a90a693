//! A folder of this machine that mirrors storage.

use super::error::StorageError;
use super::storage_url::StorageUrl;
use super::store::{Object, Store};
use crate::persist::atomic;
use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// Objects that are fetched or put at a time.
const MAX_PARALLEL: usize = 16;
/// Folder of the files in that of the mirror.
const FILES: &str = "files";
/// Folder of their ETags.
const ETAGS: &str = "etags";

/// A folder of this machine that mirrors storage: files, and the ETags that they had there.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mirror {
    folder: PathBuf,
}

impl Mirror {
    /// The mirror in a folder.
    pub fn new(folder: &Path) -> Self {
        let folder = folder.to_owned();
        Self { folder }
    }

    /// The mirror of the user: `$XDG_CACHE_HOME/tunnelstitch`, else `~/.cache/tunnelstitch`.
    pub fn of_user() -> Self {
        let variable = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
        let cache = variable("XDG_CACHE_HOME").map(PathBuf::from);
        let home = variable("HOME").or_else(|| variable("USERPROFILE"));
        let cache = cache.or_else(|| Some(PathBuf::from(home?).join(".cache")));
        let cache = cache
            .unwrap_or_else(std::env::temp_dir)
            .join("tunnelstitch");
        Self::new(&std::path::absolute(&cache).unwrap_or(cache))
    }

    /// The file or folder of an address.
    pub fn path(&self, url: &StorageUrl) -> PathBuf {
        url.path_in(&self.folder.join(FILES))
    }

    /// True if a path is one of the mirror.
    pub fn has_path(&self, path: &Path) -> bool {
        path.starts_with(self.folder.join(FILES))
    }

    fn etag_path(&self, url: &StorageUrl) -> PathBuf {
        url.path_in(&self.folder.join(ETAGS))
    }

    /// Fetches an object, or all below an address, as far as it is not there with the same ETag and
    /// size; removes files that are no longer on the storage. Returns the path; there is none if
    /// there is nothing on the storage.
    ///
    /// # Errors
    /// Storage that refuses or fails; files that cannot be written.
    pub fn fetch(&self, url: &StorageUrl) -> Result<PathBuf, StorageError> {
        self.fetch_where(url, |_| true)?;
        Ok(self.path(url))
    }

    /// Fetches the objects that match a pattern; returns that of their files.
    ///
    /// # Errors
    /// The errors of [`Mirror::fetch`]; no object.
    pub fn fetch_pattern(&self, pattern: &StorageUrl) -> Result<String, StorageError> {
        let (folder, rest) = pattern.split_pattern();
        let matcher = glob::Pattern::new(&rest).map_err(|_| StorageError::Url {
            url: pattern.to_string(),
            what: "is no pattern; * stands for any name, [ for letters up to ]",
        })?;
        let options = glob::MatchOptions {
            require_literal_separator: true,
            ..glob::MatchOptions::default()
        };
        let found = self.fetch_where(&folder, |name| matcher.matches_with(name, options))?;
        match found {
            0 => Err(StorageError::Missing {
                url: pattern.to_string(),
            }),
            _ => {
                let folder = self.path(&folder);
                let folder = glob::Pattern::escape(&folder.to_string_lossy());
                Ok(format!("{folder}/{rest}"))
            }
        }
    }

    /// Hash of names, sizes and ETags of the object, or of all objects below an address, that match
    /// its pattern.
    ///
    /// # Errors
    /// Storage that refuses or fails.
    pub fn fingerprint(pattern: &StorageUrl) -> Result<blake3::Hash, StorageError> {
        let (folder, rest) = pattern.split_pattern();
        let mut hasher = blake3::Hasher::new();
        for object in Store::open(&folder)?.list(folder.key())? {
            let name = name_below(&object.key, folder.key());
            if glob::Pattern::new(&rest).is_ok_and(|matcher| matcher.matches(name)) {
                let line = format!("{name}\0{}\0{}\0", object.bytes, object.etag);
                hasher.update(line.as_bytes());
            }
        }
        Ok(hasher.finalize())
    }

    /// Fetches the objects below an address of which the name from there matches; returns their
    /// number.
    fn fetch_where(
        &self,
        url: &StorageUrl,
        matches: impl Fn(&str) -> bool,
    ) -> Result<usize, StorageError> {
        let store = Store::open(url)?;
        let mut objects = store.list(url.key())?;
        objects.retain(|object| matches(name_below(&object.key, url.key())));
        in_parallel(&objects, |object| {
            let of_object = at(url, &object.key)?;
            if self.has(&of_object, object) {
                return Ok(());
            }
            self.download(&store, &of_object, object)
        })?;
        let kept: BTreeSet<&str> = objects.iter().map(|object| object.key.as_str()).collect();
        for name in files_below(&self.path(url)) {
            let of_file = url.join(&name)?;
            let text = name.to_string_lossy().replace('\\', "/");
            if matches(&text) && !kept.contains(of_file.key()) {
                self.remove(&of_file)?;
            }
        }
        Ok(objects.len())
    }

    /// True if the file of an object is there as on the storage.
    fn has(&self, url: &StorageUrl, object: &Object) -> bool {
        let etag = std::fs::read_to_string(self.etag_path(url));
        let bytes = std::fs::metadata(self.path(url)).map(|file| file.len());
        etag.is_ok_and(|etag| etag == object.etag) && bytes.is_ok_and(|bytes| bytes == object.bytes)
    }

    fn download(
        &self,
        store: &Store,
        url: &StorageUrl,
        object: &Object,
    ) -> Result<(), StorageError> {
        let path = self.path(url);
        let mut failed = None;
        let written = atomic::create_folder(atomic::parent_folder(&path)).and_then(|()| {
            atomic::write(&path, |writer| {
                let got = store.get(object, writer as &mut dyn Write);
                got.map_err(|error| {
                    let text = error.to_string();
                    failed = Some(error);
                    std::io::Error::other(text)
                })
            })
        });
        match (failed, written) {
            (Some(error), _) => Err(error),
            (None, Err(error)) => Err(mirror_error(url, &error.to_string())),
            (None, Ok(())) => self.note(url, &object.etag),
        }
    }

    /// Notes the ETag of a file, after the file itself.
    fn note(&self, url: &StorageUrl, etag: &str) -> Result<(), StorageError> {
        let path = self.etag_path(url);
        let written = atomic::create_folder(atomic::parent_folder(&path))
            .and_then(|()| atomic::write_text(&path, etag));
        written.map_err(|error| mirror_error(url, &error.to_string()))
    }

    fn remove(&self, url: &StorageUrl) -> Result<(), StorageError> {
        for path in [self.etag_path(url), self.path(url)] {
            atomic::remove_file(&path).map_err(|error| mirror_error(url, &error.to_string()))?;
        }
        Ok(())
    }

    /// Removes an object from the storage, if it is there, and its file.
    ///
    /// # Errors
    /// Storage that refuses or fails; a file that cannot be removed.
    pub fn delete(&self, url: &StorageUrl) -> Result<(), StorageError> {
        Store::open(url)?.delete(url.key())?;
        self.remove(url)
    }

    /// Puts the file, or all files of the folder, of an address on the storage, each of which is
    /// there as a whole or not at all.
    ///
    /// # Errors
    /// Storage that refuses or fails; files that cannot be read.
    pub fn put(&self, url: &StorageUrl) -> Result<(), StorageError> {
        let store = Store::open(url)?;
        let files = files_below(&self.path(url)).into_iter();
        let files: Vec<StorageUrl> = files
            .map(|name| url.join(&name))
            .collect::<Result<_, _>>()?;
        in_parallel(&files, |file| {
            let object = store.put(file.key(), &self.path(file))?;
            self.note(file, &object.etag)
        })
    }
}

fn mirror_error(url: &StorageUrl, what: &str) -> StorageError {
    StorageError::Mirror {
        url: url.to_string(),
        what: what.to_owned(),
    }
}

/// The address of a key in the bucket of another.
fn at(url: &StorageUrl, key: &str) -> Result<StorageUrl, StorageError> {
    let name = name_below(key, url.key());
    url.join(Path::new(name))
}

/// The part of a key below another; empty if it is that one.
fn name_below<'k>(key: &'k str, folder: &str) -> &'k str {
    let below = key.strip_prefix(folder).unwrap_or(key);
    below.trim_start_matches('/')
}

/// Names of all files below a folder, but of unfinished ones, sorted; of a file the empty name.
fn files_below(folder: &Path) -> Vec<PathBuf> {
    if folder.is_file() {
        return vec![PathBuf::new()];
    }
    let mut files = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(inner) = folders.pop() {
        for entry in std::fs::read_dir(&inner).into_iter().flatten().flatten() {
            let path = entry.path();
            let is_hidden = entry.file_name().as_encoded_bytes().starts_with(b".");
            if path.is_dir() && !is_hidden {
                folders.push(path);
            } else if path.is_file() && !is_hidden {
                files.extend(path.strip_prefix(folder).ok().map(Path::to_owned));
            }
        }
    }
    files.sort();
    files
}

/// Does something for all items, several at a time: it waits for the storage, not for processors.
/// After an error nothing more begins.
fn in_parallel<T: Sync>(
    items: &[T],
    act: impl Fn(&T) -> Result<(), StorageError> + Sync,
) -> Result<(), StorageError> {
    let next = AtomicUsize::new(0);
    let failed: Mutex<Option<StorageError>> = Mutex::new(None);
    std::thread::scope(|scope| {
        for _ in 0..MAX_PARALLEL.min(items.len()) {
            scope.spawn(|| {
                while let Some(item) = items.get(next.fetch_add(1, Ordering::Relaxed)) {
                    if let Err(error) = act(item) {
                        next.store(items.len(), Ordering::Relaxed);
                        *failed.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                    }
                }
            });
        }
    });
    let failed = failed.into_inner().unwrap_or_else(PoisonError::into_inner);
    failed.map_or(Ok(()), Err)
}

#[cfg(all(test, feature = "storage", unix))]
mod tests {
    use super::*;
    use std::fs::{create_dir_all, read, read_to_string, write};

    /// A folder as storage, and a mirror of it.
    struct Scene {
        dir: tempfile::TempDir,
    }

    impl Scene {
        fn new(files: &[(&str, &str)]) -> Self {
            let dir = tempfile::tempdir().unwrap();
            let scene = Self { dir };
            files.iter().for_each(|(name, text)| scene.set(name, text));
            scene
        }

        fn stored(&self, name: &str) -> PathBuf {
            let folder = self.dir.path().canonicalize().unwrap();
            folder.join("stored").join(name)
        }

        fn set(&self, name: &str, text: &str) {
            create_dir_all(self.stored(name).parent().unwrap()).unwrap();
            write(self.stored(name), text).unwrap();
        }

        fn url(&self, name: &str) -> StorageUrl {
            let text = format!("file://{}", self.stored(name).display());
            StorageUrl::parse(&text).unwrap().unwrap()
        }

        fn mirror(&self) -> Mirror {
            Mirror::new(&self.dir.path().join("mirror"))
        }
    }

    #[test]
    fn what_has_changed_is_fetched_and_what_is_gone_is_removed() {
        let scene = Scene::new(&[("k/a/1.txt", "one"), ("k/2.txt", "two"), ("kk/3.txt", "no")]);
        let (mirror, url) = (scene.mirror(), scene.url("k"));
        let folder = mirror.fetch(&url).unwrap();
        assert_eq!(
            files_below(&folder),
            ["2.txt", "a/1.txt"].map(PathBuf::from)
        );
        // What is there is not fetched again, whatever has become of it.
        write(folder.join("2.txt"), "TWO").unwrap();
        mirror.fetch(&url).unwrap();
        assert_eq!(read_to_string(folder.join("2.txt")).unwrap(), "TWO");
        scene.set("k/2.txt", "longer");
        std::fs::remove_file(scene.stored("k/a/1.txt")).unwrap();
        mirror.fetch(&url).unwrap();
        assert_eq!(read_to_string(folder.join("2.txt")).unwrap(), "longer");
        assert_eq!(files_below(&folder), ["2.txt"].map(PathBuf::from));
        // A single object, and nothing.
        let file = mirror.fetch(&scene.url("kk/3.txt")).unwrap();
        assert_eq!(read_to_string(file).unwrap(), "no");
        std::fs::remove_file(scene.stored("kk/3.txt")).unwrap();
        for name in ["kk/3.txt", "none"] {
            assert!(!mirror.fetch(&scene.url(name)).unwrap().exists());
        }
    }

    #[test]
    fn patterns_fetch_what_matches() {
        let scene = Scene::new(&[
            ("f/1.jpg", "1"),
            ("f/2.jpg", "2"),
            ("f/x/3.jpg", "3"),
            ("f/a.txt", ""),
        ]);
        let mirror = scene.mirror();
        let pattern = mirror.fetch_pattern(&scene.url("f/*.jpg")).unwrap();
        let folder = mirror.path(&scene.url("f"));
        assert!(pattern.ends_with("*.jpg"));
        assert_eq!(files_below(&folder), ["1.jpg", "2.jpg"].map(PathBuf::from));
        let message = mirror.fetch_pattern(&scene.url("f/*.png")).unwrap_err();
        assert!(
            message.to_string().contains("there is nothing"),
            "{message}"
        );
        let before = Mirror::fingerprint(&scene.url("f/*.jpg")).unwrap();
        scene.set("f/a.txt", "other");
        assert_eq!(Mirror::fingerprint(&scene.url("f/*.jpg")).unwrap(), before);
        scene.set("f/2.jpg", "other");
        assert_ne!(Mirror::fingerprint(&scene.url("f/*.jpg")).unwrap(), before);
    }

    #[test]
    fn files_are_put_and_not_fetched_again() {
        let scene = Scene::new(&[]);
        let (mirror, url) = (scene.mirror(), scene.url("out"));
        let folder = mirror.path(&url);
        create_dir_all(folder.join("a")).unwrap();
        let large = vec![7; 20 << 20];
        write(folder.join("a/large"), &large).unwrap();
        write(folder.join("empty"), "").unwrap();
        mirror.put(&url).unwrap();
        assert_eq!(read(scene.stored("out/a/large")).unwrap(), large);
        assert_eq!(read(scene.stored("out/empty")).unwrap(), [0; 0]);
        write(folder.join("a/large"), &large[1..]).unwrap();
        for _ in 0..2 {
            mirror.delete(&scene.url("out/empty")).unwrap();
        }
        assert!(!scene.stored("out/empty").exists());
        mirror.fetch(&url).unwrap();
        assert_eq!(read(folder.join("a/large")).unwrap(), large);
    }
}
