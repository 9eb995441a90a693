//! Coordinate reference systems of the EPSG register.

use crs_definitions::Def;

/// Start of a projected system as well-known text (OGC 01-009).
const PROJECTED: &str = "PROJCS[\"";
/// Unit of a system's lengths; it is the last unit of the text.
const METRE: &str = "UNIT[\"metre\",1,";

/// A projected coordinate reference system with coordinates in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crs {
    definition: Def,
}

impl Crs {
    /// The system of a code as `EPSG:2056`.
    ///
    /// # Errors
    /// A text of another form, a code that is not in the register, or a system whose coordinates
    /// are no metres in a plane, as text with the remedy.
    pub fn parse(text: &str) -> Result<Self, String> {
        const REMEDY: &str = "give the code of a projected system in metres, as \"EPSG:2056\"";
        let code = text
            .strip_prefix("EPSG:")
            .and_then(|code| code.parse().ok());
        let code: u16 = code.ok_or_else(|| format!("crs is {text:?}; {REMEDY}"))?;
        let definition = crs_definitions::from_code(code)
            .ok_or_else(|| format!("crs {text} is not a code of the EPSG register; {REMEDY}"))?;
        let crs = Self { definition };
        let unit = crs.wkt().rfind("UNIT[").map(|at| &crs.wkt()[at..]);
        let is_metric = unit.is_some_and(|unit| unit.starts_with(METRE));
        if !crs.wkt().starts_with(PROJECTED) || !is_metric {
            return Err(format!(
                "crs {text} ({}) has no coordinates in metres of a plane; {REMEDY}",
                crs.name()
            ));
        }
        Ok(crs)
    }

    /// Its code in the EPSG register.
    pub fn code(&self) -> u16 {
        self.definition.code
    }

    /// Its name.
    pub fn name(&self) -> &'static str {
        self.wkt().split('"').nth(1).unwrap_or_default()
    }

    /// Its definition as well-known text (OGC 01-009).
    pub fn wkt(&self) -> &'static str {
        self.definition.wkt
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projected_systems_in_metres_are_known() {
        for (text, name) in [
            ("EPSG:2056", "CH1903+ / LV95"),
            ("EPSG:25832", "ETRS89 / UTM zone 32N"),
            ("EPSG:32719", "WGS 84 / UTM zone 19S"),
        ] {
            let crs = Crs::parse(text).unwrap();
            assert_eq!(crs.name(), name);
            assert_eq!(format!("EPSG:{}", crs.code()), text);
        }
    }

    #[test]
    fn others_are_refused() {
        for (text, expected) in [
            ("EPSG:4326", "(WGS 84) has no coordinates in metres"),
            // In feet of the United States.
            ("EPSG:2263", "has no coordinates in metres"),
            ("EPSG:1", "is not a code"),
            ("LV95", "crs is \"LV95\""),
            ("EPSG:-1", "give the code"),
        ] {
            let message = Crs::parse(text).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}
