//! Geometries of a GeoPackage in its binary encoding.
//!
//! Source: OGC GeoPackage 1.3 (12-128r17), 2.1.3; OGC Simple Features (06-103r4), 8.2.

/// "GP", version 1 (as 0), and flags: little endian, with an envelope in x and y.
const HEADER: [u8; 4] = [b'G', b'P', 0, 0b0000_0011];
/// Little endian, as well-known binary says it.
const LITTLE_ENDIAN: u8 = 1;
const POINT: u32 = 1;
const LINE_STRING: u32 = 2;

/// A geometry in the plane of the map; x is east, y north, metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// A point.
    Point([f64; 2]),
    /// A line through points.
    LineString(Vec<[f64; 2]>),
}

impl Geometry {
    fn points(&self) -> &[[f64; 2]] {
        match self {
            Self::Point(point) => std::slice::from_ref(point),
            Self::LineString(points) => points,
        }
    }

    /// Least x, largest x, least y, largest y.
    pub(super) fn envelope(&self) -> [f64; 4] {
        let [x, y] = [0, 1].map(|axis| self.points().iter().map(move |point| point[axis]));
        [
            x.clone().fold(f64::INFINITY, f64::min),
            x.fold(f64::NEG_INFINITY, f64::max),
            y.clone().fold(f64::INFINITY, f64::min),
            y.fold(f64::NEG_INFINITY, f64::max),
        ]
    }

    /// The geometry in the system of a code, as GeoPackages hold it.
    pub(super) fn encode(&self, srs_id: i32) -> Vec<u8> {
        let mut bytes = HEADER.to_vec();
        bytes.extend(srs_id.to_le_bytes());
        bytes.extend(self.envelope().iter().flat_map(|value| value.to_le_bytes()));
        bytes.push(LITTLE_ENDIAN);
        match self {
            Self::Point(_) => bytes.extend(POINT.to_le_bytes()),
            Self::LineString(points) => {
                bytes.extend(LINE_STRING.to_le_bytes());
                bytes.extend((points.len() as u32).to_le_bytes());
            }
        }
        let numbers = self.points().iter().flatten();
        bytes.extend(numbers.flat_map(|value| value.to_le_bytes()));
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_its_envelope_and_its_points() {
        let bytes = Geometry::LineString(vec![[1.0, 5.0], [3.0, 2.0]]).encode(2056);
        assert_eq!(bytes[..8], [b'G', b'P', 0, 3, 8, 8, 0, 0]);
        let number = |k: usize| f64::from_le_bytes(bytes[k..k + 8].try_into().unwrap());
        assert_eq!([8, 16, 24, 32].map(number), [1.0, 3.0, 2.0, 5.0]);
        assert_eq!(bytes[40..49], [1, 2, 0, 0, 0, 2, 0, 0, 0]);
        assert_eq!([49, 57, 65, 73].map(number), [1.0, 5.0, 3.0, 2.0]);
        assert_eq!(bytes.len(), 81);
        assert_eq!(Geometry::Point([1.0, 2.0]).encode(2056).len(), 61);
    }
}
