//! Networks of tunnels: their sections, and where these lie on a map.
//!
//! | subject | file |
//! | --- | --- |
//! | `network.toml` | [`Network`] |
//! | the coordinate reference system of its positions | [`Crs`] |
//! | the line of a section on the map, and places along it | [`SectionLine`] |

mod crs;
mod network_file;
mod section_line;

pub use crs::Crs;
pub use network_file::{Manhole, Network, Section, SectionEnds};
pub use section_line::SectionLine;
