//! Encoding of meshes and textures as binary glTF 2.0 (GLB).
//!
//! **Axes.** The world has z up at θ = 0, y along the axis, and x to the right when looking along
//! it. glTF has y up, so a world point (x, y, z) is written as (x, z, −y), which is a rotation.
//! Blender and 3D Tiles invert it and show world coordinates.
//!
//! Materials are unlit (`KHR_materials_unlit`), since the texture contains the illumination. Faces
//! are visible from inside only.

use crate::inspect::mesh::Mesh;
use crate::surface::WallPoint;
use nalgebra::Vector3;
use serde_json::{Value, json};
use tunnelstitch_core::PROGRAM;

/// Mesh of a piece of the wall with its texture.
#[derive(Debug)]
pub(super) struct WallPart {
    /// Triangles of the piece.
    pub(super) mesh: Mesh,
    /// Texture, a JPEG.
    pub(super) jpeg: Vec<u8>,
    /// Extent of the texture on the wall.
    pub(super) extent: TextureExtent,
}

/// Extent of a texture on the wall.
///
/// Texture coordinates (u, v) are at `s = s₀ + u Δs`, `h = h₀ + v Δh`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TextureExtent {
    /// `s₀` and `h₀`, metres.
    pub(super) corner_m: [f64; 2],
    /// `Δs` and `Δh`, metres.
    pub(super) extent_m: [f64; 2],
}

impl TextureExtent {
    /// Texture coordinates of a wall point.
    fn texture_coordinates(&self, wall: &WallPoint) -> [f32; 2] {
        let share = |value: f64, k: usize| ((value - self.corner_m[k]) / self.extent_m[k]) as f32;
        [share(wall.s_m, 0), share(wall.h_m, 1)]
    }
}

/// Converts a world vector to glTF's axes.
fn to_y_up<T: nalgebra::Scalar + std::ops::Neg<Output = T> + Copy>(x_w: &Vector3<T>) -> [T; 3] {
    [x_w.x, x_w.z, -x_w.y]
}

// Constants of the glTF specification.
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

/// Binary chunk under construction, with its buffer views and accessors.
#[derive(Default)]
struct Binary {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Binary {
    /// Adds bytes as a buffer view and returns its index.
    fn add_view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
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

    /// Adds vectors of `N` numbers and returns the index of their accessor.
    fn add_vectors<const N: usize>(&mut self, kind: &str, vectors: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = vectors
            .iter()
            .flatten()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let view = self.add_view(&bytes, Some(ARRAY_BUFFER));
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

    /// Adds triangle indices and returns the index of their accessor.
    fn add_indices(&mut self, triangles: &[[u32; 3]]) -> usize {
        let bytes: Vec<u8> = triangles
            .iter()
            .flatten()
            .flat_map(|v| v.to_le_bytes())
            .collect();
        let view = self.add_view(&bytes, Some(ELEMENT_ARRAY_BUFFER));
        self.accessors.push(json!({
            "bufferView": view, "componentType": UNSIGNED_INT,
            "count": 3 * triangles.len(), "type": "SCALAR",
        }));
        self.accessors.len() - 1
    }
}

/// Encodes parts as a GLB, each a node with its own origin.
///
/// `extras.wall` of a mesh is the extent of its texture on the wall.
pub(super) fn encode_glb(parts: &[WallPart]) -> Vec<u8> {
    let mut binary = Binary::default();
    let (mut nodes, mut meshes, mut materials) = (Vec::new(), Vec::new(), Vec::new());
    let (mut textures, mut images) = (Vec::new(), Vec::new());
    for (k, WallPart { mesh, jpeg, extent }) in parts.iter().enumerate() {
        let positions: Vec<[f32; 3]> = mesh.positions_m.iter().map(to_y_up).collect();
        let texture: Vec<[f32; 2]> = mesh
            .wall
            .iter()
            .map(|wall| extent.texture_coordinates(wall))
            .collect();
        let position = binary.add_vectors("VEC3", &positions);
        let texture = binary.add_vectors("VEC2", &texture);
        let indices = binary.add_indices(&mesh.triangles);
        let image = binary.add_view(jpeg, None);
        nodes.push(json!({
            "name": format!("wall {k}"), "mesh": k, "translation": to_y_up(&mesh.origin_m),
        }));
        meshes.push(json!({
            "name": format!("wall {k}"),
            "primitives": [{
                "attributes": { "POSITION": position, "TEXCOORD_0": texture },
                "indices": indices, "material": k,
            }],
            "extras": { "wall": { "corner_m": extent.corner_m, "extent_m": extent.extent_m } },
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
        "nodes": nodes, "meshes": meshes,
        "materials": materials, "textures": textures, "images": images,
        "samplers": [{
            "magFilter": LINEAR, "minFilter": LINEAR_MIPMAP_LINEAR,
            "wrapS": CLAMP_TO_EDGE, "wrapT": CLAMP_TO_EDGE,
        }],
        "accessors": binary.accessors, "bufferViews": binary.views,
        "buffers": [{ "byteLength": binary.bytes.len() }],
    });
    assemble(json.to_string().into_bytes(), &binary.bytes)
}

/// Assembles the header and the two chunks of a GLB.
fn assemble(mut json: Vec<u8>, binary: &[u8]) -> Vec<u8> {
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
