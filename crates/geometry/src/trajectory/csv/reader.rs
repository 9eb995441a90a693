//! Reading of CSV files of poses.

use super::cells::name_from_cell;
use super::columns::{Columns, FORM, RotationColumns, TimeColumn};
use super::header::Header;
use super::table::split;
use crate::trajectory::entry_list::{EntryList, ParsedPoses};
use crate::trajectory::error::PoseError;
use crate::trajectory::nanoseconds::from_nanoseconds;
use crate::trajectory::pose::Pose;
use crate::trajectory::pose_entry::PoseEntry;
use crate::trajectory::pose_options::PoseFileOptions;
use crate::trajectory::text;
use crate::trajectory::time_unit::TimeUnit;
use csv::StringRecord;
use nalgebra::Vector3;
use std::borrow::Cow;
use std::path::Path;

/// Extensions of pictures that are read, in small letters.
pub const PICTURE_EXTENSIONS: [&str; 6] = ["jpg", "jpeg", "png", "tif", "tiff", "webp"];

pub(crate) fn parse(
    path: &Path,
    text: &str,
    options: &PoseFileOptions,
) -> Result<ParsedPoses, PoseError> {
    let map = &options.columns;
    let Some(header) = Header::find(text, map).or_else(|| Header::first_line(text)) else {
        return Ok(ParsedPoses::default());
    };
    let fail = |number: usize| move |what: String| PoseError::line(path, number, what);
    let titles = split(header.line, header.separator).map_err(fail(header.number))?;
    let mut columns = Columns::of(&titles, options).map_err(fail(header.number))?;
    if columns.name.is_none() {
        let first = header.records(text).next();
        let first = first.and_then(|(_, line)| split(line, header.separator).ok());
        columns.name = first.as_ref().and_then(picture_column);
    }
    let row = RowReader {
        columns,
        count: titles.len(),
        separator: header.separator,
        time_unit: options.time_unit,
    };
    let mut entries = EntryList::new(options.duplicate_times);
    let mut names = text::Names::default();
    for (number, line) in header.records(text) {
        row.read(line)
            .and_then(|entry| {
                entry
                    .name
                    .as_deref()
                    .map_or(Ok(()), |name| names.add(name))?;
                entries.push(number, entry)
            })
            .map_err(fail(number))?;
    }
    Ok(entries.into_parsed())
}

/// The only column with the name of a picture, whatever its title (`Bild`, `Photo ID`): without it,
/// rows in another order than the frames would be taken for theirs.
fn picture_column(record: &StringRecord) -> Option<usize> {
    let is_picture = |cell: &str| {
        let extension = cell.rsplit_once('.').map(|(_, extension)| extension);
        let extension = extension.map(str::to_ascii_lowercase);
        extension.is_some_and(|extension| PICTURE_EXTENSIONS.contains(&extension.as_str()))
    };
    let mut found = (0..record.len()).filter(|k| record.get(*k).is_some_and(is_picture));
    found.next().filter(|_| found.next().is_none())
}

/// A reader of the rows of a table.
struct RowReader {
    columns: Columns,
    /// Number of columns.
    count: usize,
    separator: u8,
    /// Unit of the times whose column does not tell.
    time_unit: Option<TimeUnit>,
}

impl RowReader {
    /// Reads the pose of a row.
    fn read(&self, line: &str) -> Result<PoseEntry, String> {
        let record = split(line, self.separator)?;
        if record.len() != self.count {
            let remedy = if self.separator == b',' && record.len() > self.count {
                "; where numbers have decimal commas, semicolons or tabs must separate them"
            } else {
                ""
            };
            return Err(format!(
                "{} columns where the first line names {}{remedy}",
                record.len(),
                self.count
            ));
        }
        let number = |column| text::number(&self.number_in(&record, column), FORM);
        let [tx, ty, tz] = self.columns.translation;
        let position = Vector3::new(number(tx)?, number(ty)?, number(tz)?);
        let rotation = match self.columns.rotation {
            RotationColumns::Quaternion([qx, qy, qz, qw]) => {
                let wxyz = [number(qw)?, number(qx)?, number(qy)?, number(qz)?];
                text::rotation(wxyz, "as the columns' names say")?
            }
            RotationColumns::Angles(columns, sequence) => {
                let mut angles_rad = [0.0; 3];
                for (angle, (column, unit)) in angles_rad.iter_mut().zip(columns) {
                    *angle = unit.radians(number(column)?);
                }
                sequence.rotation(angles_rad)
            }
        };
        let name = self
            .columns
            .name
            .map(|column| record.get(column).unwrap_or_default());
        if name == Some("") {
            return Err("the frame has no name".to_owned());
        }
        Ok(PoseEntry {
            camera: None,
            name: name.map(|name| name_from_cell(name).to_owned()),
            time_s: self.time(&record)?,
            pose: Pose::new(rotation, position),
        })
    }

    /// The time of a row, if there are times.
    fn time(&self, record: &StringRecord) -> Result<Option<f64>, String> {
        let Some(columns) = self.columns.time else {
            return Ok(None);
        };
        let word = |column| self.number_in(record, column);
        Ok(Some(match columns {
            TimeColumn::One(column, unit) => {
                text::time(&word(column), unit.or(self.time_unit), FORM)?
            }
            TimeColumn::Nanoseconds(column) => from_nanoseconds(&word(column))?,
            TimeColumn::Parts(seconds, nanoseconds) => {
                text::number(&word(seconds), FORM)? + from_nanoseconds(&word(nanoseconds))?
            }
        }))
    }

    /// The number in a column, with a decimal point.
    fn number_in<'a>(&self, record: &'a StringRecord, column: usize) -> Cow<'a, str> {
        text::with_decimal_point(record.get(column).unwrap_or_default(), self.separator)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::csv::format;
    use crate::trajectory::euler::AngleUnit;
    use crate::trajectory::stamped_pose::StampedPose;

    fn parse(path: &Path, text: &str) -> Result<Vec<PoseEntry>, PoseError> {
        let parsed = super::parse(path, text, &PoseFileOptions::default())?;
        Ok(parsed.entries)
    }

    #[test]
    fn a_column_of_pictures_names_the_frames_whatever_its_title() {
        let named = |text: &str| {
            let read = parse(Path::new("p.csv"), text).unwrap();
            read[0].name.clone()
        };
        let row = "1,2,3,0,0,0,1";
        let text = format!("Bild,x,y,z,qx,qy,qz,qw\nC:\\a\\IMG_1.JPG,{row}\n");
        assert_eq!(named(&text).as_deref(), Some("C:\\a\\IMG_1.JPG"));
        // Two such columns, or none, name nothing.
        let two = format!("a,b,x,y,z,qx,qy,qz,qw\n1.png,2.png,{row}\n");
        assert_eq!(named(&two), None);
        assert_eq!(named(&format!("a,x,y,z,qx,qy,qz,qw\n1.5,{row}\n")), None);
    }

    #[test]
    fn any_name_of_a_frame_comes_back() {
        let names = [
            "a\n\"q\",.png",
            "=HYPERLINK(1).png",
            "'=x",
            "'plain",
            "-1",
            "# x",
            "\u{1b}[m",
            " a ",
            "' a ",
            "'b '",
            "=1 ",
            "\tc",
        ];
        let names = names.map(str::to_owned);
        let pose = Pose::identity();
        let trajectory: Vec<StampedPose> = (0..names.len())
            .map(|k| StampedPose {
                time_s: k as f64,
                pose,
            })
            .collect();
        let text = format(&names, &trajectory);
        assert!(!text.contains("\n=") && !text.contains("\n-"), "{text}");
        let read = parse(Path::new("p.csv"), &text).unwrap();
        let read: Vec<String> = read.into_iter().filter_map(|entry| entry.name).collect();
        assert_eq!(read, names);
    }

    /// Angles without their order and unit, and decimal commas between commas.
    #[test]
    fn what_a_table_lacks_is_named_with_what_helps() {
        let error = |text: &str| parse(Path::new("p.csv"), text).unwrap_err().to_string();
        let said = error("tx,ty,tz,roll,pitch,yaw\n0,0,0,0,0,0\n");
        let lines = "euler = \"ZYX\" and angle_unit = \"deg\" (or \"rad\") in [poses]";
        assert!(
            said.starts_with("p.csv:1: ") && said.contains(lines),
            "{said}"
        );
        let said = error("x,y,z,omega_deg,phi_deg,kappa_deg\n0,0,0,0,0,0\n");
        let lines = "euler = \"XYZ\" and camera_axes = \"opengl\" in [poses]";
        assert!(said.contains(lines), "{said}");
        let said = error("name,Latitude,longitude,alt,qx,qy,qz,qw\n");
        assert!(said.contains("no metres: project them"), "{said}");
        let said = error("tx,ty,tz,qx,qy,qz,qw\n0,5,0,5,0,5,0,5,0,5,0,5,0,5\n");
        assert!(
            said.contains(":2: 14 columns") && said.contains("semicolons"),
            "{said}"
        );
    }

    /// Angles in degrees and radians, told by the header or by the options.
    #[test]
    fn angles_are_read_in_the_order_that_is_given() {
        let read = |text: &str, euler: &str, angle_unit| {
            let options = PoseFileOptions {
                euler: Some(euler.parse().unwrap()),
                angle_unit,
                ..PoseFileOptions::default()
            };
            super::parse(Path::new("p.csv"), text, &options).map(|parsed| parsed.entries[0].pose)
        };
        let degrees = "tx,ty,tz,roll_deg,pitch [deg],Yaw (°)\n1,2,3,10,20,30\n";
        let pose = read(degrees, "ZYX", None).unwrap();
        let [roll, pitch, yaw] = [10.0f64, 20.0, 30.0].map(f64::to_radians);
        let expected = nalgebra::UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        assert!(pose.r_wc.angle_to(&expected) < 1e-12);
        assert_eq!(pose.t_wc, Vector3::new(1.0, 2.0, 3.0));
        let radians = format!("yaw,pitch,roll,x,y,z\n{yaw},{pitch},{roll},1,2,3\n");
        let same = read(&radians, "xyz", Some(AngleUnit::Rad)).unwrap();
        assert!(same.r_wc.angle_to(&expected) < 1e-12);
        let said = read(&radians, "ZYX", None).unwrap_err().to_string();
        assert!(
            said.contains("unit of `roll`") && said.contains("angle_unit"),
            "{said}"
        );
        let said = read("x,y,z,roll,yaw\n", "ZYX", None)
            .unwrap_err()
            .to_string();
        assert!(
            said.contains("no column `ry`") && said.contains("columns = { ry"),
            "{said}"
        );
    }

    /// Thousands, decimal commas, empty cells and rows, blanks and dates.
    #[test]
    fn tables_of_spreadsheets_are_read() {
        let pose = "0.5,-1,1234.5,0,0,0,1";
        let plain = parse(
            Path::new("p.csv"),
            &format!("tx,ty,tz,qx,qy,qz,qw\n{pose}\n"),
        );
        let plain = plain.unwrap();
        for text in [
            "tx,ty,tz,qx,qy,qz,qw,,\r\n0.5,-1,\"1,234.5\",0,0,0,1,,\r\n,,,,,,,,\r\n",
            "tx;ty;tz;qx;qy;qz;qw\n0,5;−1;1.234,5;0;0;0;1\n;;;;;;\n",
            "tx ty tz  qx qy qz qw\n0.5 -1 1234.5 0 0  0 1\n",
        ] {
            assert_eq!(parse(Path::new("p.csv"), text).unwrap(), plain, "{text}");
        }
        let dated = "time,tx,ty,tz,qx,qy,qz,qw\n2026-11-25 08:47:38.5,0.5,-1,1234.5,0,0,0,1\n";
        let dated = parse(Path::new("p.csv"), dated).unwrap();
        assert_eq!(dated[0].time_s, Some(1795596458.5));
    }

    #[test]
    fn a_quote_that_is_never_closed_is_an_error_of_its_line() {
        let text = format!("# poses\n{FORM}\n\"a,0,0,0,0,0,0,0,1\nb,1,0,0,0,0,0,0,1\n");
        let error = parse(Path::new("p.csv"), &text).unwrap_err().to_string();
        assert!(error.starts_with("p.csv:3: "), "{error}");
    }
}
