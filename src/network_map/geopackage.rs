//! GeoPackages: layers of features in one SQLite file.
//!
//! Source: OGC GeoPackage 1.3 (12-128r17).

use super::geometry::Geometry;
use crate::jobs::Crs;
use crs_definitions::Def;
use rusqlite::types::Value;
use rusqlite::{Connection, params};

/// "GPKG", the kind of SQLite file, and the version of the standard (1.3.0).
const FILE_PRAGMAS: &str = "PRAGMA page_size = 4096;
    PRAGMA application_id = 0x47504B47;
    PRAGMA user_version = 10300;";

/// Tables that every GeoPackage has.
const TABLES: &str = include_str!("geopackage.sql");

/// A system that every GeoPackage knows.
const WGS_84: Def = crs_definitions::EPSG_4326;

/// Time of the last change of every layer: equal content has equal bytes.
const LAST_CHANGE: &str = "1970-01-01T00:00:00.000Z";

/// Type of the values of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnType {
    /// A text.
    Text,
    /// An integer.
    Integer,
    /// A number.
    Real,
}

/// A column of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Column {
    /// Its name: small letters, digits and `_`.
    pub name: &'static str,
    /// Type of its values.
    pub kind: ColumnType,
}

/// A feature of a layer.
#[derive(Clone, Debug, PartialEq)]
pub struct Feature {
    /// Its geometry.
    pub geometry: Geometry,
    /// Its values, column by column.
    pub values: Vec<Value>,
}

/// A layer of features with geometries of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Its name: small letters and `_`.
    pub name: &'static str,
    /// A sentence about it.
    pub description: &'static str,
    /// `POINT` or `LINESTRING`.
    pub geometry_type: &'static str,
    /// Its columns beside feature identifier and geometry.
    pub columns: Vec<Column>,
    /// Its features.
    pub features: Vec<Feature>,
}

/// Layers in a coordinate reference system.
#[derive(Clone, Debug, PartialEq)]
pub struct GeoPackage {
    /// The system of all geometries.
    pub crs: Crs,
    /// The layers.
    pub layers: Vec<Layer>,
}

impl GeoPackage {
    /// The content of the file, which is equal for equal layers.
    ///
    /// # Errors
    /// An error of the database, which is in memory.
    pub fn encode(&self) -> Result<Vec<u8>, rusqlite::Error> {
        let mut database = Connection::open_in_memory()?;
        database.execute_batch(FILE_PRAGMAS)?;
        let transaction = database.transaction()?;
        transaction.execute_batch(TABLES)?;
        for (name, code, wkt) in [
            ("WGS 84", WGS_84.code, WGS_84.wkt),
            (self.crs.name(), self.crs.code(), self.crs.wkt()),
        ] {
            transaction.execute(
                "INSERT INTO gpkg_spatial_ref_sys VALUES (?1, ?2, 'EPSG', ?2, ?3, NULL)",
                params![name, code, wkt],
            )?;
        }
        for layer in &self.layers {
            layer.write(&transaction, i32::from(self.crs.code()))?;
        }
        transaction.commit()?;
        Ok(database.serialize("main")?.to_vec())
    }
}

impl Layer {
    fn write(&self, database: &Connection, srs_id: i32) -> Result<(), rusqlite::Error> {
        let Self {
            name,
            description,
            geometry_type,
            columns,
            features,
        } = self;
        let kind = |column: &Column| match column.kind {
            ColumnType::Text => "TEXT",
            ColumnType::Integer => "INTEGER",
            ColumnType::Real => "DOUBLE",
        };
        let declared = columns.iter();
        let declared = declared.map(|column| format!(", {} {}", column.name, kind(column)));
        let declared: String = declared.collect();
        database.execute_batch(&format!(
            "CREATE TABLE {name} (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, \
             geom {geometry_type}{declared})"
        ))?;
        let [min_x, max_x, min_y, max_y] = self.extent();
        database.execute(
            "INSERT INTO gpkg_contents VALUES (?, 'features', ?, ?, ?, ?, ?, ?, ?, ?)",
            params![
                name,
                name,
                description,
                LAST_CHANGE,
                min_x,
                min_y,
                max_x,
                max_y,
                srs_id
            ],
        )?;
        database.execute(
            "INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, ?, 0, 0)",
            params![name, geometry_type, srs_id],
        )?;
        let places = ", ?".repeat(columns.len());
        let insert = format!("INSERT INTO {name} VALUES (NULL, ?{places})");
        let mut insert = database.prepare(&insert)?;
        for Feature { geometry, values } in features {
            let geometry = Value::Blob(geometry.encode(srs_id));
            insert.execute(rusqlite::params_from_iter(
                std::iter::once(&geometry).chain(values),
            ))?;
        }
        Ok(())
    }

    /// Least and largest x, least and largest y of all features; None without features.
    fn extent(&self) -> [Option<f64>; 4] {
        let envelopes = self.features.iter();
        let envelopes = envelopes.map(|feature| feature.geometry.envelope());
        let extent = envelopes.reduce(|a, b| {
            [
                a[0].min(b[0]),
                a[1].max(b[1]),
                a[2].min(b[2]),
                a[3].max(b[3]),
            ]
        });
        extent.map_or([None; 4], |extent| extent.map(Some))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn package() -> GeoPackage {
        let feature = |x: f64, name: &str| Feature {
            geometry: Geometry::Point([x, 2.0 * x]),
            values: vec![Value::Text(name.to_owned()), Value::Null],
        };
        GeoPackage {
            crs: Crs::parse("EPSG:25832").unwrap(),
            layers: vec![Layer {
                name: "manholes",
                description: "Manholes",
                geometry_type: "POINT",
                columns: vec![
                    Column {
                        name: "id",
                        kind: ColumnType::Text,
                    },
                    Column {
                        name: "depth_m",
                        kind: ColumnType::Real,
                    },
                ],
                features: vec![feature(7.0, "O'Neill; \"A\""), feature(-3.0, "B")],
            }],
        }
    }

    #[test]
    fn a_geopackage_is_a_database_with_its_layers() {
        let bytes = package().encode().unwrap();
        assert_eq!(bytes[..16], *b"SQLite format 3\0");
        assert_eq!(bytes[68..72], *b"GPKG");
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("map.gpkg");
        std::fs::write(&path, bytes).unwrap();
        let database = Connection::open(&path).unwrap();
        let text =
            |query: &str| -> String { database.query_one(query, [], |row| row.get(0)).unwrap() };
        assert_eq!(text("PRAGMA integrity_check"), "ok");
        assert_eq!(
            text("SELECT id FROM manholes WHERE fid = 1"),
            "O'Neill; \"A\""
        );
        assert_eq!(
            text("SELECT min_x || ' ' || max_y || ' ' || srs_id FROM gpkg_contents"),
            "-3.0 14.0 25832"
        );
        let definition = text("SELECT definition FROM gpkg_spatial_ref_sys WHERE srs_id = 25832");
        assert!(definition.starts_with("PROJCS[\"ETRS89"), "{definition}");
        // No row of a table refers to one that is not there.
        let mut check = database.prepare("PRAGMA foreign_key_check").unwrap();
        assert!(check.query([]).unwrap().next().unwrap().is_none());
    }

    #[test]
    fn equal_layers_have_equal_bytes() {
        assert_eq!(package().encode(), package().encode());
        let mut other = package();
        other.layers[0].features.pop();
        assert_ne!(package().encode(), other.encode());
    }
}
