//! Packed tiles on disk until their order is known.

use super::compression::Packed;
use crate::persist::atomic::{ScratchFolder, WriteError, parent_folder};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Packed tiles in the order of their arrival, in a file.
pub(super) struct Spool {
    file: File,
    end: u64,
    /// Goes with the file when this is dropped or the program is interrupted.
    _folder: Option<ScratchFolder>,
}

/// A tile in a [`Spool`].
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Stored {
    offset: u64,
    /// Bytes of the picture; 0 if there is nothing in the tile.
    pub(super) image: u32,
    /// Bytes of the mask, which follows it.
    pub(super) mask: u32,
}

impl Spool {
    /// An empty one beside `target`, for a while.
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

    /// The one in the file `path`, which stays, as far as `end`; what is beyond is dropped.
    pub(super) fn reopen(path: &Path, end: u64) -> Result<Self, WriteError> {
        let fail = |source| WriteError::new(path, source);
        let mut options = File::options();
        let options = options.read(true).write(true).create(true).truncate(false);
        let mut file = options.open(path).map_err(fail)?;
        if file.metadata().map_err(fail)?.len() < end {
            let what = "tiles of the interrupted run are missing; give --fresh to begin anew";
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

    /// Bytes so far, all of them on the disk.
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
        // A packed tile is not much larger than its pixels: 4 MiB at most.
        Ok(Stored {
            offset,
            image: packed.image.len() as u32,
            mask: packed.mask.len() as u32,
        })
    }

    /// Reads a tile into `packed`.
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
