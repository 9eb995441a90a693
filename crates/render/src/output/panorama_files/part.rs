//! Files of some of a panorama's bands, drawn by one run and put together by another.

use super::files::PanoramaFiles;
use super::maps::{COVERAGE, FRAMES};
use super::state::{FilesState, PANORAMA};
use crate::error::RenderError;
use serde::{Deserialize, Serialize};
use std::path::Path;
use tunnelstitch_core::persist::atomic::WriteError;
use tunnelstitch_core::persist::checkpoint::Checkpoint;
use tunnelstitch_core::persist::provenance;
use tunnelstitch_core::raster::RasterError;

/// State of the files of some bands, beside which lie their compressed tiles.
#[derive(Serialize, Deserialize)]
pub struct PanoramaPart<'a> {
    state: FilesState<'a>,
    /// Names of the files of compressed tiles, and BLAKE3 hashes of their contents.
    tiles: Vec<(String, String)>,
}

impl PanoramaFiles {
    /// Copies the compressed tiles of all files from the checkpoint into `folder`; returns what
    /// [`PanoramaFiles::absorb`] needs beside them.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn hand_over(
        &self,
        checkpoint: &Checkpoint,
        folder: &Path,
    ) -> Result<PanoramaPart<'_>, RenderError> {
        let state = self.state().map_err(RasterError::from)?;
        let maps = self.maps.iter().flat_map(|_| [COVERAGE, FRAMES]);
        let names = self.cog.iter().map(|_| PANORAMA).chain(maps);
        let copied = names.map(|name| {
            let path = folder.join(name);
            let copied = std::fs::copy(checkpoint.file(name), &path);
            copied.map_err(|source| WriteError::new(&path, source))?;
            let hashed = provenance::input(&path);
            let hashed = hashed.map_err(|error| WriteError::new(&path, error.source))?;
            Ok((name.to_owned(), hashed.blake3))
        });
        let tiles = copied.collect::<Result<_, WriteError>>();
        Ok(PanoramaPart {
            state,
            tiles: tiles.map_err(RasterError::from)?,
        })
    }

    /// Takes over bands that another run has drawn, with their compressed tiles in `folder`. The
    /// files do not depend on the division of the bands.
    ///
    /// # Errors
    /// Tiles that are damaged or were taken over before; an error of the operating system.
    pub fn absorb(&mut self, part: PanoramaPart, folder: &Path) -> Result<(), RenderError> {
        let PanoramaPart { state, tiles } = part;
        for (name, hash) in &tiles {
            let path = folder.join(name);
            let found = provenance::input(&path);
            let found = found.map_err(|error| WriteError::new(&path, error.source));
            if found.map_err(RasterError::from)?.blake3 != *hash {
                let damaged = std::io::Error::other("its hash does not match; make it again");
                return Err(RasterError::from(WriteError::new(&path, damaged)).into());
            }
        }
        if let (Some(cog), Some(state)) = (&mut self.cog, state.cog) {
            cog.absorb(state, &folder.join(PANORAMA))?;
        }
        if let (Some(maps), Some(state)) = (&mut self.maps, state.maps) {
            maps.absorb(state, folder)?;
        }
        if let Some(coverage) = state.coverage {
            self.coverage.absorb(&coverage);
        }
        self.bands += state.bands;
        Ok(())
    }
}
