//! glTF 2.0 in one binary file (GLB).
//!
//! **Axes.** The world has z up at θ = 0, y along the axis, x to the right of whoever looks along
//! it. glTF has y up: a world point (x, y, z) is written as (x, z, −y), a rotation. Blender and 3D
//! Tiles turn it back, so that there coordinates are the world's again.
//!
//! Materials are unlit (`KHR_materials_unlit`): the picture is the wall as the camera saw it. Faces
//! are seen from inside only.

use super::mesh::Mesh;
use crate::PROGRAM;
use crate::surface::WallPoint;
use nalgebra::Vector3;
use serde_json::{Value, json};

/// A mesh and its picture.
#[derive(Debug)]
pub(super) struct Part {
    /// The triangles.
    pub(super) mesh: Mesh,
    /// The picture, a JPEG.
    pub(super) jpeg: Vec<u8>,
    /// Where the picture lies on the wall.
    pub(super) place: Place,
}

/// Where a picture lies on the wall: texture coordinates (u, v) are at `s = s₀ + u Δs`,
/// `h = h₀ + v Δh`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// `s₀` and `h₀`, metres.
    pub(super) corner_m: [f64; 2],
    /// `Δs` and `Δh`, metres.
    pub(super) extent_m: [f64; 2],
}

impl Place {
    fn texture(&self, wall: &WallPoint) -> [f32; 2] {
        let share = |value: f64, k: usize| ((value - self.corner_m[k]) / self.extent_m[k]) as f32;
        [share(wall.s_m, 0), share(wall.h_m, 1)]
    }
}

/// A vector of the world in glTF's axes.
fn y_up<T: nalgebra::Scalar + std::ops::Neg<Output = T> + Copy>(x_w: &Vector3<T>) -> [T; 3] {
    [x_w.x, x_w.z, -x_w.y]
}

// Numbers of the specification.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const LINEAR: u32 = 9729;
const LINEAR_MIPMAP_LINEAR: u32 = 9987;
const CLAMP_TO_EDGE: u32 = 33071;
const MAGIC: &[u8; 4] = b"glTF";
const VERSION: u32 = 2;
const JSON_CHUNK: &[u8; 4] = b"JSON";
const BINARY_CHUNK: &[u8; 4] = b"BIN\0";

/// The binary chunk on its way.
#[derive(Default)]
struct Binary {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Binary {
    /// Adds bytes as a buffer view; its index.
    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        let mut view = json!({
            "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len(),
        });
        if let Some(target) = target {
            view["target"] = target.into();
        }
        self.views.push(view);
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.len() - 1
    }

    /// Adds vectors of `N` numbers; the index of their accessor.
    fn vectors<const N: usize>(&mut self, kind: &str, vectors: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = vectors
            .iter()
            .flatten()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let view = self.view(&bytes, Some(ARRAY_BUFFER));
        let end = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            let each = |k: usize| vectors.iter().map(|v| v[k]).reduce(pick).unwrap_or(0.0);
            (0..N).map(each).collect()
        };
        self.accessors.push(json!({
            "bufferView": view, "componentType": FLOAT, "count": vectors.len(), "type": kind,
            "min": end(f32::min), "max": end(f32::max),
        }));
        self.accessors.len() - 1
    }

    fn indices(&mut self, triangles: &[[u32; 3]]) -> usize {
        let bytes: Vec<u8> = triangles
            .iter()
            .flatten()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let view = self.view(&bytes, Some(ELEMENT_ARRAY_BUFFER));
        self.accessors.push(json!({
            "bufferView": view, "componentType": UNSIGNED_INT, "count": 3 * triangles.len(), "type": "SCALAR",
        }));
        self.accessors.len() - 1
    }
}

/// A GLB of parts, each a node at its own origin. `extras.wall` of a mesh says where its picture
/// lies on the wall.
pub(super) fn glb(parts: &[Part]) -> Vec<u8> {
    let mut binary = Binary::default();
    let (mut nodes, mut meshes, mut materials) = (Vec::new(), Vec::new(), Vec::new());
    let (mut textures, mut images) = (Vec::new(), Vec::new());
    for (k, Part { mesh, jpeg, place }) in parts.iter().enumerate() {
        let positions: Vec<[f32; 3]> = mesh.positions_m.iter().map(y_up).collect();
        let texture: Vec<[f32; 2]> = mesh.wall.iter().map(|wall| place.texture(wall)).collect();
        let position = binary.vectors("VEC3", &positions);
        let texture = binary.vectors("VEC2", &texture);
        let indices = binary.indices(&mesh.triangles);
        let image = binary.view(jpeg, None);
        nodes.push(
            json!({ "name": format!("wall {k}"), "mesh": k, "translation": y_up(&mesh.origin_m) }),
        );
        meshes.push(json!({
            "name": format!("wall {k}"),
            "primitives": [{
                "attributes": { "POSITION": position, "TEXCOORD_0": texture },
                "indices": indices, "material": k,
            }],
            "extras": { "wall": { "corner_m": place.corner_m, "extent_m": place.extent_m } },
        }));
        materials.push(json!({
            "name": format!("wall {k}"),
            "pbrMetallicRoughness": {
                "baseColorTexture": { "index": k }, "metallicFactor": 0.0, "roughnessFactor": 1.0,
            },
            "extensions": { "KHR_materials_unlit": {} },
        }));
        textures.push(json!({ "sampler": 0, "source": k }));
        images.push(
            json!({ "name": format!("wall {k}"), "bufferView": image, "mimeType": "image/jpeg" }),
        );
    }
    let json = json!({
        "asset": { "version": "2.0", "generator": PROGRAM },
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{ "nodes": (0..nodes.len()).collect::<Vec<_>>() }],
        "nodes": nodes, "meshes": meshes, "materials": materials, "textures": textures, "images": images,
        "samplers": [{
            "magFilter": LINEAR, "minFilter": LINEAR_MIPMAP_LINEAR, "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE,
        }],
        "accessors": binary.accessors, "bufferViews": binary.views,
        "buffers": [{ "byteLength": binary.bytes.len() }],
    });
    container(json.to_string().into_bytes(), &binary.bytes)
}

/// The two chunks behind their header.
fn container(mut json: Vec<u8>, binary: &[u8]) -> Vec<u8> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let total = 12 + 8 + json.len() + 8 + binary.len();
    let mut file = Vec::with_capacity(total);
    file.extend_from_slice(MAGIC);
    file.extend_from_slice(&VERSION.to_le_bytes());
    file.extend_from_slice(&(total as u32).to_le_bytes());
    for (kind, chunk) in [(JSON_CHUNK, json.as_slice()), (BINARY_CHUNK, binary)] {
        file.extend_from_slice(&(chunk.len() as u32).to_le_bytes());
        file.extend_from_slice(kind);
        file.extend_from_slice(chunk);
    }
    file
}
