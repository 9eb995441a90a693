//! The lining as built: its deviation from the radius of a straight round tunnel.
//!
//! | file | content |
//! | --- | --- |
//! | `lining` | sum of all deviations |
//! | `undulation` | ovality, and a random field of given size and length |
//! | `periodic_table` | the field's values, tabulated |
//! | `segments` | rings of segments with a step between them |
//! | `segment_joints` | dark lines of their joints, over any texture |
//! | `shape_spline` | displacement of a shape.json |
//! | `truth_file` | groundtruth_shape.csv |

// The folder's namesake holds its main type.
#[allow(clippy::module_inception)]
pub(super) mod lining;
mod periodic_table;
pub(super) mod segment_joints;
pub(super) mod segments;
mod shape_spline;
pub(super) mod truth_file;
mod undulation;
