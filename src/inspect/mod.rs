//! The wall in three dimensions: files for other programs, and a page to walk through.
//!
//! ```text
//! render::Plan ─ bands ─> Cutter ─ blocks of all levels ─> part: Lines, Mesh, JPEG ─> glb ─┬─> GlbTarget ──> FILE.glb
//!                          (raster::OverviewBuilder, Strip)                                        └─> TilesTarget ─> tileset.json, LEVEL/*.glb
//!
//! tunnel.json, wall.json (Manifest, WallPoints) ─┐
//! tiles of every layer (TilesTarget) ────────────┼─ a folder ─> any web server, or Server ─> the page (web/)
//! index.html, viewer.js (Viewer) ────────────────┘                            └── Marks: marks.geojson, marks.csv
//! ```
//!
//! Textures are cut from the bands of the panorama as they are drawn; a few hundred rows of every
//! level are held. All of it is metric and in the world's coordinates; positions are relative to a
//! point nearby.
//!
//! # Example
//!
//! A piece of the wall as triangles, within a millimetre:
//!
//! ```
//! use tunnelstitch::inspect::{Lines, Mesh, Patch};
//! use tunnelstitch::surface::{Circle, Surface};
//!
//! let tunnel = Circle::new(3.0)?;
//! let patch = Patch { s_m: [0.0, tunnel.perimeter_m()], h_m: [0.0, 10.0] };
//! let mesh = Mesh::new(&tunnel, &Lines::cut(&tunnel, &patch, 1e-3, 0.01));
//! assert_eq!(mesh.bounds_m()[1].y, 10.0);
//! # Ok::<(), tunnelstitch::surface::SurfaceError>(())
//! ```

mod cut;
mod error;
mod export;
mod glb;
mod layers;
mod manifest;
mod marks;
mod mesh;
mod server;
mod single;
mod strip;
mod tiles;
mod tileset;
mod viewer;

pub use error::InspectError;
pub use export::{ExportFiles, export_page, export_wall};
pub use layers::{PosedLayer, TextureOptions, draw_layers, place_originals};
pub use manifest::{Layer, MANIFEST, Manifest, MapPlace, WALL, WallPoints};
pub use marks::{Geometry, MARKS_CSV, MARKS_GEOJSON, Mark, Marks, Properties};
pub use mesh::{Lines, Mesh, Patch};
pub use server::{Originals, Served, Server};
pub use single::GlbTarget;
pub use tiles::{TilesFolder, TilesTarget, tiles_px_per_metre};
pub use tileset::TILESET;
pub use viewer::Viewer;
