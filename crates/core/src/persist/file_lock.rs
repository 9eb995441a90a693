//! A lock on a file or folder.

use std::fs::{File, TryLockError};
use std::io;

/// The exclusive lock of an open file or folder, until it is dropped.
///
/// It is released explicitly. Closing the file alone would not always do that: a program that
/// another thread is just starting has a copy of the open file until it runs, and with it the lock.
#[derive(Debug)]
pub struct FileLock {
    file: File,
}

impl FileLock {
    /// Takes the lock if it is free.
    ///
    /// # Errors
    /// [`TryLockError::WouldBlock`] if another holds it; [`TryLockError::Error`] if it cannot be
    /// taken, as where the file system has no locks.
    pub fn take(file: File) -> Result<Self, TryLockError> {
        match file.try_lock() {
            Ok(()) => Ok(Self { file }),
            Err(error) => Err(error),
        }
    }

    /// Takes the lock once it is free.
    ///
    /// # Errors
    /// As where the file system has no locks.
    pub fn wait(file: File) -> io::Result<Self> {
        file.lock()?;
        Ok(Self { file })
    }
}

impl Drop for FileLock {
    fn drop(&mut self) {
        // A lock that cannot be released goes with the file.
        let _ = self.file.unlock();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_of_the_open_file_does_not_keep_the_lock() {
        let folder = tempfile::tempdir().unwrap();
        let open = || File::open(folder.path()).unwrap();
        let file = open();
        let copy = file.try_clone().unwrap();
        let lock = FileLock::take(file).unwrap();
        assert!(matches!(
            FileLock::take(open()),
            Err(TryLockError::WouldBlock)
        ));
        drop(lock);
        drop(FileLock::take(open()).unwrap());
        drop(FileLock::wait(open()).unwrap());
        drop(copy);
    }
}
