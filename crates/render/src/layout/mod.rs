//! The panorama's pixels on the unrolled wall, and the frames that see them.
//!
//! | subject | file |
//! | --- | --- |
//! | place of each frame on the wall | [`placement`] |
//! | grid of the panorama | [`canvas`] |
//! | squares of that grid with the frames that meet them | [`tiles`] |
//! | frames and pixels that show a wall point | [`sightings`] |

pub mod canvas;
pub mod placement;
pub mod sightings;
pub mod tiles;
pub mod wall_point;
