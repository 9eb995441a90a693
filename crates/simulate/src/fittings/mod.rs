//! Fittings before the wall: cables on brackets, and rows of lamps.
//!
//! They are solids that rays are intersected with in closed form, one by one for every sample
//! point, so that they hide the wall with their true parallax. The tunnel must be straight: then
//! nothing of the wall lies between the camera and a fitting.
//!
//! | file | content |
//! | --- | --- |
//! | `fitting_options` | how many there are |
//! | `capsule`, `cuboid` | solids, and their intersection with rays |
//! | `finish` | grey levels of their surfaces |
//! | `solid` | a solid with its finish |
//! | `cable`, `lamp_row` | where the solids of a cable and of a row of lamps are |
//! | `layout` | all cables and lamps of a tunnel |
//! | `occlusion` | the solids that a frame shows before the wall |

mod cable;
mod capsule;
mod cuboid;
mod finish;
pub(super) mod fitting_options;
mod lamp_row;
pub(super) mod layout;
pub(super) mod occlusion;
mod ray_hit;
pub(super) mod solid;
