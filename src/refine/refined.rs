//! The result of a refinement: poses, their covariances and the report.

use crate::refine::report::RefineReport;
use crate::refine::uncertainty::covariance::Covariances;
use crate::trajectory::Trajectory;

/// Result of a refinement.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Refined {
    /// Refined poses with the times of the initial ones.
    pub trajectory: Trajectory,
    /// What was done and how sure it is.
    pub report: RefineReport,
    /// How sure it is, in full.
    pub covariances: Covariances,
}
