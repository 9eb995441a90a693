//! Tunnel shapes: ray–wall intersection, wall coordinates, and the Jacobian of a pixel's wall point
//! with respect to the pose.
//!
//! A wall point has two coordinates in metres: `s`, the arc length around the section (periodic),
//! and `h`, the chainage along the axis. One file per shape; each implements [`Surface`].
//!
//! # Example
//!
//! ```
//! use nalgebra::Vector3;
//! use tunnelstitch_geometry::surface::{Circle, Surface};
//!
//! let tunnel = Circle::new(3.0)?;
//! let hit = tunnel.hit(&Vector3::new(0.5, 1.0, 0.0), &Vector3::new(0.0, 0.2, 1.0))?;
//! let wall = tunnel.frame(hit.wall);
//! assert!((wall.x_w - hit.x_w).norm() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bend;
mod bent;
mod centreline;
mod circle;
mod displaced;
mod displacement;
mod error;
mod foot_point;
mod footprint;
mod gauge;
mod gauge_component;
mod newton;
mod prism;
mod radial_field;
pub mod section;
mod shape;
mod sight;
mod spline_lattice;
mod swept;
mod wall;
mod wall_regions;

pub use bend::Bend;
pub use bent::{Bent, bent};
pub use centreline::{CentrePoint, Centreline, CentrelineFrame};
pub use circle::Circle;
pub use displaced::{Displaced, displaced};
pub use displacement::{bend_jacobian, lens_jacobian, wall_jacobian};
pub use error::{SIZES_M, SurfaceError};
pub use foot_point::{FootPoint, foot_point, from_axis};
pub use footprint::{Footprint, shortest_arc};
pub use gauge::{Axis, Gauge, GaugeMotion};
pub use gauge_component::gauge_component;
pub use prism::Prism;
pub use radial_field::{FieldValue, RadialField};
pub use shape::Surface;
pub use sight::{looks_along, mean_radius_m, sighted_wall, viewing_distance, with_range};
pub use spline_lattice::{SplineLattice, Support};
pub use swept::Swept;
pub use wall::{Hit, WallFrame, WallPoint};
pub use wall_regions::WallRegions;
