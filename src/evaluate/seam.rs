//! How well the frames agree where they overlap, without any truth.

use crate::render::{Canvas, EDGE, FrameStack, Interpolation, Kernel, Placement, tiles};
use crate::surface::Surface;
use rayon::prelude::*;
use serde::Serialize;

/// Grey differences between frames at the same wall points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SeamResidual {
    /// Root mean square difference of two frames at a wall point, grey levels.
    pub rms_grey: f64,
    /// Wall points that at least two frames see.
    pub points: usize,
    /// Frames that see such a point, on average.
    pub frames_per_point: f64,
}

/// Wall points looked at, at most about this many.
const POINTS: usize = 300_000;

/// Distance from the outermost pixel centres within which a frame is not asked, pixels.
const MARGIN_PX: f64 = 1.0;

/// The seam residual of placed frames on the wall of `canvas`; `None` if no two frames overlap.
///
/// At each point x of a square grid on the wall, the mean square difference over the pairs of the n frames
/// that see it is `2/(n−1) Σ (I_i(x) − Ī(x))²`; the result is the root of its mean over the points with
/// n ≥ 2. With true poses what remains is noise, light and interpolation.
///
/// `frames` (those that are held) and `placements` in the same order; pictures sampled bilinearly, luma of colour.
pub fn seam_residual(
    surface: &dyn Surface,
    frames: &FrameStack,
    placements: &[Placement],
    canvas: &Canvas,
) -> Option<SeamResidual> {
    let grid = canvas.coarser(POINTS);
    let camera = frames.camera();
    let bilinear = Kernel::new(Interpolation::Bilinear, 1.0);
    let bands = tiles(surface, &grid, placements, EDGE);
    // Collected before they are added: the sum does not depend on the threads.
    let parts: Vec<Sums> = bands
        .par_iter()
        .flatten()
        .map(|tile| {
            let points = tile.points(surface, &grid);
            let mut seen = vec![Seen::default(); points.len()];
            for frame in &tile.frames {
                let Some(picture) = frames.picture(*frame) else {
                    continue;
                };
                let pose = &placements[*frame].pose;
                let camera = placements[*frame].camera(camera);
                for (x_w, seen) in points.iter().zip(&mut seen) {
                    let pixel = camera
                        .project(&pose.to_camera(x_w))
                        .filter(|pixel| camera.sees(pixel, MARGIN_PX));
                    if let Some(pixel) = pixel {
                        seen.add(f64::from(picture.grey(&pixel, &bilinear)));
                    }
                }
            }
            let mut sums = Sums::default();
            for seen in seen.iter().filter(|seen| seen.count >= 2.0) {
                sums.squares += 2.0 * seen.squares / (seen.count - 1.0);
                sums.points += 1;
                sums.frames += seen.count;
            }
            sums
        })
        .collect();
    let mut total = Sums::default();
    for part in parts {
        total.squares += part.squares;
        total.points += part.points;
        total.frames += part.frames;
    }
    (total.points > 0).then(|| {
        let points = total.points as f64;
        SeamResidual {
            rms_grey: (total.squares / points).sqrt(),
            points: total.points,
            frames_per_point: total.frames / points,
        }
    })
}

/// Running count, mean and sum of squares about the mean (Welford).
#[derive(Clone, Copy, Default)]
struct Seen {
    count: f64,
    mean: f64,
    squares: f64,
}

impl Seen {
    fn add(&mut self, value: f64) {
        self.count += 1.0;
        let delta = value - self.mean;
        self.mean += delta / self.count;
        self.squares += delta * (value - self.mean);
    }
}

#[derive(Default)]
struct Sums {
    squares: f64,
    points: usize,
    frames: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::{Picture, place};
    use crate::test_wall::{TestWall, waves};
    use crate::trajectory::Shutter;

    #[test]
    fn true_poses_leave_rounding_noise_and_wrong_ones_much_more() {
        let wall = TestWall::ring(waves);
        let stack = wall.stack();
        let residual = |poses: &[crate::trajectory::Pose]| {
            let placements = place(&wall.circle, &wall.camera, poses, &Shutter::default()).unwrap();
            let canvas = Canvas::of_placements(&wall.circle, &placements, 60.0).unwrap();
            seam_residual(&wall.circle, &stack, &placements, &canvas).unwrap()
        };
        let truth = residual(&wall.poses);
        assert!(truth.rms_grey < 0.6, "{truth:?}");
        assert!(truth.frames_per_point >= 2.0 && truth.points > 10_000);
        let mut wrong = wall.poses.clone();
        wrong[4].t_wc.y += 0.05;
        assert!(residual(&wrong).rms_grey > 3.0 * truth.rms_grey);
    }

    #[test]
    fn two_flat_frames_differ_by_their_difference() {
        let wall = TestWall::one(waves);
        let (w, h) = (wall.camera.width as usize, wall.camera.height as usize);
        let flat = |value| Picture::new(w, h, 1, vec![value; w * h]);
        let poses = vec![wall.poses[0]; 3];
        let placements = place(&wall.circle, &wall.camera, &poses, &Shutter::default()).unwrap();
        let canvas = Canvas::of_placements(&wall.circle, &placements, 60.0).unwrap();
        let of = |values: &[u8]| {
            let pictures: Vec<Picture> = values.iter().map(|value| flat(*value)).collect();
            let stack = FrameStack::from_pictures(wall.camera, pictures);
            seam_residual(&wall.circle, &stack, &placements[..values.len()], &canvas)
        };
        assert!((of(&[100, 106]).unwrap().rms_grey - 6.0).abs() < 1e-4);
        // Pairs: 6, 6, 0.
        let three = of(&[100, 106, 106]).unwrap();
        assert!((three.rms_grey - 24f64.sqrt()).abs() < 1e-4);
        assert_eq!(three.frames_per_point, 3.0);
        assert_eq!(of(&[100]), None);
    }
}
