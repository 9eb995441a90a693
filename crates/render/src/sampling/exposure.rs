//! Exposure of the frames, and its removal.
//!
//! A frame i shows `I = a_i V(u, v) S + b_i` of the evenly lit wall S: gain a and bias b are the
//! frame's own, V is the light that moves with the camera: a shading that all frames have in common
//! and, if there is evidence for one, a lamp that lights the wall by its distance ([`LightModel`],
//! as `refine` models it). They are calibrated by wall points all over the panorama
//! ([`tunnelstitch_photometry`]), with nothing known beforehand: `a = e^α`, `b = β`.
//!
//! A common factor of gains and wall cannot be observed. It is fixed twice over: the shading is 1
//! where it is brightest, and the gains are 1 in the (geometric) mean.

use super::patch_light::PatchLight;
use super::photometric_samples::observe_points;
use super::point_batch::PointBatch;
use super::sample::Sample;
use super::thumbnails::Thumbnails;
use crate::layout::canvas::Canvas;
use crate::layout::placement::Placement;
use crate::warp::patches::PATCH_SCALE;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use tunnelstitch_core::frames::CameraLight;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::numerics::significance::FALSE_ALARM_RATE;
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;
use tunnelstitch_geometry::surface::Surface;
use tunnelstitch_geometry::trajectory::Pose;
use tunnelstitch_photometry::{LightModel, Observation, ObservedPoint, light_frames};

/// Wall points a frame.
const POINTS_PER_FRAME: usize = 40;
/// Wall points at the least.
const MIN_POINTS: usize = 20_000;
/// Memory of a wall point in a frame while exposures are solved, bytes. Measured on 12,000 frames.
const OBSERVATION_BYTES: f64 = 96.0;

/// The exposure of all frames.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Exposure {
    frames: Vec<FrameExposure>,
    light: LightTables,
    /// Full scale of the frames over 255.
    scale: f32,
}

/// Exposure of one frame: `I = a V S + b`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FrameExposure {
    /// Gain a.
    pub gain: f64,
    /// Bias b, grey levels of 255.
    pub bias: f64,
}

impl Exposure {
    /// Frames that stay as they are.
    pub fn none(frames: usize) -> Self {
        let own = FrameExposure {
            gain: 1.0,
            bias: 0.0,
        };
        Self {
            frames: vec![own; frames],
            light: LightTables::default(),
            scale: 1.0,
        }
    }

    /// The exposures that make frames agree where they overlap.
    ///
    /// `white`: full scale of the frames' samples.
    pub fn solve(
        surface: &dyn Surface,
        thumbnails: &Thumbnails,
        placements: &[Placement],
        canvas: &Canvas,
        white: f32,
    ) -> Self {
        let count = placements.len();
        let grid = grid_of_points(canvas, count);
        let points = observe_points(surface, thumbnails, placements, &grid);
        let poses: Vec<Pose> = placements.iter().map(|placement| placement.pose).collect();
        let start = first_light(surface, thumbnails.full_size(), &points, &poses);
        let found = start.refined(&points, &poses, start.lamp.is_some());
        let Some((light, found)) = found else {
            return Self {
                scale: white / 255.0,
                ..Self::none(count)
            };
        };
        let light = light.over(surface, thumbnails.full_cameras(), &poses);
        let mean_log = found.log_gains.iter().sum::<f64>() / count as f64;
        let own = found.log_gains.iter().zip(&found.biases);
        let frames = own.map(|(log_gain, bias)| FrameExposure {
            gain: (log_gain - mean_log).exp(),
            bias: *bias,
        });
        Self {
            frames: frames.collect(),
            light: LightTables::new(&light),
            scale: white / 255.0,
        }
    }

    /// Memory of [`Exposure::solve`] beside that of the thumbnails, bytes.
    pub fn solve_bytes(placements: &[Placement], canvas: &Canvas) -> u64 {
        let points_per_m = grid_of_points(canvas, placements.len()).px_per_metre;
        let area_m2 = |placement: &Placement| {
            let footprint = &placement.footprint;
            (footprint.s_max_m - footprint.s_min_m) * (footprint.h_max_m - footprint.h_min_m)
        };
        let area_m2: f64 = placements.iter().map(area_m2).sum();
        ((OBSERVATION_BYTES + size_of::<Observation>() as f64)
            * points_per_m
            * points_per_m
            * area_m2) as u64
    }

    /// Memory of a light that differs from frame to frame, bytes.
    pub fn light_bytes(frames: usize) -> u64 {
        (frames * NODES.0 * NODES.1 * size_of::<f32>()) as u64
    }

    /// The frames' gains and biases.
    pub fn frames(&self) -> &[FrameExposure] {
        &self.frames
    }

    /// The response of a frame, which undoes its exposure.
    pub fn of(&self, frame: usize) -> Response<'_> {
        let FrameExposure { gain, bias } = self.frames[frame];
        Response {
            gain: (1.0 / gain) as f32,
            bias: bias as f32 * self.scale,
            light: self.light.of(frame),
        }
    }

    /// The exposure of the thumbnails of the same frames, which are 16 bits deep.
    pub fn of_thumbnails(&self, thumbnails: &Thumbnails) -> Self {
        Self {
            frames: self.frames.clone(),
            light: self.light.of_thumbnails(thumbnails),
            scale: u16::WHITE / 255.0,
        }
    }
}

/// The light of pictures of `size` before any shading is known: even, or that of a lamp, if the
/// middle frames give evidence for one.
fn first_light(
    surface: &dyn Surface,
    size: (usize, usize),
    points: &[ObservedPoint],
    poses: &[Pose],
) -> LightModel {
    let even = LightModel::even(size);
    let middle = light_frames(poses.len());
    let seen = points.iter().map(|point| point.by(&middle));
    let seen: Vec<ObservedPoint> = seen.filter(|point| point.seen.len() > 1).collect();
    let lit = even.with_lamp(&seen, &poses[middle], surface, FALSE_ALARM_RATE);
    LightModel {
        lamp: lit.and_then(|(light, _)| light.lamp),
        ..even
    }
}

/// The wall points by which so many frames are compared.
fn grid_of_points(canvas: &Canvas, frames: usize) -> Canvas {
    canvas.coarser((POINTS_PER_FRAME * frames).max(MIN_POINTS))
}

/// Undoes the exposure of one frame: `S = (I − b)/(a V)`.
#[derive(Clone, Copy, Debug)]
pub struct Response<'a> {
    gain: f32,
    bias: f32,
    light: Option<&'a Table>,
}

impl Response<'_> {
    /// True if there is nothing to undo.
    pub fn is_none(&self) -> bool {
        self.light.is_none() && self.gain == 1.0 && self.bias == 0.0
    }

    /// The bias, which is taken away before values are multiplied by the light.
    pub fn bias(&self) -> f32 {
        self.bias
    }

    /// The factor of values over a patch, by the pixels at which its ends and middles appear in the
    /// frame; `None` if there is nothing to undo.
    pub fn light(&self, pixels: impl FnOnce() -> [[[f32; 2]; 3]; 3]) -> Option<PatchLight> {
        if self.is_none() {
            return None;
        }
        let Some(table) = self.light else {
            return Some(PatchLight::even(self.gain));
        };
        let at = |[u, v]: [f32; 2]| self.gain * table.at(u, v);
        Some(PatchLight::through(pixels().map(|row| row.map(at))))
    }

    /// Undoes the exposure in the values of some columns of a run that lie in one row of a patch;
    /// `first`: the column where the patch begins.
    pub fn undo_by(
        &self,
        light: &PatchLight,
        row: usize,
        batch: &mut PointBatch,
        first: usize,
        columns: Range<usize>,
    ) {
        let [a, b, c] = light.row(row);
        let bias = self.bias;
        let values = &mut batch.values_mut()[columns.clone()];
        dispatch_simd(
            #[inline(always)]
            || {
                for (column, value) in columns.clone().zip(values.iter_mut()) {
                    let x = (column - first) as f32 * PATCH_SCALE - 1.0;
                    let factor = (c * x + b) * x + a;
                    for value in value {
                        *value = (*value - bias) * factor;
                    }
                }
            },
        );
    }

    /// Undoes the exposure in some of the values of a run by the pixels at which its points appear.
    pub fn undo(&self, batch: &mut PointBatch, columns: Range<usize>) {
        if self.is_none() {
            return;
        }
        let (u, v, seen, values) = batch.parts();
        let Some(table) = self.light else {
            for value in values[columns].as_flattened_mut() {
                *value = self.undone(*value, self.gain);
            }
            return;
        };
        let last_column = columns.end.saturating_sub(1);
        dispatch_simd(
            #[inline(always)]
            || {
                // Light changes so slowly that it is looked up at the ends of short steps only.
                for start in columns.clone().step_by(STEP) {
                    let end = (start + STEP).min(columns.end);
                    let last = end.min(last_column);
                    if seen[start] && seen[last] {
                        let first = self.gain * table.at(u[start], v[start]);
                        let change = self.gain * table.at(u[last], v[last]) - first;
                        let slope = change / (last - start).max(1) as f32;
                        for (k, value) in values[start..end].iter_mut().enumerate() {
                            let factor = first + k as f32 * slope;
                            for value in value {
                                *value = self.undone(*value, factor);
                            }
                        }
                    } else {
                        let places = u[start..end].iter().zip(&v[start..end]);
                        for (value, (u, v)) in values[start..end].iter_mut().zip(places) {
                            let factor = self.gain * table.at(*u, *v);
                            for value in value {
                                *value = self.undone(*value, factor);
                            }
                        }
                    }
                }
            },
        );
    }

    /// The value of the evenly lit wall for one of the frame at a pixel.
    pub fn wall(&self, value: f32, u: f32, v: f32) -> f32 {
        let light = self.light.map_or(1.0, |table| table.at(u, v));
        self.undone(value, self.gain * light)
    }

    #[inline(always)]
    fn undone(&self, value: f32, factor: f32) -> f32 {
        (value - self.bias) * factor
    }
}

/// Points of a run between which light is taken for linear.
const STEP: usize = 8;

/// Nodes of [`Table`] across and down.
const NODES: (usize, usize) = (65, 49);

/// `1/V` over every frame.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct LightTables {
    /// One of each frame, or one that all have in common; none if the light is even.
    tables: Vec<Table>,
}

impl LightTables {
    /// The tables of a light whose shading is to be 1 where it is brightest.
    fn new(light: &CameraLight) -> Self {
        let brightest = light.shading.range()[1].ln();
        let count = (light.lamp.as_ref()).map_or(1, |(_, falloffs)| falloffs.len());
        let table = |frame| {
            Table::new(light.shading.size(), |at| {
                (brightest - light.log_at(frame, at)).exp()
            })
        };
        Self {
            tables: (0..count).par_map(table),
        }
    }

    /// The table of a frame.
    fn of(&self, frame: usize) -> Option<&Table> {
        self.tables.get(frame).or(self.tables.first())
    }

    /// The tables of the thumbnails of the same frames.
    fn of_thumbnails(&self, thumbnails: &Thumbnails) -> Self {
        let tables = self.tables.iter().cloned().map(|table| Table {
            offset: table.scale.map(|s| s * thumbnails.full(0.0)),
            scale: table.scale.map(|s| s * thumbnails.scale()),
            ..table
        });
        Self {
            tables: tables.collect(),
        }
    }
}

/// `1/V` at nodes spread over a picture; bilinear between them.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Table {
    values: Vec<f32>,
    /// Nodes per pixel across and down.
    scale: [f32; 2],
    /// Position of the first pixel's centre, nodes.
    offset: [f32; 2],
}

impl Table {
    /// Tabulates `inverse`, the factor that undoes the light at a pixel, over pictures of `size`.
    fn new(size: (usize, usize), inverse: impl Fn(&Vector2<f64>) -> f64 + Copy) -> Self {
        let last = |size: usize| (size.max(2) - 1) as f64;
        let pixel =
            |k: usize, nodes: usize, size: usize| k as f64 / (nodes - 1) as f64 * last(size);
        let values = (0..NODES.1).flat_map(|j| {
            (0..NODES.0).map(move |i| {
                let at = Vector2::new(pixel(i, NODES.0, size.0), pixel(j, NODES.1, size.1));
                inverse(&at) as f32
            })
        });
        let scale = |nodes: usize, size: usize| ((nodes - 1) as f64 / last(size)) as f32;
        Self {
            values: values.collect(),
            scale: [scale(NODES.0, size.0), scale(NODES.1, size.1)],
            offset: [0.0; 2],
        }
    }

    #[inline(always)]
    fn at(&self, u: f32, v: f32) -> f32 {
        // Points that are not seen may be anywhere: the casts saturate, and what comes out is not
        // used.
        let x = u * self.scale[0] + self.offset[0];
        let y = v * self.scale[1] + self.offset[1];
        let (i, j) = ((x as usize).min(NODES.0 - 2), (y as usize).min(NODES.1 - 2));
        let (s, t) = (x - i as f32, y - j as f32);
        let nodes = &self.values[j * NODES.0 + i..][..NODES.0 + 2];
        let upper = nodes[0] + s * (nodes[1] - nodes[0]);
        let lower = nodes[NODES.0] + s * (nodes[NODES.0 + 1] - nodes[NODES.0]);
        upper + t * (lower - upper)
    }
}
