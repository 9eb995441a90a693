//! The wall solved for at a third of a pixel, jointly with the poses.

pub mod joint_block;
pub mod observation_mask;
pub mod stiffness;
