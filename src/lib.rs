//! Photometric trajectory repair and metric panoramas for tunnels, sewers and pipes.
//!
//! A camera revolves while its carrier moves through a tunnel of known shape. The wall has no
//! features to match, and the poses are wrong by degrees and centimetres a frame. This crate makes
//! them right by the photometric consistency of overlapping strips of the wall, says how sure it
//! is, and unrolls the wall into one panorama in metres.
//!
//! # Refine frames in memory
//!
//! Frames, initial poses, camera and tunnel in; poses and covariances out, without a folder on
//! disk:
//!
//! ```
//! use std::path::Path;
//! use std::sync::Arc;
//! use tunnelstitch::frames::FrameSet;
//! use tunnelstitch::progress::{Progress, Silent};
//! use tunnelstitch::refine::{RefineInput, RefineOptions, refine};
//! use tunnelstitch::survey::Survey;
//!
//! // Camera, tunnel, poses and their noise model may come from anywhere; here from a survey.
//! let survey = Survey::open(Path::new("fixtures/blender_free48"))?;
//! let pictures = survey.frames.iter().take(14).map(|frame| image::open(&frame.path));
//! let frames = FrameSet::in_memory(pictures.collect::<Result<Vec<_>, _>>()?);
//!
//! let input = RefineInput::new(
//!     survey.cameras.clone(),
//!     Arc::clone(&survey.surface),
//!     &frames,
//!     &survey.initial[..14],
//!     survey.prior,
//! );
//! let silent: Arc<dyn Progress> = Arc::new(Silent);
//! let refined = refine(input, &RefineOptions::default(), &silent)?;
//! assert_eq!(refined.trajectory.len(), 14);
//! // 6 × 6 covariances of rotation (rad) and translation (m).
//! assert!(refined.covariances.frames.iter().all(|covariance| covariance.trace() < 1.0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! More programs are in `examples/`: frames cast from a known texture and compared with the truth,
//! a tunnel shape of one's own, panoramas from given poses.
//!
//! # The flow of data
//!
//! ```text
//! survey.toml ─ survey ──┬─> refine ──> poses.tum, refine.json ──┐
//!   camera, trajectory,  │                                       v
//!   surface, frames      └─> render <── initial, refined, true poses ──> panoramas
//!                                            ├─> inspect ──> GLB, 3D Tiles, a page to walk through
//! simulate ──> a survey with true poses      └─> evaluate ──> compare.json
//!                                                   └─> report ──> report.html, report.json
//! ```
//!
//! [`camera`], [`trajectory`] and [`surface`] are the geometry; [`frames`] loads the pictures;
//! [`refine`], [`render`] and [`simulate`] know nothing of each other and share the geometry only
//! (the simulator not even the ray–wall intersection, so that it can judge the others);
//! [`super_resolve`] solves for the wall finer than any frame, for panoramas and poses alike;
//! [`raster`] writes pictures larger than the memory; [`evaluate`] measures; [`report`] makes a
//! page of it all; [`follow`] shows the frames while they are taken; [`inspect`] puts the panorama
//! on the wall in three dimensions; [`jobs`] does it for many surveys, [`network_map`] shows them
//! on a map; [`cli`] prints.
//!
//! # The order of the folders
//!
//! The workspace has a crate for each layer, so that a change rebuilds no more than its own.
//! Imports point from a folder to those before it in its row; folders between two `<` do not know
//! each other. `tests/architecture` reads this table and holds the sources to it.
//!
//! <!-- order of the folders -->
//!
//! | in | lowest first |
//! | --- | --- |
//! | `crates` | `geometry` < `core` < `photometry`, `super_resolve` < `refine`, `render`, `simulate` < `evaluate` < `src` |
//! | `crates/geometry` | `files`, `numerics` < `recordings` < `camera` < `trajectory` < `surface` |
//! | `crates/core` | `bitmap_text`, `colour_map`, `persist`, `points`, `progress` < `raster`, `frames`, `storage` < `survey`, `test_wall` |
//! | `crates/refine` | `thresholds`, `options` < `parameters` < `linear` < `points` < `model` < `error`, `input`, `tiles` < `samples` < `joint` < `problem` < `solver` < `point_fit` < `comparison` < `tracking` < `validation` < `uncertainty` < `verdict` < `report` < `refined` < `stages` < `reading_search` < `pipeline` < `deformation_bound`, `live_tracking`, `shards` |
//! | `crates/render` | `error` < `layout` < `warp` < `sampling` < `compositing` < `output` |
//! | `src` | `check`, `follow` < `report`, `inspect` < `jobs` < `network_map` < `cli` |
//!
//! <!-- end of the order -->
//!
//! # A simulated survey
//!
//! Simulate two turns of the paper's third experiment, repair its poses, and measure what is left:
//!
//! ```
//! use std::sync::Arc;
//! use tunnelstitch::evaluate::wall_error;
//! use tunnelstitch::camera::Camera;
//! use tunnelstitch::progress::{Progress, Silent};
//! use tunnelstitch::refine::{RefineOptions, refine};
//! use tunnelstitch::simulate::{self, SimulateOptions};
//! use tunnelstitch::survey::Survey;
//! use tunnelstitch::trajectory::poses_of;
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("survey");
//! let options = SimulateOptions {
//!     frames: 24,
//!     camera: Camera::from_vertical_fov(320, 240, 60f64.to_radians()),
//!     ..SimulateOptions::free()
//! };
//! simulate::write_survey(&options, &path, false, &Silent)?;
//!
//! let survey = Survey::open(&path)?;
//! let silent: Arc<dyn Progress> = Arc::new(Silent);
//! let refined = refine(&survey, &RefineOptions::default(), &silent)?;
//!
//! let truth = poses_of(survey.truth.as_deref().unwrap_or_default());
//! let surface = survey.surface.as_ref();
//! let off = |poses: &[_]| {
//!     wall_error(surface, &survey.cameras, poses, &truth).map(|error| error.px.rms)
//! };
//! assert!(off(&survey.initial_poses())? > 10.0);
//! assert!(off(&poses_of(&refined.trajectory))? < 0.1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Symbols
//!
//! | symbol | in code | meaning |
//! | --- | --- | --- |
//! | x_c, x_w | `x_c`, `x_w` | a point in camera and in world coordinates, metres |
//! | R, t | `r_wc`, `t_wc` | camera-to-world pose: x_w = R x_c + t |
//! | ξ = (ω, ρ) | `xi` | step of a pose: R ← R Exp(ω), t ← t + ρ; radians, metres |
//! | (u, v) | `pixel`, `u`, `v` | pixel; the centre of the first is (0, 0) |
//! | (ω, ν), τ | `sweep`, `share` | motion of the camera while a picture's rows are read, and the share of that time at which a row is |
//! | θ, r | `theta`, `radius_m` | angle atan2(x, z) around the axis (the world's y), radius |
//! | (s, h) | `WallPoint` | arc length rθ and chainage y on the wall, metres |
//! | S | `texture` | grey value of the wall |
//! | a, b | `gain`, `bias` | exposure of a frame: I = a S + b, grey levels |
//! | q | `pixels` | pixels that a wall sample stands for in a frame |
//! | σ | `sigma` | noise of a pixel, grey levels; or 1-σ of whatever is named |
//!
//! Names end in their unit: `_m`, `_rad`, `_deg`, `_px`, `_s`.
//!
//! Source: R. S. Pahwa, W. K. Leong, S. Foong, K. Leman, M. N. Do, "Feature-less Stitching of
//! Cylindrical Tunnel", arXiv 1806.10278.

pub mod check;
#[doc(hidden)]
pub mod cli;
pub mod follow;
pub mod inspect;
pub mod jobs;
pub mod network_map;
pub mod report;

pub use tunnelstitch_core::{frames, persist, points, progress, raster, storage, survey};
pub use tunnelstitch_evaluate as evaluate;
pub use tunnelstitch_geometry::{camera, files, surface, trajectory};
pub use tunnelstitch_refine as refine;
pub use tunnelstitch_render as render;
pub use tunnelstitch_simulate as simulate;
pub use tunnelstitch_super_resolve as super_resolve;
