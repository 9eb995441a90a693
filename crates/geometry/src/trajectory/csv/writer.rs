//! Writing of CSV files of poses.

use super::cells::name_to_cell;
use super::columns::FORM;
use crate::trajectory::stamped_pose::StampedPose;
use csv::WriterBuilder;

/// Formats a CSV of poses; `names` are those of the frames.
pub fn format(names: &[String], trajectory: &[StampedPose]) -> String {
    let mut writer = WriterBuilder::new()
        // A name that begins like a comment is quoted.
        .comment(Some(b'#'))
        .from_writer(Vec::new());
    // Writing to memory cannot fail.
    let _ = writer.write_record(FORM.split(','));
    for (name, StampedPose { time_s, pose }) in names.iter().zip(trajectory) {
        let (t, q) = (&pose.t_wc, &pose.r_wc);
        let numbers = [*time_s, t.x, t.y, t.z, q.i, q.j, q.k, q.w];
        let words = std::iter::once(name_to_cell(name).into_owned())
            .chain(numbers.iter().map(f64::to_string));
        let _ = writer.write_record(words);
    }
    let bytes = writer.into_inner().unwrap_or_default();
    String::from_utf8_lossy(&bytes).into_owned()
}
