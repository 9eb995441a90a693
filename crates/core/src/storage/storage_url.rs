//! Addresses on storage.

use super::error::StorageError;
use std::fmt;
use std::path::{Component, Path, PathBuf};

/// Kinds of storage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// Amazon S3, and whatever has its interface.
    S3,
    /// Azure Blob Storage.
    Azure,
    /// Google Cloud Storage.
    Google,
    /// Files, as a stand-in for storage.
    File,
}

impl Scheme {
    const ALL: [Self; 4] = [Self::S3, Self::Azure, Self::Google, Self::File];

    /// Its name in addresses.
    pub fn name(self) -> &'static str {
        match self {
            Self::S3 => "s3",
            Self::Azure => "az",
            Self::Google => "gs",
            Self::File => "file",
        }
    }
}

/// An address on storage: `s3://bucket/key`. A key names an object, or all objects below it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StorageUrl {
    scheme: Scheme,
    /// Bucket or container; empty for files.
    bucket: String,
    /// Names, separated by `/`.
    key: String,
}

impl StorageUrl {
    /// The address that a path is; None if it is a path of this machine.
    ///
    /// # Errors
    /// An address that names no bucket, or has more than bucket and key, as a password.
    pub fn of(path: &Path) -> Result<Option<Self>, StorageError> {
        path.to_str().map_or(Ok(None), Self::parse)
    }

    /// The address that a text is; None if it begins with no scheme of storage.
    ///
    /// # Errors
    /// The errors of [`StorageUrl::of`].
    pub fn parse(text: &str) -> Result<Option<Self>, StorageError> {
        let schemes = Scheme::ALL.into_iter();
        let after = |scheme: Scheme| text.strip_prefix(scheme.name())?.strip_prefix("://");
        let Some((scheme, rest)) = schemes
            .filter_map(|scheme| Some((scheme, after(scheme)?)))
            .next()
        else {
            return Ok(None);
        };
        let (bucket, key) = rest.split_once('/').unwrap_or((rest, ""));
        // The address is part of results: a password in it would be, too.
        let fail = |what| {
            let url = format!("{}://…", scheme.name());
            Err(StorageError::Url { url, what })
        };
        if bucket.contains('@') || bucket.contains(':') {
            return fail(
                "has a user or a password; remove them, and give credentials by the environment \
                 (AWS_…, AZURE_…, GOOGLE_…)",
            );
        }
        if bucket.is_empty() != (scheme == Scheme::File) {
            return fail("is no address; give scheme, bucket and key, as s3://bucket/folder");
        }
        let url = Self {
            scheme,
            bucket: bucket.to_owned(),
            key: String::new(),
        };
        url.join(Path::new(key)).map(Some)
    }

    /// The address of a path relative to this one, which may have `..`.
    ///
    /// # Errors
    /// A path that is absolute, leads out of the bucket, or is not in UTF-8.
    pub fn join(&self, relative: &Path) -> Result<Self, StorageError> {
        let fail = |what| StorageError::Url {
            url: self.to_string(),
            what,
        };
        let mut parts: Vec<&str> = self
            .key
            .split('/')
            .filter(|part| !part.is_empty())
            .collect();
        for part in relative.components() {
            match part {
                Component::Normal(part) => {
                    let part = part.to_str();
                    parts.push(part.ok_or_else(|| fail("a name below it is not in UTF-8"))?);
                }
                Component::CurDir => {}
                Component::ParentDir => {
                    let outside = "a path from it leads out of the bucket";
                    parts.pop().ok_or_else(|| fail(outside))?;
                }
                Component::RootDir | Component::Prefix(_) => {
                    return Err(fail("a path from it is absolute; make it relative"));
                }
            }
        }
        Ok(Self {
            key: parts.join("/"),
            ..self.clone()
        })
    }

    /// The part of a pattern without wildcards, and the rest.
    pub fn split_pattern(&self) -> (Self, String) {
        let parts: Vec<&str> = self.key.split('/').collect();
        let is_wild = |part: &&str| part.contains(['*', '?', '[']);
        let last = parts.len() - 1;
        let wild = parts.iter().position(is_wild).unwrap_or(last).min(last);
        let folder = Self {
            key: parts[..wild].join("/"),
            ..self.clone()
        };
        (folder, parts[wild..].join("/"))
    }

    /// The bucket.
    pub fn root(&self) -> Self {
        Self {
            key: String::new(),
            ..self.clone()
        }
    }

    /// The kind of storage.
    pub fn scheme(&self) -> Scheme {
        self.scheme
    }

    /// Bucket or container.
    pub fn bucket(&self) -> &str {
        &self.bucket
    }

    /// Key of an object, or the start of the keys of several.
    pub fn key(&self) -> &str {
        &self.key
    }

    /// The path in a mirror.
    pub(super) fn path_in(&self, root: &Path) -> PathBuf {
        let mut path = root.join(self.scheme.name());
        path.push(&self.bucket);
        path.extend(self.key.split('/').filter(|part| !part.is_empty()));
        path
    }
}

impl fmt::Display for StorageUrl {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            scheme,
            bucket,
            key,
        } = self;
        write!(formatter, "{}://{bucket}/{key}", scheme.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn url(text: &str) -> StorageUrl {
        StorageUrl::parse(text).unwrap().unwrap()
    }

    #[test]
    fn addresses_are_told_from_paths() {
        for text in ["a/b", "s3/a", "s3:/a", "C:\\a", "http://a/b", ""] {
            assert_eq!(StorageUrl::parse(text).unwrap(), None, "{text}");
        }
        let found = url("s3://tunnels/2026//K1/./frames/");
        assert_eq!(found.to_string(), "s3://tunnels/2026/K1/frames");
        assert_eq!(found.bucket(), "tunnels");
        assert_eq!(url("file:///a/b").key(), "a/b");
    }

    #[test]
    fn passwords_and_places_outside_are_refused() {
        for (text, expected) in [
            ("s3://key:secret@bucket/a", "has a user or a password"),
            ("s3:///a", "as s3://bucket/folder"),
            ("az://", "as s3://bucket/folder"),
            ("gs://b/../c", "out of the bucket"),
        ] {
            let message = StorageUrl::parse(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
            assert!(!message.contains("secret"), "{message}");
        }
        assert!(url("s3://b/a").join(Path::new("/etc")).is_err());
    }

    #[test]
    fn relative_paths_hold_as_in_folders() {
        let job = url("s3://b/2026/job");
        let joined = job.join(Path::new("../K1/./frames")).unwrap();
        assert_eq!(joined.to_string(), "s3://b/2026/K1/frames");
        let root = Path::new("cache");
        assert_eq!(joined.path_in(root), root.join("s3/b/2026/K1/frames"));
    }

    #[test]
    fn patterns_are_split_before_the_first_wildcard() {
        for (text, folder, rest) in [
            ("s3://b/f/*.jpg", "s3://b/f", "*.jpg"),
            ("s3://b/f/cam*/1/?.jpg", "s3://b/f", "cam*/1/?.jpg"),
            ("s3://b/f/one.jpg", "s3://b/f", "one.jpg"),
            ("s3://b/*.jpg", "s3://b/", "*.jpg"),
        ] {
            let (found, pattern) = url(text).split_pattern();
            assert_eq!(
                (found.to_string().as_str(), pattern.as_str()),
                (folder, rest)
            );
        }
    }
}
