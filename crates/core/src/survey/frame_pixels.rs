//! Pixels of frames in a table (CSV) with the columns `frame`, `u` and `v`, and others or not.

use super::open::Survey;
use csv::StringRecord;
use std::fs::File;
use std::path::Path;
use tunnelstitch_geometry::files::{open_regular, printed};

/// The columns.
const COLUMNS: [&str; 3] = ["frame", "u", "v"];

/// A table of pixels that is being read.
pub struct FramePixels<'s> {
    survey: &'s Survey,
    reader: csv::Reader<File>,
    headers: StringRecord,
    /// Places of [`COLUMNS`].
    columns: [usize; 3],
}

/// A row of the table.
pub struct FramePixel {
    /// All its cells.
    pub cells: StringRecord,
    /// Index of the frame.
    pub frame: usize,
    /// Column and row of the pixel.
    pub pixel: [f64; 2],
}

impl<'s> FramePixels<'s> {
    /// Opens a table of pixels of a survey's frames and reads its first line.
    ///
    /// # Errors
    /// A file that cannot be read, or that lacks a column, in words.
    pub fn open(survey: &'s Survey, path: &Path) -> Result<Self, String> {
        let source = open_regular(path).map_err(|error| error.to_string())?;
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .from_reader(source);
        let headers = reader.headers().map_err(|error| error.to_string())?.clone();
        Ok(Self {
            survey,
            reader,
            columns: find_columns(&headers)?,
            headers,
        })
    }

    /// The names of the columns.
    pub fn headers(&self) -> &StringRecord {
        &self.headers
    }

    fn row(&self, cells: StringRecord) -> Result<FramePixel, String> {
        let [frame, u, v] = self.columns;
        let number = |column: usize| {
            let text = &cells[column];
            let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
            value.ok_or_else(|| format!("`{text}` is not a number of pixels"))
        };
        let name = &cells[frame];
        let found = self.survey.find_frame(name);
        Ok(FramePixel {
            frame: found.map_err(|what| format!("frame {name}: {what}"))?,
            pixel: [number(u)?, number(v)?],
            cells,
        })
    }
}

impl Iterator for FramePixels<'_> {
    /// A row, or what is wrong with it.
    type Item = Result<FramePixel, String>;

    fn next(&mut self) -> Option<Self::Item> {
        let mut cells = StringRecord::new();
        match self.reader.read_record(&mut cells) {
            Ok(false) => None,
            Err(error) => Some(Err(error.to_string())),
            Ok(true) => {
                let line = cells.position().map_or(0, csv::Position::line);
                let row = self.row(cells);
                Some(row.map_err(|what| format!("line {line}: {what}")))
            }
        }
    }
}

/// Finds the columns among the headers; returns what is missing.
fn find_columns(headers: &StringRecord) -> Result<[usize; 3], String> {
    let mut places = [0; 3];
    for (place, name) in places.iter_mut().zip(COLUMNS) {
        let found = headers.iter().position(|header| header == name);
        *place = found.ok_or_else(|| {
            format!(
                "there is no column {name}; the first line must name the columns frame, u and v, \
                 and has {}",
                headers.iter().collect::<Vec<_>>().join(", ")
            )
        })?;
    }
    Ok(places)
}

impl Survey {
    /// Finds a frame by the name of its file, the end of its path, or its index.
    ///
    /// # Errors
    /// A name of no frame, or of several, in words.
    pub fn find_frame(&self, name: &str) -> Result<usize, String> {
        let count = self.frames.len();
        let has_name = |k: &usize| self.frames[*k].path.ends_with(name);
        let mut found = (0..count).filter(has_name);
        match (found.next(), found.next()) {
            (Some(only), None) => Ok(only),
            (Some(first), Some(second)) => Err(format!(
                "{} and {} both have this name; give the folder, too, or an index \
                 from 0 to {}",
                printed(&self.frames[first].path),
                printed(&self.frames[second].path),
                count - 1
            )),
            _ => name.parse().ok().filter(|k| *k < count).ok_or_else(|| {
                format!(
                    "no such frame; give the name of a file, as {}, or an index from \
                     0 to {}",
                    self.frames[0].name(),
                    count - 1
                )
            }),
        }
    }
}
