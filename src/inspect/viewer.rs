//! Page of the viewer, bundled by `build.rs`.

use crate::files::write_without_links;
use crate::inspect::error::InspectError;
use crate::persist::atomic::WriteError;
use std::path::Path;

/// Page of the viewer with its style and script.
#[derive(Clone, Copy, Debug)]
pub struct Viewer {
    /// Content of `index.html`.
    pub page: &'static [u8],
    /// Content of `viewer.css`.
    pub style: &'static [u8],
    /// Content of `viewer.js`.
    pub script: &'static [u8],
}

impl Viewer {
    /// The page that is embedded in this program.
    ///
    /// # Errors
    /// [`InspectError::NoViewer`] if npm was missing at build time.
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

    /// Writes the page into a folder for a static web server.
    ///
    /// # Errors
    /// [`WriteError`] if a file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        let files: [(&str, &[u8]); 4] = [
            ("index.html", self.page),
            ("viewer.css", self.style),
            ("viewer.js", self.script),
            ("server.json", br#"{"marks":false,"frames":false}"#),
        ];
        for (name, bytes) in files {
            let path = folder.join(name);
            write_without_links(&path, bytes).map_err(|source| WriteError::new(&path, source))?;
        }
        Ok(())
    }
}
