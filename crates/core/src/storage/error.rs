//! Errors of storage.

/// Storage that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StorageError {
    /// The address is none.
    #[error("{url}: {what}")]
    Url {
        /// The address.
        url: String,
        /// The problem and the remedy.
        what: &'static str,
    },
    /// The program has no storage.
    #[error(
        "{url}: this program was built without storage; build it with --features storage, or copy \
         the files to this machine"
    )]
    NotBuilt {
        /// The address.
        url: String,
    },
    /// There is nothing at the address.
    #[error("{url}: there is nothing on the storage")]
    Missing {
        /// The address.
        url: String,
    },
    /// The storage refuses access, or cannot be opened.
    #[error(
        "{url}: {what}; credentials and endpoint are those of the environment (AWS_…, AZURE_…, \
         GOOGLE_…)"
    )]
    Refused {
        /// The address.
        url: String,
        /// The error of the storage.
        what: String,
    },
    /// The storage fails.
    #[error("{url}: {what}")]
    Access {
        /// The address.
        url: String,
        /// The error of the storage.
        what: String,
    },
    /// A file of the mirror cannot be read or written.
    #[error("{url}: {what}")]
    Mirror {
        /// The address.
        url: String,
        /// The file and the error of the system.
        what: String,
    },
}

impl StorageError {
    /// True if the same call may succeed later.
    pub fn is_temporary(&self) -> bool {
        matches!(self, Self::Access { .. })
    }
}
