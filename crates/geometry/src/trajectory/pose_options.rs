//! Options for reading a pose file.

use super::csv::ColumnMap;
use super::entry_list::DuplicateTimes;
use super::euler::{AngleUnit, EulerSequence};
use super::format::PoseFormat;
use super::quaternion_order::QuaternionOrder;
use super::time_unit::TimeUnit;
use crate::recordings::PoseTopic;

/// Options for reading a pose file. Those that do not concern its format have no effect.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseFileOptions {
    /// The format; by default the one detected from the content.
    pub format: Option<PoseFormat>,
    /// CSV: names of columns in the file's header, for columns whose names are not known.
    pub columns: ColumnMap,
    /// CSV: the order of rotations, if these are angles about axes instead of a quaternion.
    pub euler: Option<EulerSequence>,
    /// CSV: the unit of angles whose columns do not tell.
    pub angle_unit: Option<AngleUnit>,
    /// TUM: the order of the quaternion's numbers; by default the one that a comment names, or
    /// TUM's own.
    pub quaternion: Option<QuaternionOrder>,
    /// TUM, and CSV whose header does not tell: the unit of times; by default numbers of 17 digits
    /// and more are nanoseconds, all others seconds.
    pub time_unit: Option<TimeUnit>,
    /// Recordings: the topic.
    pub recorded: PoseTopic,
    /// The handling of a time that two poses share.
    pub duplicate_times: DuplicateTimes,
}
