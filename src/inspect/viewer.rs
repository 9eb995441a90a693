//! The viewer's page, bundled by `build.rs`.

use super::InspectError;
use crate::persist::atomic::WriteError;
use std::path::Path;

/// The page and what belongs to it.
#[derive(Clone, Copy, Debug)]
pub struct Viewer {
    /// `index.html`.
    pub page: &'static [u8],
    /// `viewer.css`.
    pub style: &'static [u8],
    /// `viewer.js`.
    pub script: &'static [u8],
}

impl Viewer {
    /// The page that this program was built with.
    ///
    /// # Errors
    /// [`InspectError::NoViewer`] if npm was missing then.
    pub fn bundled() -> Result<Self, InspectError> {
        let script = include_bytes!(concat!(env!("OUT_DIR"), "/viewer.js"));
        if script.is_empty() {
            Err(InspectError::NoViewer)
        } else {
            Ok(Self {
                page: include_bytes!("web/index.html"),
                style: include_bytes!("web/style.css"),
                script,
            })
        }
    }

    /// Writes the page into a folder that a web server hands out as it is.
    ///
    /// # Errors
    /// Whatever the system says.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        let files: [(&str, &[u8]); 4] = [
            ("index.html", self.page),
            ("viewer.css", self.style),
            ("viewer.js", self.script),
            ("server.json", br#"{"marks":false,"frames":false}"#),
        ];
        for (name, bytes) in files {
            let path = folder.join(name);
            std::fs::write(&path, bytes).map_err(|source| WriteError::new(&path, source))?;
        }
        Ok(())
    }
}
