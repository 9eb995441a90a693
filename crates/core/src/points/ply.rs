//! PLY: properties `x`, `y` and `z` of the element `vertex`, as text or binary of both byte orders.

use super::error::PointsError;
use super::point_visitor::{Place, PointVisitor};
use super::xyz::read_line;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Property, PropertyAccess, PropertyAccessResult, PropertyType,
};
use std::io::BufRead;

/// Name of the element whose positions are read.
const VERTEX: &str = "vertex";

/// Position of an element; all other properties are ignored.
struct Position([f64; 3]);

impl PropertyAccess for Position {
    fn new() -> Self {
        Self([f64::NAN; 3])
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let axis = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            _ => return PropertyAccessResult::Ignored,
        };
        self.0[axis] = match property {
            Property::Float(value) => f64::from(value),
            Property::Double(value) => value,
            Property::Char(value) => f64::from(value),
            Property::UChar(value) => f64::from(value),
            Property::Short(value) => f64::from(value),
            Property::UShort(value) => f64::from(value),
            Property::Int(value) => f64::from(value),
            Property::UInt(value) => f64::from(value),
            _ => return PropertyAccessResult::Ignored,
        };
        PropertyAccessResult::Set
    }
}

/// Reads all points.
///
/// # Errors
/// A header that is none, or without positions; elements that are missing or damaged; coordinates
/// that are not finite.
pub fn read(reader: &mut impl BufRead, visitor: &mut PointVisitor) -> Result<(), PointsError> {
    let path = visitor.path();
    let parser = Parser::<Position>::new();
    let mut reader = Reader::new(reader);
    let header = parser.read_header(&mut reader).map_err(|error| {
        PointsError::file(path, format!("has no header of a PLY file: {error}"))
    })?;
    let Some(vertices) = header.elements.get(VERTEX) else {
        return Err(PointsError::file(
            path,
            "has no element vertex, thus no points",
        ));
    };
    for axis in ["x", "y", "z"] {
        let property = vertices.properties.get(axis);
        if !property.is_some_and(|p| matches!(p.data_type, PropertyType::Scalar(_))) {
            let what = format!("its element vertex has no property {axis}, thus no points");
            return Err(PointsError::file(path, what));
        }
    }
    let mut place = match header.encoding {
        // The reader is at the line after the header.
        Encoding::Ascii => Place::Line(reader.line().saturating_sub(1) as u64),
        _ => Place::Point(0),
    };
    let reader = reader.get_mut();
    for (name, element) in &header.elements {
        let is_vertex = name == VERTEX;
        for _ in 0..element.count {
            if is_vertex || matches!(place, Place::Line(_)) {
                place = place.next();
            }
            let position = match header.encoding {
                Encoding::Ascii => read_text(&parser, reader, element, place, visitor)?,
                binary => {
                    let read = match binary {
                        Encoding::BinaryBigEndian => {
                            parser.read_big_endian_element(reader, element)
                        }
                        _ => parser.read_little_endian_element(reader, element),
                    };
                    read.map_err(|error| {
                        let what = format!("of {} {name}: {error}; copy it again", element.count);
                        visitor.error(place, what)
                    })?
                }
            };
            if is_vertex {
                visitor.put_measured(place, position.0)?;
            }
        }
        if is_vertex {
            break;
        }
    }
    Ok(())
}

/// Reads an element of a text.
///
/// # Errors
/// A line that is missing or has other values than the header says.
fn read_text(
    parser: &Parser<Position>,
    reader: &mut impl BufRead,
    element: &ElementDef,
    place: Place,
    visitor: &PointVisitor,
) -> Result<Position, PointsError> {
    let Place::Line(number) = place else {
        return Err(visitor.error(place, "is no line"));
    };
    let mut line = Vec::new();
    if !read_line(reader, &mut line, number, visitor)? {
        let what = format!(
            "the file ends before the {} elements {} that its header announces; copy it again",
            element.count, element.name
        );
        return Err(visitor.error(place, what));
    }
    let text = String::from_utf8_lossy(&line);
    let read = parser.read_ascii_element(&text, element);
    read.map_err(|_| {
        let what = format!("is no element {} as the header describes it", element.name);
        visitor.error(place, what)
    })
}
