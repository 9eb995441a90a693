//! Tags of a GeoTIFF beside the picture: its place in a plane, and its quantity.
//!
//! Source: OGC GeoTIFF 1.1 (19-008r4), annex B; the texts of coordinate systems that GDAL's driver
//! GTiff reads from key 3073 (`gt_wkt_srs.cpp`); GDAL's metadata in TIFF files (tag 42112).

use super::directory::{Values, tag};
use super::spec::{Georeference, Quantity, RasterSpec};

/// "User-defined" as the value of a key.
const USER_DEFINED: u16 = 32767;
/// The code of the metre.
const METRE: u16 = 9001;

/// Words before the text of a coordinate system in its citation, as Esri's programs write them and
/// GDAL reads them. No other key of a GeoTIFF names axes.
const COORDINATE_SYSTEM_TEXT: &str = "ESRI PE String = ";

/// The georeference: a plane in metres with a name and axes, neither geographic nor projected. The
/// matrix supports axes of any direction.
pub(super) fn geo_tags(georeference: &Georeference) -> [(u16, Values); 3] {
    let Georeference {
        plane,
        origin_m: [x, y],
        column_m: [column_x, column_y],
        row_m: [row_x, row_y],
        ..
    } = *georeference;
    #[rustfmt::skip]
    let matrix = vec![
        column_x, row_x, 0.0, x,
        column_y, row_y, 0.0, y,
        0.0,      0.0,   0.0, 0.0,
        0.0,      0.0,   0.0, 1.0,
    ];
    // Texts of keys end in `|`.
    let name = format!("{plane}|");
    let system = format!(
        "{COORDINATE_SYSTEM_TEXT}{}|",
        coordinate_system(georeference)
    );
    let [name_len, system_len] = [&name, &system].map(|text| text.len() as u16);
    #[rustfmt::skip]
    let keys = vec![
        1, 1, 0, 5, // version, revision, number of keys
        1024, 0, 1, USER_DEFINED, // model type
        1025, 0, 1, 1, // raster type: pixel is area
        1026, tag::GEO_ASCII_PARAMS, name_len, 0, // name
        3073, tag::GEO_ASCII_PARAMS, system_len, name_len, // axes
        3076, 0, 1, METRE, // unit
    ];
    [
        (tag::MODEL_TRANSFORMATION, Values::Double(matrix)),
        (tag::GEO_KEY_DIRECTORY, Values::Short(keys)),
        (tag::GEO_ASCII_PARAMS, Values::Ascii(name + &system)),
    ]
}

/// The plane as well-known text (OGC 01-009, 7.2). Directions are those in which programs draw.
fn coordinate_system(georeference: &Georeference) -> String {
    let Georeference {
        plane,
        axes: [x, y],
        ..
    } = georeference;
    format!(
        "LOCAL_CS[\"{plane}\",LOCAL_DATUM[\"{plane}\",32767],UNIT[\"metre\",1],\
         AXIS[\"{x}\",EAST],AXIS[\"{y}\",NORTH]]"
    )
}

/// Names and units of the bands, as GDAL reads them: the quantity, or brightness or colours, and
/// the alpha if the pixels hold one.
pub(super) fn bands_tag(spec: &RasterSpec, has_alpha: bool) -> (u16, Values) {
    let item = |band: usize, name: &str, role: &str, text: &str| {
        format!("  <Item name=\"{name}\" sample=\"{band}\" role=\"{role}\">{text}</Item>\n")
    };
    let plain = |name: &'static str| Quantity { name, unit: "" };
    let channels = match (spec.quantity, spec.channels) {
        (Some(quantity), _) => vec![quantity],
        (None, 1) => vec![plain("grey")],
        (None, _) => ["red", "green", "blue"].map(plain).to_vec(),
    };
    let bands = channels
        .into_iter()
        .chain(has_alpha.then_some(plain("alpha")));
    let mut items = String::new();
    for (band, Quantity { name, unit }) in bands.enumerate() {
        items += &item(band, "DESCRIPTION", "description", name);
        if !unit.is_empty() {
            items += &item(band, "UNITTYPE", "unittype", unit);
        }
    }
    let text = format!("<GDALMetadata>\n{items}</GDALMetadata>\n");
    (tag::GDAL_METADATA, Values::Ascii(text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::test_picture::grey_alpha;

    #[test]
    fn a_turned_picture_has_its_steps_in_the_columns_of_the_matrix() {
        let [matrix, keys, citation] = geo_tags(&Georeference {
            plane: "plane",
            axes: ["along", "around"],
            origin_m: [10.0, 20.0],
            column_m: [0.0, 0.5],
            row_m: [0.25, 0.0],
        });
        let (tag::MODEL_TRANSFORMATION, Values::Double(matrix)) = matrix else {
            panic!("{matrix:?}");
        };
        assert_eq!(matrix[..8], [0.0, 0.25, 0.0, 10.0, 0.5, 0.0, 0.0, 20.0]);
        let system = "ESRI PE String = LOCAL_CS[\"plane\",LOCAL_DATUM[\"plane\",32767],\
                      UNIT[\"metre\",1],AXIS[\"along\",EAST],AXIS[\"around\",NORTH]]";
        assert_eq!(citation.1, Values::Ascii(format!("plane|{system}|")));
        let Values::Short(keys) = keys.1 else {
            panic!("{keys:?}");
        };
        assert_eq!(keys.len(), 4 * (1 + usize::from(keys[3])));
        assert_eq!(keys[12..16], [1026, 34737, 6, 0]);
        assert_eq!(keys[16..20], [3073, 34737, system.len() as u16 + 1, 6]);
    }

    #[test]
    fn plain_numbers_have_no_unit() {
        let text = |unit| {
            let quantity = Some(Quantity {
                name: "share",
                unit,
            });
            written(&RasterSpec {
                quantity,
                ..grey_alpha(9, 9)
            })
        };
        assert!(text("mm").contains("role=\"unittype\">mm</Item>"));
        assert!(!text("").contains("UNITTYPE") && text("").contains(">share</Item>"));
    }

    fn written(spec: &RasterSpec) -> String {
        match bands_tag(spec, spec.alpha).1 {
            Values::Ascii(text) => text,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn bands_of_pictures_are_named_in_their_order() {
        let grey = grey_alpha(9, 9);
        let colour = RasterSpec {
            channels: 3,
            ..grey
        };
        for (spec, names) in [
            (&grey, &["grey", "alpha"][..]),
            (&colour, &["red", "green", "blue", "alpha"]),
        ] {
            let text = written(spec);
            for (band, name) in names.iter().enumerate() {
                let item = format!("sample=\"{band}\" role=\"description\">{name}<");
                assert!(text.contains(&item), "no {item} in {text}");
            }
            assert_eq!(text.matches("<Item").count(), names.len());
        }
    }
}
