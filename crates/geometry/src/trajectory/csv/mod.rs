//! CSV files with named columns: `frame,time_s,tx_m,ty_m,tz_m,qx,qy,qz,qw`, camera-to-world.
//!
//! Columns are found by name, in any order; other columns are ignored. `frame` and the time may be
//! missing; times have the unit that their digits tell. Commas, semicolons, tabs, or else blanks
//! separate; numbers may have decimal commas where commas do not separate, and
//! names may stand in quotes. A line `sep=;` before the header names the separator, as spreadsheets
//! write it.
//!
//! | subject | file |
//! | --- | --- |
//! | the columns of poses, and the names that a user gives them | [`pose_column`] |
//! | names that this program, ROS and EuRoC give to columns | [`title`] |
//! | the columns of a header | [`columns`] |
//! | the header of a table | [`header`] |
//! | separator and records of a table | [`table`] |
//! | cells that no spreadsheet runs | [`cells`] |
//! | reading and writing | [`reader`], [`writer`] |

mod cells;
mod columns;
mod header;
mod pose_column;
mod reader;
mod table;
mod title;
mod writer;

pub use cells::{from_cell, to_cell};
pub(super) use columns::FORM;
pub(super) use header::Header;
pub use pose_column::{ColumnMap, PoseColumn};
pub use reader::PICTURE_EXTENSIONS;
pub(super) use reader::{is_picture_name, parse};
pub(super) use table::{separator, split};
pub use writer::format;
