//! The wall in three dimensions: validated by the programs of others, and read back.

use crate::support::{self, blender_survey, fail, json, npm, succeed, text};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

struct Work {
    _dir: tempfile::TempDir,
    glb: PathBuf,
    tiles: PathBuf,
}

/// The fixture, exported once for all tests.
fn work() -> &'static Work {
    static WORK: OnceLock<Work> = OnceLock::new();
    WORK.get_or_init(|| {
        let dir = tempfile::tempdir().expect("a folder");
        let (glb, tiles) = (dir.path().join("wall.glb"), dir.path().join("tiles"));
        let survey = blender_survey();
        let said = succeed(&[
            "export",
            text(&survey),
            "--poses",
            "truth",
            "--px-per-metre",
            "450",
            "--glb",
            text(&glb),
            "--3dtiles",
            text(&tiles),
        ]);
        assert!(
            said.contains("wall.glb") && said.contains("tiles: "),
            "{said}"
        );
        Work {
            _dir: dir,
            glb,
            tiles,
        }
    })
}

/// The JSON and the binary chunk of a GLB.
fn open_glb(path: &Path) -> (Value, Vec<u8>) {
    let bytes = std::fs::read(path).expect("a GLB");
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!(
        (&bytes[..4], word(4), word(8)),
        (&b"glTF"[..], 2, bytes.len())
    );
    let json = &bytes[20..20 + word(12)];
    (
        serde_json::from_slice(json).expect("JSON"),
        bytes[20 + word(12) + 8..].to_vec(),
    )
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect()
}

/// The names in an object, sorted. The schema of 3D Tiles knows no others than those that are asked
/// for here.
fn names(value: &Value) -> Vec<&str> {
    let mut names: Vec<&str> = (value.as_object().unwrap().keys())
        .map(String::as_str)
        .collect();
    names.sort_unstable();
    names
}

/// World coordinates of all vertices of a GLB, metres.
fn vertices(path: &Path) -> Vec<[f64; 3]> {
    let (json, binary) = open_glb(path);
    let mut all = Vec::new();
    for node in json["nodes"].as_array().unwrap() {
        let origin = numbers(&node["translation"]);
        assert!(origin.iter().all(|v| v.fract() == 0.0), "{origin:?}");
        let mesh = &json["meshes"][node["mesh"].as_u64().unwrap() as usize];
        let accessor = &json["accessors"][mesh["primitives"][0]["attributes"]["POSITION"]
            .as_u64()
            .unwrap() as usize];
        let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let (from, count) = (
            view["byteOffset"].as_u64().unwrap() as usize,
            accessor["count"].as_u64().unwrap() as usize,
        );
        let floats = binary[from..from + 12 * count]
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes(b.try_into().unwrap()));
        let floats: Vec<f64> = floats.map(f64::from).collect();
        for v in floats.chunks_exact(3) {
            let [x, y, z] = [0, 1, 2].map(|k| v[k] + origin[k]);
            // glTF's y is up: the world's z.
            all.push([x, -z, y]);
        }
    }
    all
}

fn files_below(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files_below(&path, extension));
        } else if path.extension().is_some_and(|e| e == extension) {
            found.push(path);
        }
    }
    found
}

#[test]
fn khronos_finds_nothing_wrong() {
    let Some(modules) = npm::find() else {
        return;
    };
    let mut files = files_below(&work().tiles, "glb");
    assert!(files.len() > 60, "{}", files.len());
    files.push(work().glb.clone());
    let mut arguments = vec![text(&modules)];
    arguments.extend(files.iter().map(|path| text(path)));
    assert_eq!(npm::node("gltf.mjs", &arguments).trim(), "[]");
}

/// Runs the validator of 3D Tiles; not every registry has it, so `CI` does not require it.
#[test]
fn the_validator_of_3d_tiles_finds_nothing_wrong() {
    let Some(validator) =
        npm::find().map(|modules| modules.join("3d-tiles-validator/build/main.js"))
    else {
        return;
    };
    if !validator.is_file() {
        eprintln!("skipped: 3d-tiles-validator is missing");
        return;
    }
    let tileset = work().tiles.join("tileset.json");
    let output = std::process::Command::new("node")
        .arg(validator)
        .args(["--tilesetFile", text(&tileset)])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("\"numErrors\": 0"), "{said}");
}

#[test]
fn every_vertex_lies_on_the_wall_and_they_go_all_around() {
    let all = vertices(&work().glb);
    for [x, y, z] in &all {
        assert!((x.hypot(*z) - 3.0).abs() < 1e-6, "{x} {y} {z}");
    }
    let ends = |k: usize| {
        all.iter()
            .map(|v| v[k])
            .fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)))
    };
    for k in [0, 2] {
        let (low, high) = ends(k);
        assert!((low + 3.0).abs() < 1e-6 && (high - 3.0).abs() < 1e-6);
    }
    let (start, end) = ends(1);
    assert!(
        (start + 1.727).abs() < 1e-2 && (end - 6.880).abs() < 1e-2,
        "{start} {end}"
    );
}

/// A walk through the tree, as a program does that streams it. Every tile lies in its box, boxes in
/// those above, errors fall, and the finest tiles cover the wall once: neighbours have the same
/// vertices where they meet.
#[test]
fn the_tree_holds_together() {
    let folder = &work().tiles;
    let mut leaves = Vec::new();
    let mut seen = BTreeSet::new();
    let read = |name: &str| -> Value {
        let file = json(&folder.join(name));
        assert_eq!(names(&file), ["asset", "geometricError", "root"]);
        assert_eq!(names(&file["asset"]), ["extras", "version"]);
        assert_eq!(file["asset"]["version"], "1.1");
        // No less than the error of its root, which is drawn instead of nothing.
        assert!(file["geometricError"].as_f64() >= file["root"]["geometricError"].as_f64());
        file
    };
    let root = read("tileset.json");
    let error = root["geometricError"].as_f64().unwrap();
    let mut open = vec![(root["root"].clone(), error, None::<Vec<f64>>)];
    while let Some((tile, error_above, box_above)) = open.pop() {
        let mut keys = names(&tile);
        keys.retain(|name| *name != "children");
        assert_eq!(
            keys,
            ["boundingVolume", "content", "geometricError", "refine"]
        );
        assert_eq!(names(&tile["boundingVolume"]), ["box"]);
        assert_eq!(names(&tile["content"]), ["uri"]);
        let bounds = numbers(&tile["boundingVolume"]["box"]);
        assert_eq!(bounds.len(), 12);
        // Half axes are those of the world, and none is flat.
        for (k, value) in bounds[3..].iter().enumerate() {
            assert!(if k % 4 == 0 {
                *value > 0.0
            } else {
                *value == 0.0
            });
        }
        let range = |b: &[f64], k: usize| (b[k] - b[3 + 4 * k], b[k] + b[3 + 4 * k]);
        if let Some(above) = &box_above {
            for k in 0..3 {
                let ((low, high), (low_above, high_above)) = (range(&bounds, k), range(above, k));
                assert!(low >= low_above - 1e-9 && high <= high_above + 1e-9);
            }
        }
        let error = tile["geometricError"].as_f64().unwrap();
        assert!(error <= error_above);
        assert_eq!(tile["refine"], "REPLACE");
        let uri = tile["content"]["uri"].as_str().unwrap();
        if uri.ends_with(".json") {
            // A file in a tile's place: the same tile again.
            open.push((read(uri)["root"].clone(), error, Some(bounds)));
            continue;
        }
        assert!(seen.insert(uri.to_owned()), "{uri} twice");
        for vertex in vertices(&folder.join(uri)) {
            for k in 0..3 {
                let (low, high) = range(&bounds, k);
                assert!((low..=high).contains(&vertex[k]), "{uri}: {vertex:?}");
            }
        }
        match tile["children"].as_array() {
            Some(children) => {
                assert!(error > 0.0 && (1..=4).contains(&children.len()));
                open.extend(
                    children
                        .iter()
                        .map(|child| (child.clone(), error, Some(bounds.clone()))),
                );
            }
            None => {
                assert_eq!(error, 0.0);
                leaves.push(uri.to_owned());
            }
        }
    }
    assert_eq!(seen.len(), files_below(folder, "glb").len());
    assert_eq!(
        files_below(folder, "json").len(),
        3,
        "the top, and one for each of the two tiles of level 4"
    );
    // At full resolution: each vertex belongs to as many tiles as meet there.
    let mut corners = Corners::default();
    for leaf in &leaves {
        for vertex in vertices(&folder.join(leaf)) {
            corners.add(vertex);
        }
    }
    let chainages = corners.places.values().map(|(vertex, _)| vertex[1]);
    let (first, last) = chainages.fold((f64::MAX, f64::MIN), |(a, b), h| (a.min(h), b.max(h)));
    assert!(corners.places.len() > 1000);
    for (vertex, count) in corners.places.values() {
        // A straight tunnel has vertices at the tiles' upper and lower borders only: there two rows
        // of tiles meet, and four tiles at their corners.
        let inner = (first + 1e-3..last - 1e-3).contains(&vertex[1]);
        let expected = if inner { [2, 4] } else { [1, 2] };
        assert!(expected.contains(count), "{vertex:?}: {count}");
    }
}

/// Points that are the same within what single precision rounds, and how often each came.
#[derive(Default)]
struct Corners {
    /// By millimetres.
    places: BTreeMap<[i64; 3], ([f64; 3], usize)>,
}

impl Corners {
    fn add(&mut self, vertex: [f64; 3]) {
        let cell = vertex.map(|v| (v * 1e3).round() as i64);
        let around = (0..27).map(|k| {
            [
                cell[0] + k % 3 - 1,
                cell[1] + k / 3 % 3 - 1,
                cell[2] + k / 9 - 1,
            ]
        });
        for key in around {
            if let Some((known, count)) = self.places.get_mut(&key)
                && (0..3).all(|k| (known[k] - vertex[k]).abs() < 1e-6)
            {
                *count += 1;
                return;
            }
        }
        self.places.insert(cell, (vertex, 1));
    }
}

#[test]
fn wrong_usage_says_what_is_wanted() {
    let survey = blender_survey();
    let message = fail(&["export", text(&survey)], 2);
    assert!(message.contains("--glb"), "{message}");
    let message = fail(&["export", text(&survey), "--glb", "wall.gltf"], 2);
    assert!(message.contains(".glb"), "{message}");
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("thesis.txt"), "all of it").unwrap();
    let message = fail(&["export", text(&survey), "--3dtiles", text(dir.path())], 2);
    assert!(message.contains("name another folder"), "{message}");
    assert_eq!(support::entries(dir.path()), 1);
}

#[test]
fn a_page_of_refined_poses_wants_poses() {
    if npm::is_viewer_missing() {
        return;
    }
    let survey = blender_survey();
    let dir = tempfile::tempdir().unwrap();
    let message = fail(
        &[
            "export",
            text(&survey),
            "--web",
            text(&dir.path().join("w")),
            "--layers",
            "refined",
        ],
        2,
    );
    assert!(message.contains("--poses"), "{message}");
    assert_eq!(support::entries(dir.path()), 0);
}
