//! The result of a refinement: poses, their covariances and the report.

use crate::report::RefineReport;
use crate::uncertainty::covariance::Covariances;
use crate::uncertainty::shape_report::EstimatedShape;
use tunnelstitch_core::survey::MaskedWall;
use tunnelstitch_geometry::surface::Bend;
use tunnelstitch_geometry::trajectory::Trajectory;

/// The result of a refinement.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Refined {
    /// Refined poses with the times of the initial ones.
    pub trajectory: Trajectory,
    /// The poses of a rig's body, one a moment: the mean of those that its cameras give by their
    /// mounts; None for a single camera.
    pub bodies: Option<Trajectory>,
    /// The report: solves, verdict and uncertainty of every frame.
    pub report: RefineReport,
    /// Covariances of the poses.
    pub covariances: Covariances,
    /// Shape of the wall; None if it is as planned.
    pub shape: Option<EstimatedShape>,
    /// Bend of a tunnel that was planned straight; None if it has none.
    pub bend: Option<Bend>,
    /// The wall where frames show something else and were left out of the last solve; None if no
    /// frame is photometric.
    pub masked: Option<MaskedWall>,
}
