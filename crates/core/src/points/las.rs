//! LAS and LAZ.

use super::error::PointsError;
use super::point_visitor::{Place, PointVisitor};
use ::las::{PointDataBuilder, Reader};
use std::io::{Read, Seek};

/// Points that are decoded at once.
const BATCH: u64 = 1 << 16;

/// Reads all points.
///
/// # Errors
/// A header that is none, records that are missing or damaged, coordinates that are not finite.
pub fn read(
    reader: impl Read + Seek + Send + Sync + 'static,
    visitor: &mut PointVisitor,
) -> Result<(), PointsError> {
    let path = visitor.path();
    let fail = |error: ::las::Error| {
        PointsError::file(path, format!("cannot be read as LAS or LAZ: {error}"))
    };
    let mut reader = Reader::new(reader).map_err(fail)?;
    let expected = reader.header().number_of_points();
    let mut batch = PointDataBuilder::new().for_header(reader.header()).build();
    let mut done = 0;
    while done < expected {
        let count = reader
            .fill_points(BATCH.min(expected - done), &mut batch)
            .map_err(fail)?;
        if count == 0 {
            return Err(visitor.error(
                Place::Point(done + 1),
                format!("is missing, of {expected} points; the file is cut off: copy it again"),
            ));
        }
        let points = batch.x().zip(batch.y()).zip(batch.z());
        for (k, ((x, y), z)) in (1..).zip(points) {
            visitor.put(Place::Point(done + k), [x, y, z])?;
        }
        done += count;
    }
    Ok(())
}
