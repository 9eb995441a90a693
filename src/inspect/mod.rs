//! Three-dimensional inspection: glTF and 3D Tiles of the wall, and a page to walk through it.
//!
//! ```text
//! render::Plan ─ bands ─> BlockCutter ─ blocks of all levels ─> build_part ─> glb ─┐
//!                         (raster::OverviewBuilder, LevelStrip)         (GridLines, Mesh)  │
//!                              ┌───────────────────────────────────────────────────┘
//!                              ├─> GlbTarget ─> FILE.glb
//!                              └─> TilesTarget ─> tileset.json, LEVEL/*.glb
//!
//! in shards (TextureShards): bands ─> BandFiles ─ files ─> read_band ─ bands ─> TilesTarget
//!
//! tunnel.json, wall.json (Manifest, WallPoints) ─┐
//! tiles of every layer (TilesTarget) ────────────┼─ folder ─> web server, or Server ─> page (web/)
//! index.html, viewer.js (Viewer) ────────────────┘              └─ Marks: marks.geojson, marks.csv
//! ```
//!
//! Textures are cut from the bands of the panorama while it is rendered; a few hundred rows of
//! every level are in memory. All coordinates are metric and in the world frame; vertex positions
//! are relative to a nearby origin.
//!
//! # Example
//!
//! Triangulate a piece of the wall to within a millimetre:
//!
//! ```
//! use tunnelstitch::inspect::{GridLines, Mesh, WallRectangle};
//! use tunnelstitch::surface::{Circle, Surface};
//!
//! let tunnel = Circle::new(3.0)?;
//! let rectangle = WallRectangle { s_m: [0.0, tunnel.perimeter_m()], h_m: [0.0, 10.0] };
//! let mesh = Mesh::new(&tunnel, &GridLines::cut(&tunnel, &rectangle, 1e-3, 0.01));
//! assert_eq!(mesh.bounds_m()[1].y, 10.0);
//! # Ok::<(), tunnelstitch::surface::SurfaceError>(())
//! ```

mod band_files;
mod block_cutter;
mod deformation_layer;
mod error;
mod export;
mod glb;
mod glb_target;
mod layer_values;
mod layers;
mod level_strip;
mod manifest;
mod mark;
mod marks;
mod mesh;
mod server;
mod tiles_shards;
mod tiles_target;
mod tileset;
mod viewer;

pub use deformation_layer::DEFORMATION_LAYER;
pub use error::InspectError;
pub use export::{ExportFiles, WallPlan, plan_wall, stage_page, stage_wall};
pub use glb_target::GlbTarget;
pub use layer_values::LayerValues;
pub use layers::{PosedLayer, TextureOptions, draw_layers, plan_layers, pose_source_frames};
pub use manifest::{MANIFEST, Manifest, MapImages, PanoramaLayer, WALL, WallPoints};
pub use mark::{Geometry, Mark, MarkVersions, Properties};
pub use marks::{MARKS_CSV, MARKS_GEOJSON, Marks};
pub use mesh::{GridLines, Mesh, WallRectangle};
pub use server::{Server, ServerContent, SourceFrames};
pub use tiles_shards::TextureShards;
pub use tiles_target::{TilesFolder, TilesTarget, tiles_px_per_metre};
pub use tileset::TILESET;
pub use viewer::Viewer;
