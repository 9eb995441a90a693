//! Tests of the readers on small files.

use super::{PointCount, PointsError, read_points};
use ::las::{Builder, Point, Transform, Vector, Writer};
use nalgebra::Vector3;
use std::path::{Path, PathBuf};

/// The points of every file, whole thousandths.
const POINTS: [[f64; 3]; 3] = [[1.5, -2.25, 3.0], [0.125, 40.5, -0.5], [-3.0, 7.0, 0.0]];

/// Reads a file with a name and a content.
fn read(name: &str, content: &[u8]) -> Result<(PointCount, Vec<[f64; 3]>), PointsError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, content).unwrap();
    read_path(&path)
}

fn read_path(path: &Path) -> Result<(PointCount, Vec<[f64; 3]>), PointsError> {
    let mut points = Vec::new();
    let count = read_points(path, &mut |point: Vector3<f64>| points.push(point.into()))?;
    Ok((count, points))
}

/// Checks that a file has [`POINTS`].
fn assert_points(name: &str, content: &[u8]) {
    let (count, points) = read(name, content).unwrap();
    assert_eq!(count, PointCount { read: 3, empty: 0 }, "{name}");
    assert_eq!(points, POINTS, "{name}");
}

/// Checks that a file is refused with an error that contains some texts.
fn assert_refused(name: &str, content: &[u8], texts: &[&str]) {
    let error = read(name, content).unwrap_err().to_string();
    for text in texts {
        assert!(error.contains(text), "{name}: {error}");
    }
}

fn text_of(points: &[[f64; 3]], separator: &str, more: &str) -> String {
    let line = |[x, y, z]: &[f64; 3]| format!("{x}{separator}{y}{separator}{z}{more}\n");
    points.iter().map(line).collect()
}

#[test]
fn text_has_points_headers_and_comments() {
    assert_points("a.xyz", text_of(&POINTS, " ", "").as_bytes());
    assert_points(
        "a.pts",
        format!("3\n{}", text_of(&POINTS, " ", " 255 0 0")).as_bytes(),
    );
    let csv = format!(
        "# scan\nx,y,z,intensity\n{}",
        text_of(&POINTS, ",", ",0.5 # last")
    );
    assert_points("a.csv", csv.as_bytes());
    assert_points("A.TXT", text_of(&POINTS, "; ", "\r").as_bytes());
}

#[test]
fn lines_of_text_that_are_no_points_are_named() {
    assert_refused("a.xyz", b"1 2 3\n4 5\n", &["a.xyz:2:", "x y z"]);
    assert_refused("a.xyz", b"x y z\nx y z\n1 2 3\n", &["a.xyz:2:"]);
    assert_refused("a.xyz", b"1 2 3\n\n1 NaN 3\n", &["a.xyz:3:", "finite"]);
    assert_refused("a.xyz", b"1 2 1e300\n", &["a.xyz:1:", "finite"]);
    assert_refused("a.xyz", b"# nothing\n", &["no points"]);
    assert_refused("a.xyz", &vec![b'1'; 1 << 17], &["a.xyz:1:", "longer"]);
}

#[test]
fn other_files_are_refused() {
    assert_refused("a.e57", b"", &["a.e57", ".laz"]);
    let missing = PathBuf::from("nowhere/a.ply");
    assert!(
        read_path(&missing)
            .unwrap_err()
            .to_string()
            .contains("nowhere/a.ply: cannot be read")
    );
}

fn ply_header(format: &str, count: usize) -> String {
    format!(
        "ply\nformat {format} 1.0\ncomment made by a test\nelement vertex {count}\n\
         property float x\nproperty uchar red\nproperty double y\nproperty float z\n\
         element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
}

fn binary_ply(points: &[[f64; 3]], big: bool) -> Vec<u8> {
    let order = if big { "big" } else { "little" };
    let mut bytes = ply_header(&format!("binary_{order}_endian"), points.len()).into_bytes();
    for [x, y, z] in points {
        let (x, z) = (*x as f32, *z as f32);
        if big {
            bytes.extend(
                x.to_be_bytes()
                    .into_iter()
                    .chain([7])
                    .chain(y.to_be_bytes()),
            );
            bytes.extend(z.to_be_bytes());
        } else {
            bytes.extend(
                x.to_le_bytes()
                    .into_iter()
                    .chain([7])
                    .chain(y.to_le_bytes()),
            );
            bytes.extend(z.to_le_bytes());
        }
    }
    bytes
}

fn text_ply(points: &[[f64; 3]]) -> String {
    let line = |[x, y, z]: &[f64; 3]| format!("{x} 7 {y} {z}\n");
    let lines: String = points.iter().map(line).collect();
    ply_header("ascii", points.len()) + &lines
}

#[test]
fn ply_is_read_as_text_and_in_both_byte_orders() {
    assert_points("a.ply", (text_ply(&POINTS) + "3 0 1 2\n").as_bytes());
    for big in [false, true] {
        let mut bytes = binary_ply(&POINTS, big);
        bytes.extend([1, 0, 0, 0, 0]);
        assert_points("a.ply", &bytes);
    }
}

#[test]
fn damaged_ply_is_refused() {
    let bytes = binary_ply(&POINTS, false);
    assert_refused("a.ply", &bytes[..bytes.len() - 3], &["point 3", "copy"]);
    let text = text_ply(&POINTS);
    let cut = text.trim_end().rsplit_once('\n').unwrap().0.to_owned() + "\n";
    assert_refused("a.ply", cut.as_bytes(), &["a.ply:14:", "ends"]);
    let bad = text.replace("7 40.5", "7 x");
    assert_refused("a.ply", bad.as_bytes(), &["a.ply:13:"]);
    let half = [POINTS[0], [1.0, f64::NAN, 2.0]];
    assert_refused("a.ply", &binary_ply(&half, true), &["point 2", "finite"]);
    assert_refused("a.ply", b"plywood", &["header"]);
    let no_z = text.replace("float z", "float w");
    assert_refused("a.ply", no_z.as_bytes(), &["no property z"]);
}

#[test]
fn points_without_a_measurement_are_counted() {
    let points = [POINTS[0], [f64::NAN; 3], POINTS[2]];
    for (name, content) in [
        ("a.ply", binary_ply(&points, false)),
        ("a.pcd", pcd(&points, "ascii")),
        ("a.pcd", pcd(&points, "binary")),
    ] {
        let (count, read) = read(name, &content).unwrap();
        assert_eq!(count, PointCount { read: 2, empty: 1 });
        assert_eq!(read, [POINTS[0], POINTS[2]]);
    }
}

/// A file with the fields x (4 bytes), two normals (8 bytes), y (8 bytes) and z (4 bytes).
fn pcd(points: &[[f64; 3]], data: &str) -> Vec<u8> {
    let n = points.len();
    let mut bytes = format!(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x normal y z\nSIZE 4 4 8 4\nTYPE F F F F\n\
         COUNT 1 2 1 1\nWIDTH {n}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA {data}\n"
    )
    .into_bytes();
    let x = |[x, _, _]: &[f64; 3]| (*x as f32).to_le_bytes();
    let z = |[_, _, z]: &[f64; 3]| (*z as f32).to_le_bytes();
    match data {
        "ascii" => {
            let line = |[x, y, z]: &[f64; 3]| format!("{x} 0 1 {y} {z}\n");
            bytes.extend(points.iter().map(line).collect::<String>().into_bytes());
        }
        "binary" => {
            for point in points {
                bytes.extend(x(point).into_iter().chain([9; 8]));
                bytes.extend(point[1].to_le_bytes().into_iter().chain(z(point)));
            }
        }
        _ => {
            let mut block: Vec<u8> = points.iter().flat_map(x).collect();
            block.extend(points.iter().flat_map(|_| [9; 8]));
            block.extend(points.iter().flat_map(|point| point[1].to_le_bytes()));
            block.extend(points.iter().flat_map(z));
            let runs = block.chunks(32).map(|run| (run.len() as u8 - 1, run));
            let packed: Vec<u8> = runs
                .flat_map(|(control, run)| std::iter::once(control).chain(run.iter().copied()))
                .collect();
            bytes.extend((packed.len() as u32).to_le_bytes());
            bytes.extend((block.len() as u32).to_le_bytes());
            bytes.extend(packed);
        }
    }
    bytes
}

#[test]
fn pcd_is_read_in_all_encodings() {
    for data in ["ascii", "binary", "binary_compressed"] {
        assert_points("a.pcd", &pcd(&POINTS, data));
    }
}

#[test]
fn damaged_pcd_is_refused() {
    let bad = [POINTS[0], [1.0, f64::INFINITY, 2.0]];
    for (data, place) in [
        ("ascii", "a.pcd:13:"),
        ("binary", "point 2"),
        ("binary_compressed", "point 2"),
    ] {
        assert_refused("a.pcd", &pcd(&bad, data), &[place, "finite"]);
        let whole = pcd(&POINTS, data);
        let cut = &whole[..whole.len() - 7];
        assert!(read("a.pcd", cut).is_err(), "{data}");
    }
    let binary = pcd(&POINTS, "binary");
    assert_refused("a.pcd", &binary[..binary.len() - 30], &["point 2", "copy"]);
    let text = String::from_utf8(pcd(&POINTS, "ascii")).unwrap();
    for (from, to, named) in [
        ("DATA ascii", "DATA zip", "a.pcd:11:"),
        ("FIELDS x", "FIELDS u", "fields x, y and z"),
        ("TYPE F F F F", "TYPE F F I F", "field y"),
        ("COUNT 1 2 1 1", "COUNT 1 2 1", "different"),
        ("POINTS 3", "POINTS many", "a.pcd:10:"),
        ("DATA ascii", "", "header"),
    ] {
        assert_refused("a.pcd", text.replace(from, to).as_bytes(), &[named]);
    }
    let compressed = pcd(&POINTS, "binary_compressed");
    let at = compressed.len() - 78;
    let mut huge = compressed.clone();
    huge[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(read("a.pcd", &huge).is_err());
}

fn las(name: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let mut builder = Builder::from((1, 4));
    builder.point_format.is_compressed = name.ends_with("laz");
    let axis = Transform {
        scale: 0.001,
        offset: 0.0,
    };
    builder.transforms = Vector {
        x: axis,
        y: axis,
        z: axis,
    };
    let header = builder.into_header().unwrap();
    let mut writer = Writer::from_path(&path, header).unwrap();
    for [x, y, z] in POINTS {
        let point = Point {
            x,
            y,
            z,
            ..Point::default()
        };
        writer.write_point(point).unwrap();
    }
    writer.close().unwrap();
    (folder, path)
}

#[test]
fn las_and_laz_are_read() {
    for name in ["a.las", "a.laz"] {
        let (_folder, path) = las(name);
        let (count, points) = read_path(&path).unwrap();
        assert_eq!(count.read, 3);
        for (read, point) in points.iter().zip(&POINTS) {
            assert!(
                (0..3).all(|k| (read[k] - point[k]).abs() < 1e-9),
                "{read:?}"
            );
        }
    }
}

#[test]
fn damaged_las_is_refused() {
    for name in ["a.las", "a.laz"] {
        let (_folder, path) = las(name);
        let content = std::fs::read(&path).unwrap();
        for keep in [100, content.len() - 20] {
            let error = read(name, &content[..keep]).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
        // A scale that is no number gives no finite coordinates.
        let mut bad = content.clone();
        bad[131..139].copy_from_slice(&f64::NAN.to_le_bytes());
        assert!(read(name, &bad).is_err(), "{name}");
    }
}
