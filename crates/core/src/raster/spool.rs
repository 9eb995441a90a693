//! A spool file of compressed tiles.

use super::compression::Packed;
use crate::persist::atomic::{ScratchFolder, WriteError, parent_folder};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use tunnelstitch_geometry::files::{open_regular, open_without_links};

/// A file of compressed tiles in the order of their arrival.
pub(super) struct Spool {
    file: File,
    end: u64,
    /// The folder of a temporary file, removed when dropped or when the program is interrupted.
    _folder: Option<ScratchFolder>,
}

/// A tile in a [`Spool`].
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Stored {
    offset: u64,
    /// Size of the picture, bytes; 0 for an empty tile.
    pub(super) image: u32,
    /// Size of the mask, which follows it, bytes.
    pub(super) mask: u32,
}

impl Spool {
    /// Creates an empty temporary spool beside `target`.
    pub(super) fn temporary_beside(target: &Path) -> Result<Self, WriteError> {
        let folder = ScratchFolder::inside(parent_folder(target))?;
        let path = folder.path().join("tiles");
        let file = File::options()
            .read(true)
            .write(true)
            .create_new(true)
            .open(&path)
            .map_err(|source| WriteError::new(&path, source))?;
        Ok(Self {
            file,
            end: 0,
            _folder: Some(folder),
        })
    }

    /// Opens the spool file `path`, which is kept, and truncates it to `end`.
    pub(super) fn reopen(path: &Path, end: u64) -> Result<Self, WriteError> {
        let fail = |source| WriteError::new(path, source);
        let mut file = open_without_links(path).map_err(fail)?;
        if file.metadata().map_err(fail)?.len() < end {
            let what = "tiles of the interrupted run are missing; give --fresh to restart";
            return Err(fail(io::Error::other(what)));
        }
        file.set_len(end).map_err(fail)?;
        file.seek(SeekFrom::End(0)).map_err(fail)?;
        Ok(Self {
            file,
            end,
            _folder: None,
        })
    }

    /// Opens the spool file `path` of another writer, to read from it.
    pub(super) fn of_part(path: &Path) -> Result<Self, WriteError> {
        let file = open_regular(path).map_err(|source| WriteError::new(path, source))?;
        Ok(Self {
            file,
            end: 0,
            _folder: None,
        })
    }

    /// Synchronises the file to disk and returns its size, bytes.
    pub(super) fn synced(&self) -> io::Result<u64> {
        self.file.sync_data()?;
        Ok(self.end)
    }

    /// Adds a tile.
    pub(super) fn append(&mut self, packed: &Packed) -> io::Result<Stored> {
        let offset = self.end;
        for part in [&packed.image, &packed.mask] {
            self.file.write_all(part)?;
            self.end += part.len() as u64;
        }
        // A compressed tile is not much larger than its pixels: at most 4 MiB.
        Ok(Stored {
            offset,
            image: packed.image.len() as u32,
            mask: packed.mask.len() as u32,
        })
    }

    /// Reads a tile to `packed`.
    pub(super) fn read(&mut self, stored: &Stored, packed: &mut Packed) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(stored.offset))?;
        for (part, bytes) in [
            (&mut packed.image, stored.image),
            (&mut packed.mask, stored.mask),
        ] {
            part.resize(bytes as usize, 0);
            self.file.read_exact(part)?;
        }
        Ok(())
    }
}
