//! Pictures and maps in a GIS: where they lie, and that nothing is mirrored there.

use crate::support::{first_frames, succeed, text};
use serde_json::Value;
use std::path::Path;
use tiff::tags::Tag;

/// The tags of a GeoTIFF that a GIS reads.
struct Tags {
    /// From column and row of a corner to x and y, row by row (OGC GeoTIFF, tag 34264).
    matrix: Vec<f64>,
    /// Name of the plane, and the plane as well-known text.
    plane: String,
    /// GDAL's metadata.
    metadata: String,
}

impl Tags {
    fn of(path: &Path) -> Self {
        let file = std::io::BufReader::new(std::fs::File::open(path).unwrap());
        let mut decoder = tiff::decoder::Decoder::new(file).unwrap();
        let tag = Tag::from_u16_exhaustive;
        let metadata = decoder.get_tag_ascii_string(tag(42112));
        Self {
            matrix: decoder.get_tag_f64_vec(tag(34264)).unwrap(),
            plane: decoder.get_tag_ascii_string(tag(34737)).unwrap(),
            metadata: metadata.unwrap_or_default(),
        }
    }

    /// x and y of the centre of a pixel.
    fn at(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let row = |k: usize| &self.matrix[4 * k..];
        [0, 1].map(|k| row(k)[0] * (u + 0.5) + row(k)[1] * (v + 0.5) + row(k)[3])
    }

    /// True if the picture is as it is seen, with x to the right and y up.
    fn is_readable(&self) -> bool {
        let m = &self.matrix;
        m[0] * m[5] - m[1] * m[4] < 0.0
    }
}

/// Chainage and arc length are x and y in both layouts, which a GIS shows without mirroring.
#[test]
fn panoramas_and_maps_lie_in_the_plane_of_chainage_and_arc_length() {
    let survey = first_frames(3);
    let path = |name: &str| survey.path().join(name);
    let (wall, maps) = (path("wall.tif"), path("maps"));
    for layout in ["theta-right", "chainage-right"] {
        let drawn = [
            "--poses",
            "truth",
            "--px-per-metre",
            "20",
            "--layout",
            layout,
        ];
        let out = ["--out", text(&wall), "--maps", text(&maps), "--quiet"];
        succeed(&[&["stitch", text(survey.path())], &drawn[..], &out].concat());
        let point = ["--panorama", "12,7", "--json"];
        let located = succeed(&[&["locate", text(survey.path())], &drawn[..], &point].concat());
        let located: Value = serde_json::from_str(&located).unwrap();
        let number = |key: &str| located[key].as_f64().unwrap();
        let arc_m = 3.0 * number("theta_deg").rem_euclid(360.0).to_radians();
        let files = [
            wall.clone(),
            maps.join("coverage.tif"),
            maps.join("frames.tif"),
        ];
        for file in files {
            let tags = Tags::of(&file);
            assert!(tags.is_readable(), "{layout}");
            let [x_m, y_m] = tags.at([12.0, 7.0]);
            assert!((x_m - number("chainage_m")).abs() < 1e-9, "{layout} {x_m}");
            assert!((y_m - arc_m).abs() < 1e-9, "{layout} {y_m} {arc_m}");
            assert!(
                tags.plane.contains("x chainage, y arc length"),
                "{}",
                tags.plane
            );
            assert!(
                tags.plane
                    .contains("AXIS[\"Chainage\",EAST],AXIS[\"Arc length\",NORTH]"),
                "{}",
                tags.plane
            );
        }
    }
    let bands = Tags::of(&wall).metadata;
    for (band, name) in ["red", "green", "blue", "alpha"].into_iter().enumerate() {
        let item = format!("sample=\"{band}\" role=\"description\">{name}<");
        assert!(bands.contains(&item), "no {item} in {bands}");
    }
    let resolution = Tags::of(&maps.join("resolution.tif"));
    assert!(resolution.is_readable());
    let metadata = &resolution.metadata;
    assert!(metadata.contains(">mm</Item>"), "{metadata}");
    assert!(
        Tags::of(&maps.join("frames.tif"))
            .metadata
            .contains("index of the frame")
    );
}
