//! Joint solve of wall and poses, where edges are sharper than the frames' pixels.
//!
//! ```text
//! block of tiles ─> region (fine pixels) ─> JointBlock ─> wall x (super_resolve::WallSolve)
//! ObservationMask (contributing, compared) ─┘   │
//!                                               ├─> WallPixel: residual, features ─> TileMoments
//!                                               └─> StiffnessSums ─> Stiffness ratio of the slopes
//! ```
//!
//! The moments replace those of [`crate::tiles::tile`] in the normal equations.

pub mod joint_block;
pub mod observation_mask;
pub mod region;
pub mod stiffness;
pub mod wall_pixel;
