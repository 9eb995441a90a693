//! Reading of CSV files of poses.

use super::cells::name_from_cell;
use super::columns::{Columns, FORM, RotationColumns, TimeColumn};
use super::header::Header;
use super::pose_column::PoseColumn;
use super::table::split;
use super::title::is_length_unit;
use crate::trajectory::entry_list::ParsedPoses;
use crate::trajectory::error::PoseError;
use crate::trajectory::nanoseconds::from_nanoseconds;
use crate::trajectory::pose::Pose;
use crate::trajectory::pose_entry::PoseEntry;
use crate::trajectory::pose_options::PoseFileOptions;
use crate::trajectory::rigid;
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
    let mut titles = split(header.line, header.separator).map_err(fail(header.number))?;
    let mut records = header.records(text).peekable();
    let row = |line| split(line, header.separator).ok();
    if let Some(units) = records.peek().and_then(|(_, line)| row(line))
        && is_row_of_units(&units)
    {
        titles = with_units(&titles, &units);
        records.next();
    }
    let mut columns = Columns::of(&titles, options).map_err(fail(header.number))?;
    if columns.name.is_none() {
        let first = records.peek().and_then(|(_, line)| row(line));
        columns.name = first.as_ref().and_then(picture_column);
    }
    let row = RowReader {
        columns,
        count: filled(&titles),
        separator: header.separator,
        time_unit: options.time_unit,
    };
    text::stamped_rows(path, records, options.duplicate_times, |line| {
        row.read(line)
    })
}

/// The only column with the name of a picture, whatever its title (`Bild`, `Photo ID`): without it,
/// rows in another order than the frames would be taken for theirs.
fn picture_column(record: &StringRecord) -> Option<usize> {
    let mut found = (0..record.len()).filter(|k| record.get(*k).is_some_and(is_picture_name));
    found.next().filter(|_| found.next().is_none())
}

/// True for a word that ends as the name of a picture does.
pub(crate) fn is_picture_name(word: &str) -> bool {
    let extension = word.rsplit_once('.').map(|(_, extension)| extension);
    let extension = extension.map(str::to_ascii_lowercase);
    extension.is_some_and(|extension| PICTURE_EXTENSIONS.contains(&extension.as_str()))
}

/// Number of the cells of a record up to the last that is not empty.
fn filled(record: &StringRecord) -> usize {
    let cells = record.iter().enumerate();
    let last = cells.filter(|(_, cell)| !cell.is_empty()).last();
    last.map_or(0, |(k, _)| k + 1)
}

/// True for the row below the titles that names the units of some columns, at least those of a
/// translation, and holds no number.
fn is_row_of_units(record: &StringRecord) -> bool {
    let is_number = |cell: &str| cell.contains(|c: char| c.is_ascii_digit());
    let lengths = record.iter().filter(|cell| is_length_unit(cell));
    !record.iter().any(is_number) && lengths.count() >= PoseColumn::TRANSLATION.len()
}

/// The titles, each with the unit below it.
fn with_units(titles: &StringRecord, units: &StringRecord) -> StringRecord {
    let unit = |k: usize| {
        units
            .get(k)
            .map(|unit| unit.trim_matches(['[', ']', '(', ')']))
    };
    let titles = titles.iter().enumerate();
    let joined = titles.map(|(k, title)| match unit(k) {
        None | Some("") => title.to_owned(),
        Some(unit) => format!("{title} [{unit}]"),
    });
    joined.collect::<Vec<_>>().into()
}

/// A reader of the rows of a table.
struct RowReader {
    columns: Columns,
    /// Number of columns up to the last that has a title.
    count: usize,
    separator: u8,
    /// Unit of the times whose column does not tell.
    time_unit: Option<TimeUnit>,
}

impl RowReader {
    /// Reads the pose of a row.
    fn read(&self, line: &str) -> Result<PoseEntry, String> {
        let record = split(line, self.separator)?;
        let most = filled(&record).max(self.count);
        if record.len() < self.count || most > self.count {
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
        let metres = |(column, unit_m): (usize, f64)| Ok::<_, String>(unit_m * number(column)?);
        let [tx, ty, tz] = self.columns.translation;
        let position = Vector3::new(metres(tx)?, metres(ty)?, metres(tz)?);
        let rotation = match self.columns.rotation {
            RotationColumns::Matrix(rows) => {
                let mut matrix = [[0.0; 4]; 3];
                for (row, columns) in matrix.iter_mut().zip(rows) {
                    for (value, column) in row.iter_mut().zip(columns) {
                        *value = number(column)?;
                    }
                }
                rigid::from_rows(&matrix)?.r_wc
            }
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
        let cell = record.get(column).unwrap_or_default();
        text::with_decimal_point(cell.trim_matches('\''), self.separator)
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

    /// Titles, rules and units around a table that people have edited.
    #[test]
    fn tables_that_people_have_edited_are_read() {
        let read = |text: &str| parse(Path::new("p.csv"), text).unwrap();
        let plain = read("tx,ty,tz,qx,qy,qz,qw\n0.5,-1,2,0,0,0,1\n");
        for text in [
            "Survey of May\n\nmade by hand,,\ntx,ty,tz,qx,qy,qz,qw\n0.5,-1,2,0,0,0,1\n",
            "tx,ty,tz,qx,qy,qz,qw\nm,m,m,-,-,-,-\n0.5,-1,2,0,0,0,1\n",
            "tx,ty,tz,qx,qy,qz,qw\n[cm],[cm],[cm],,,,\n50,-100,200,0,0,0,1\n",
            "x_mm,y [mm],Z (mm),qx,qy,qz,qw\n500,-1000,2000,0,0,0,1\n",
            "tx,ty,tz,qx,qy,qz,qw\n0.5,-1,2,0,0,0,1,\n",
            "tx,ty,tz,qx,qy,qz,qw,,,\n0.5,-1,2,0,0,0,1\n",
            "'tx','ty','tz','qx','qy','qz','qw'\n'0.5','-1','2','0','0','0','1'\n",
            "tx,ty,tz,qx,qy,qz,qw\n\"0,5\",\"-1,0\",\"2,00\",0,0,0,1\n",
            "| tx | ty | tz | qx | qy | qz | qw |\n|---|---:|:--|---|---|---|---|\n\
             | 0.5 | -1 | 2 | 0 | 0 | 0 | 1 |\n",
            "r11,r12,r13,tx,r21,r22,r23,ty,r31,r32,r33,tz\n1,0,0,0.5,0,1,0,-1,0,0,1,2\n",
            "r11,r12,r13,t1,r21,r22,r23,t2,r31,r32,r33,t3\n1,0,0,0.5,0,1,0,-1,0,0,1,2\n",
            "m00,m01,m02,m03,m10,m11,m12,m13,m20,m21,m22,m23\n1,0,0,0.5,0,1,0,-1,0,0,1,2\n",
        ] {
            assert_eq!(read(text), plain, "{text}");
        }
        let feet = read("x [ft],y [ft],z [ft],qx,qy,qz,qw\n10,0,0,0,0,0,1\n");
        assert!((feet[0].pose.t_wc.x - 3.048).abs() < 1e-12);
    }

    /// The stamp of a message is the camera's, the column `time` that of the recording.
    #[test]
    fn a_stamp_in_two_parts_precedes_other_times() {
        let text = "time,.header.stamp.secs,.header.stamp.nsecs,.pose.position.x,\
            .pose.position.y,.pose.position.z,.pose.orientation.x,.pose.orientation.y,\
            .pose.orientation.z,.pose.orientation.w\n\
            2026/11/25/08:47:38.6,1795596458,500000000,0,0,0,0,0,0,1\n";
        let read = parse(Path::new("p.csv"), text).unwrap();
        assert_eq!(read[0].time_s, Some(1795596458.5));
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
