//! Grey levels of the surfaces of fittings.

use crate::procedural_noise::ValueNoise;
use nalgebra::Vector3;

/// Share of its light that a surface reflects at a grazing angle.
const GRAZING_SHARE: f32 = 0.4;
/// Grey level of a bracket, and of the housing of a lamp.
const METAL_GREY: f32 = 120.0;
/// Grey levels of the glass of a lamp, and of the bars before it.
const GLASS_GREY: [f32; 2] = [245.0, 190.0];
/// Distance between the bars of a lamp, and their width, metres.
const BARS_M: [f64; 2] = [0.05, 0.008];
/// Distance between the marks on a cable, and their length, metres.
const MARKS_M: [f64; 2] = [0.5, 0.03];
/// Grey level of a mark.
const MARK_GREY: f32 = 200.0;

/// Surface of a solid.
#[derive(Clone, Copy, Debug)]
pub(super) enum Finish {
    /// Plastic with scratches, and a mark every half metre.
    Cable {
        /// Mean grey level.
        tone: f32,
        /// Scratches.
        scratches: ValueNoise,
    },
    /// Metal.
    Metal,
    /// Glass with bars on the side with this normal, metal on the others.
    Lamp {
        /// Unit normal of the glass.
        glass: Vector3<f64>,
    },
}

impl Finish {
    /// Grey level at a point whose unit normal and unit direction to the camera are given, where
    /// the wall has the share `light` of the light.
    ///
    /// Surfaces reflect the light as a camera with a lamp beside it sees them: less where they are
    /// seen at a grazing angle. Glass shines by itself.
    pub fn grey(
        &self,
        point: &Vector3<f64>,
        normal: &Vector3<f64>,
        to_camera: &Vector3<f64>,
        light: f32,
    ) -> f32 {
        let facing = normal.dot(to_camera).max(0.0) as f32;
        let lit = light * (GRAZING_SHARE + (1.0 - GRAZING_SHARE) * facing);
        match self {
            Self::Metal => METAL_GREY * lit,
            Self::Lamp { glass } if normal.dot(glass) > 0.5 => {
                let is_bar = point.y.rem_euclid(BARS_M[0]) < BARS_M[1];
                GLASS_GREY[usize::from(is_bar)]
            }
            Self::Lamp { .. } => METAL_GREY * lit,
            Self::Cable { tone, scratches } => {
                let is_mark = point.y.rem_euclid(MARKS_M[0]) < MARKS_M[1];
                let plain = if is_mark { MARK_GREY } else { *tone };
                (plain + scratches.at(point.x - point.z, point.y)).max(0.0) * lit
            }
        }
    }
}
