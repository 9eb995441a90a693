//! Tests of static pixels on pictures cut from a random wall.

use super::{MotionCell, MotionField, StaticPixels, TemporalStatistics, find_static_pixels};
use crate::frames::grey::GreyImage;
use crate::frames::mask::Mask;
use crate::frames::static_pixels::ridges::smoothed;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const WIDTH: usize = 160;
const HEIGHT: usize = 120;
/// Motion from frame to frame, pixels.
const STEP: [usize; 2] = [23, 3];
const FRAMES: usize = 24;

/// Frames of a wall that moves, or repeats itself with the step, each changed by `change` at the
/// pixels (u, v).
fn frames(seed: u64, repeats: bool, change: impl Fn(usize, usize, f32) -> f32) -> Vec<GreyImage> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let size = [WIDTH + FRAMES * STEP[0], HEIGHT + FRAMES * STEP[1]];
    let noise = (0..size[0] * size[1]).map(|_| rng.random_range(-1.0f32..1.0));
    let wall = smoothed(&GreyImage::new(size[0], size[1], noise.collect()), 2);
    let picture = |frame: usize, noise: &mut ChaCha8Rng| {
        let value = |k: usize| {
            let (u, v) = (k % WIDTH, k / WIDTH);
            let at = if repeats {
                [u % STEP[0], v]
            } else {
                [u + frame * STEP[0], v + frame * STEP[1]]
            };
            let grey = 90.0 + 80.0 * wall.at(at[0], at[1]);
            change(u, v, grey) + noise.random_range(-2.0f32..2.0)
        };
        GreyImage::new(WIDTH, HEIGHT, (0..WIDTH * HEIGHT).map(value).collect())
    };
    (0..FRAMES).map(|frame| picture(frame, &mut rng)).collect()
}

fn find(pictures: Vec<GreyImage>) -> StaticPixels {
    let cell = MotionCell {
        direction: [1.0, 0.0],
        rms: [STEP[0] as f64 / WIDTH as f64, 0.0],
    };
    let motion = MotionField::new(1, 1, vec![Some(cell)]);
    let statistics = TemporalStatistics::new([WIDTH, HEIGHT], pictures, None).unwrap();
    assert_eq!(statistics.frames(), FRAMES);
    find_static_pixels(&statistics, &motion)
}

/// Shares of the pixels of `truth` that are hidden, and of all others.
fn shares(found: &StaticPixels, truth: impl Fn(usize, usize) -> bool) -> [f64; 2] {
    let StaticPixels::Found(mask) = found else {
        panic!("{found:?}");
    };
    let (mut hidden, mut all) = ([0.0; 2], [0.0; 2]);
    for (u, v, pixel) in mask.picture().enumerate_pixels() {
        let kind = usize::from(!truth(u as usize, v as usize));
        all[kind] += 1.0;
        hidden[kind] += f64::from(pixel.0[0] == 0);
    }
    [hidden[0] / all[0], hidden[1] / all[1]]
}

/// Strokes of three pixels, six apart, in a line.
fn is_letter(u: usize, v: usize) -> bool {
    (20..80).contains(&u) && (90..104).contains(&v) && u % 6 < 3
}

#[test]
fn a_moving_wall_has_none_under_any_smooth_shading() {
    for seed in 0..12 {
        let shading = |u: usize, v: usize, grey: f32| {
            let (x, y) = (
                u as f32 / WIDTH as f32 - 0.4,
                v as f32 / HEIGHT as f32 - 0.6,
            );
            grey * (1.0 - 1.2 * (x * x + y * y))
        };
        assert_eq!(
            find(frames(seed, false, |_, _, grey| grey)),
            StaticPixels::Absent
        );
        assert_eq!(find(frames(seed, false, shading)), StaticPixels::Absent);
    }
}

#[test]
fn letters_and_the_gaps_between_them_are_hidden() {
    let burnt = |u, v, grey| if is_letter(u, v) { 250.0 } else { grey };
    let found = find(frames(1, false, burnt));
    let [letters, others] = shares(&found, is_letter);
    assert!(letters > 0.99 && others < 0.04, "{letters} {others}");
}

#[test]
fn dark_soft_spots_are_hidden() {
    let distance = |u: usize, v: usize| (u as f32 - 60.0).hypot(v as f32 - 40.0);
    let spot = |u, v, grey| grey * (1.0 - 0.5 * (-(distance(u, v) / 5.0).powi(2)).exp());
    let found = find(frames(2, false, spot));
    let [dark, others] = shares(&found, |u, v| distance(u, v) < 5.0);
    assert!(dark > 0.95 && others < 0.02, "{dark} {others}");
}

#[test]
fn black_corners_and_bars_are_hidden_as_a_whole() {
    let is_black = |u: usize, v: usize| v < 14 || (u as f32 - 80.0).hypot(v as f32 - 60.0) > 92.0;
    let black = |u, v, grey| if is_black(u, v) { 3.0 } else { grey };
    let found = find(frames(3, false, black));
    let [hidden, others] = shares(&found, is_black);
    assert!(hidden > 0.93 && others < 0.04, "{hidden} {others}");
}

#[test]
fn a_wall_that_repeats_with_the_step_is_recognised() {
    let found = find(frames(4, true, |_, _, grey| grey));
    assert_eq!(found, StaticPixels::WallRepeats);
}

#[test]
fn wide_frames_are_halved_and_their_masks_are_not() {
    let wide = |frame: &GreyImage| {
        let value = |k: usize| frame.at(k % (4 * WIDTH) / 4, k / (4 * WIDTH) / 4);
        let data = (0..16 * WIDTH * HEIGHT).map(value);
        GreyImage::new(4 * WIDTH, 4 * HEIGHT, data.collect())
    };
    let burnt = |u, v, grey| if is_letter(u, v) { 250.0 } else { grey };
    let pictures: Vec<GreyImage> = frames(5, false, burnt).iter().map(wide).collect();
    let small: Vec<GreyImage> = pictures
        .into_iter()
        .map(TemporalStatistics::reduce)
        .collect();
    assert_eq!(small[0].width(), 2 * WIDTH);
    let cell = MotionCell {
        direction: [1.0, 0.0],
        rms: [0.1, 0.0],
    };
    let motion = MotionField::new(1, 1, vec![Some(cell)]);
    let size = [4 * WIDTH, 4 * HEIGHT];
    let statistics = TemporalStatistics::new(size, small.clone(), None).unwrap();
    let found = find_static_pixels(&statistics, &motion);
    let [letters, others] = shares(&found, |u, v| is_letter(u / 4, v / 4));
    assert!(letters > 0.99 && others < 0.04, "{letters} {others}");
    // What a mask hides already is not found again.
    let wall: Vec<bool> = (0..size[0] * size[1])
        .map(|k| k / size[0] < 4 * 88)
        .collect();
    let mask = std::sync::Arc::new(Mask::new(size[0], size[1], &wall));
    let statistics = TemporalStatistics::new(size, small, Some(&mask)).unwrap();
    assert_eq!(
        find_static_pixels(&statistics, &motion),
        StaticPixels::Absent
    );
}
