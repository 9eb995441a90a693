//! Motion of the wall in the pictures of a single camera, by the initial poses.

use super::open::Survey;
use crate::frames::{MotionCell, MotionField};
use nalgebra::Vector2;
use rayon::prelude::*;
use tunnelstitch_geometry::numerics::median::upper_median;
use tunnelstitch_geometry::trajectory::Pose;

/// Columns and rows of the field's cells.
const FIELD: [usize; 2] = [32, 24];
/// Columns and rows of the pixels whose motion chooses the frames.
const PROBES: [usize; 2] = [8, 6];
/// Smallest motion from one chosen frame to the next, median over the probes, share of the width.
const MIN_STEP: f64 = 0.025;
/// Largest number of chosen frames.
const MAX_FRAMES: usize = 64;
/// Part of a step by which motion is measured, so that the wall point stays in sight.
const PART: f64 = 0.125;

impl Survey {
    /// Chooses frames, spread over the survey, between which the wall moves in the picture, and the
    /// motion between them.
    pub(super) fn moving_frames(&self) -> (Vec<usize>, MotionField) {
        let poses = self.initial_poses();
        let probes = self.grid_pixels(PROBES);
        let mut chosen = vec![0];
        for (frame, pose) in poses.iter().enumerate().skip(1) {
            let last = chosen.last().map_or(0, |last| *last);
            let motion = probes
                .iter()
                .filter_map(|pixel| self.motion(pixel, &poses[last], pose));
            let sizes = motion.map(|[u, v]| u.hypot(v)).collect();
            if upper_median(sizes).is_some_and(|size| size >= MIN_STEP) {
                chosen.push(frame);
            }
        }
        let count = chosen.len().min(MAX_FRAMES);
        let chosen: Vec<usize> = (0..count)
            .map(|k| chosen[k * chosen.len() / count])
            .collect();
        let cells = self.grid_pixels(FIELD).into_par_iter().map(|pixel| {
            let pairs = chosen.windows(2);
            let motion = pairs.filter_map(|p| self.motion(&pixel, &poses[p[0]], &poses[p[1]]));
            MotionCell::of_displacements(motion)
        });
        let field = MotionField::new(FIELD[0], FIELD[1], cells.collect());
        (chosen, field)
    }

    /// Middles of the cells of a grid over the picture, row-major.
    fn grid_pixels(&self, [columns, rows]: [usize; 2]) -> Vec<Vector2<f64>> {
        let middle = |k: usize, of: usize, px: u32| (k as f64 + 0.5) / of as f64 * f64::from(px);
        let [width, height] = self.cameras.size();
        let pixel = |k: usize| {
            Vector2::new(
                middle(k % columns, columns, width) - 0.5,
                middle(k / columns, rows, height) - 0.5,
            )
        };
        (0..columns * rows).map(pixel).collect()
    }

    /// Motion of the wall at a pixel from one pose to the other, shares of the picture's width,
    /// extrapolated from a part of the way; None where no wall is seen.
    fn motion(&self, pixel: &Vector2<f64>, from: &Pose, to: &Pose) -> Option<[f64; 2]> {
        let camera = self.cameras.of(0);
        let ray = from.r_wc * camera.ray(pixel.x, pixel.y)?;
        let x_w = self.surface.hit(&from.t_wc, &ray).ok()?.x_w;
        let on_the_way = from.retract(&(from.local(to) * PART));
        let moved = camera.project(&on_the_way.to_camera(&x_w))? - pixel;
        Some([moved.x, moved.y].map(|px| px / (PART * f64::from(camera.width))))
    }
}
