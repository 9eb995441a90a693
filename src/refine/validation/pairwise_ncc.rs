//! Do frames that show the same wall show the same thing?
//!
//! Gauss–Newton ends in a minimum, not always the right one; neighbours may agree with each other
//! and not with the turn before. So once all frames are placed, every pair that overlaps is
//! compared on the wall: local contrast of the one against that of the other. Right pairs correlate
//! as well as the texture lets them, wrong ones do not, and a low residual fused from several
//! frames cannot hide it.

use crate::refine::model::context::EstimationContext;
use crate::refine::model::frame_states::FrameStates;
use crate::refine::model::problem_error::ProblemError;
use crate::refine::model::rejection::RejectionReason;
use crate::refine::tiles::residual_weighting::robust_correlation;
use crate::refine::tracking::reference_mosaic::{
    MosaicGrid, NccScore, UnwrappedFrame, pixel_size_m,
};
use crate::refine::validation::overlaps::{Batch, Overlaps};
use crate::surface::Footprint;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Least samples that two frames share, as a share of the lattice over one.
const LEAST_OVERLAP: f64 = 0.03;
/// Correlation, noise aside, that a right pair reaches.
const LEAST_QUALITY: f64 = 0.6;
/// Share of what two frames share that must be left without what stands out of it, for the rest to
/// speak for them.
const LEAST_LEFT: f64 = 0.5;
/// One above this is not asked for that of most samples.
const SURE_QUALITY: f64 = 0.85;
/// Share of its weight that may contradict before a frame is doubted.
const MOST_CONTRADICTION: f64 = 0.15;
/// A blurred frame has less than this share of the others' fine contrast (variance).
const LEAST_SHARPNESS: f64 = 0.5;

/// Two frames compared where they overlap.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    /// The earlier frame.
    pub a: usize,
    /// The later one.
    pub b: usize,
    /// Wall samples both show.
    pub samples: f64,
    /// True if they cannot show the same wall.
    pub wrong: bool,
    /// Correlation of local contrast there, noise aside.
    pub quality: f64,
    /// Variance of the earlier frame's finest detail over the later one's there, gains removed;
    /// None where noise drowns it.
    pub sharpness: Option<f64>,
}

/// Compares those of a run of frames that are inliers and overlap: at pyramid level `level`, in
/// windows that hold a brick or two, and in finest detail.
///
/// The first tells whether they show the same wall; finest detail only where the first is drowned
/// by noise, for of a pattern it is edges alone, and they coincide wherever the pattern does,
/// whatever is between them. Where two frames do not show the same wall, they are looked at once
/// more without what stands out of it: water is dark in one and glints in the other, and on a faint
/// wall a few such patches in a strip are all that is compared. Two frames contradict unless the
/// wall between agrees; where little of it is left they neither agree nor contradict.
///
/// # Errors
/// [`ProblemError`].
pub fn compute_pairwise_ncc(
    scene: &EstimationContext,
    level: usize,
    tracked: &FrameStates,
    frames: &Range<usize>,
) -> Result<Vec<Pair>, ProblemError> {
    let any = |_, _| true;
    let coarse = Comparison { level, ..COARSE };
    let fine = Comparison {
        level: FINE.level.min(level),
        ..FINE
    };
    let of_coarse = compare_at(scene, coarse, tracked, frames, &any)?;
    let of_fine = by_pair(compare_at(scene, fine, tracked, frames, &any)?);
    let mut pairs: Vec<Pair> = of_coarse
        .into_iter()
        .filter_map(|coarse| {
            let fine = of_fine.get(&(coarse.a, coarse.b));
            let fine_quality = fine.and_then(|fine| fine.quality);
            let quality = coarse.quality.or(fine_quality)?;
            Some(Pair {
                a: coarse.a,
                b: coarse.b,
                samples: coarse.samples,
                wrong: quality < LEAST_QUALITY,
                quality,
                sharpness: fine_quality.and(fine.map(|fine| fine.sharpness)),
            })
        })
        .collect();
    let wrong = pairs.iter().filter(|pair| pair.wrong);
    let wrong: BTreeSet<(usize, usize)> = wrong.map(|pair| (pair.a, pair.b)).collect();
    if wrong.is_empty() {
        return Ok(pairs);
    }
    let usual = Comparison {
        all: false,
        ..coarse
    };
    let again = |a, b| wrong.contains(&(a, b));
    let of_usual = by_pair(compare_at(scene, usual, tracked, frames, &again)?);
    // Where little is left, and that agrees, the pair says nothing.
    pairs.retain_mut(|pair| match of_usual.get(&(pair.a, pair.b)) {
        Some(usual) if usual.quality.is_some_and(|q| q >= LEAST_QUALITY) => {
            pair.wrong = false;
            usual.samples >= LEAST_LEFT * pair.samples
        }
        _ => true,
    });
    Ok(pairs)
}

fn by_pair(compared: Vec<Compared>) -> BTreeMap<(usize, usize), Compared> {
    let compared = compared.into_iter();
    compared.map(|one| ((one.a, one.b), one)).collect()
}

/// How frames are compared.
#[derive(Clone, Copy, Debug)]
struct Comparison {
    /// Pyramid level.
    level: usize,
    /// Every how many pixels a wall sample is taken, along each axis.
    stride: usize,
    /// Half width of the window of local contrast, pixels.
    window: usize,
    /// All that they show, or the usual alone.
    all: bool,
}

const COARSE: Comparison = Comparison {
    level: 2,
    stride: 4,
    window: 6,
    all: true,
};
const FINE: Comparison = Comparison {
    level: 1,
    stride: 5,
    window: 3,
    all: true,
};

/// Two frames compared in one way.
struct Compared {
    a: usize,
    b: usize,
    samples: f64,
    quality: Option<f64>,
    sharpness: f64,
}

/// Compares the pairs that are `wanted`.
fn compare_at(
    scene: &EstimationContext,
    comparison: Comparison,
    tracked: &FrameStates,
    frames: &Range<usize>,
    wanted: &(dyn Fn(usize, usize) -> bool + Sync),
) -> Result<Vec<Compared>, ProblemError> {
    let Comparison {
        level,
        stride,
        window,
        all,
    } = comparison;
    let camera = scene.camera.at_level(level);
    let overlaps = Overlaps::of(scene, &camera, tracked, frames)?;
    let mut pairs = Vec::new();
    let mut unwrapped_frames: BTreeMap<usize, UnwrappedFrame> = BTreeMap::new();
    for Batch { partners, needed } in overlaps.batches(wanted) {
        // What the batch before has left is not made again.
        unwrapped_frames.retain(|k, _| needed.binary_search(k).is_ok());
        let made: Vec<(usize, UnwrappedFrame)> = needed
            .into_par_iter()
            .filter(|k| !unwrapped_frames.contains_key(k))
            .map(|k| {
                let sweep = tracked.sweep(scene, k);
                Ok((
                    k,
                    UnwrappedFrame::fine(scene, level, k, &sweep, window, all)?,
                ))
            })
            .collect::<Result<_, ProblemError>>()?;
        unwrapped_frames.extend(made);
        let compared: Vec<Vec<Compared>> = partners
            .par_iter()
            .map(|(a, others)| {
                compare(
                    scene,
                    *a,
                    others,
                    stride,
                    &overlaps.footprints,
                    &unwrapped_frames,
                    tracked,
                )
            })
            .collect();
        pairs.extend(compared.into_iter().flatten());
    }
    Ok(pairs)
}

fn compare(
    scene: &EstimationContext,
    a: usize,
    others: &[usize],
    stride: usize,
    footprints: &[Option<Footprint>],
    unwrapped_frames: &BTreeMap<usize, UnwrappedFrame>,
    tracked: &FrameStates,
) -> Vec<Compared> {
    let (Some(own), Some(footprint)) = (unwrapped_frames.get(&a), &footprints[a]) else {
        return Vec::new();
    };
    let pose = &tracked.estimates[a].pose;
    let lattice = MosaicGrid::over(
        footprint,
        stride as f64 * pixel_size_m(scene, own.camera(), pose),
    );
    let points = lattice.points(scene);
    let origin = points[points.len() / 2];
    let gain = |k: usize| tracked.estimates[k].log_gain.exp();
    let sampler = own.at(scene, pose, &origin);
    let seen: Vec<([f32; 3], (f32, f32, f32))> = points
        .iter()
        .enumerate()
        .filter(|(k, _)| !scene.ignored.contains(&lattice.wall(*k)))
        .filter_map(|(_, x_w)| {
            let offset = x_w - origin;
            let point = [offset.x as f32, offset.y as f32, offset.z as f32];
            Some((point, sampler.contrast_and_detail(&point)?))
        })
        .collect();
    let least = LEAST_OVERLAP * seen.len() as f64;
    others
        .iter()
        .filter_map(|b| {
            let unwrapped = unwrapped_frames.get(b)?;
            let pose = &tracked.estimates[*b].pose;
            let sampler = unwrapped.at(scene, pose, &origin);
            let mut ncc_score = NccScore::default();
            let (mut own_detail, mut other_detail) = (0.0f64, 0.0f64);
            let mut shared = Vec::with_capacity(seen.len());
            for (point, (x, noise_x, own)) in &seen {
                if let Some((y, noise_y, other)) = sampler.contrast_and_detail(point) {
                    ncc_score.add((*x, *noise_x), (y, noise_y));
                    shared.push((*x, y));
                    own_detail += f64::from(*own).powi(2);
                    other_detail += f64::from(other).powi(2);
                }
            }
            let exposure = gain(*b) / gain(a);
            (ncc_score.samples >= least).then(|| Compared {
                a,
                b: *b,
                samples: ncc_score.samples,
                quality: quality(&ncc_score, &shared),
                sharpness: exposure * exposure * own_detail / other_detail.max(f64::MIN_POSITIVE),
            })
        })
        .collect()
}

/// Correlation of the textures behind the noise, of all samples or of most, whichever is greater: a
/// few glints outweigh a faint wall.
fn quality(ncc_score: &NccScore, shared: &[(f32, f32)]) -> Option<f64> {
    let of_all = ncc_score.match_quality()?;
    if of_all > SURE_QUALITY {
        return Some(of_all);
    }
    let of_most = robust_correlation(shared) / ncc_score.texture();
    Some(of_all.max(of_most.min(1.0)))
}

/// The frames that contradict the rest, worst first.
///
/// Frames are taken out one by one, always the one with the largest share of its overlap in pairs
/// that do not match, until no frame contradicts the others by more than a little. Pairs count by
/// their samples.
pub fn find_contradictions(pairs: &[Pair], frames: usize) -> Vec<(usize, RejectionReason)> {
    let (mut all, mut bad) = (vec![0.0; frames], vec![0.0; frames]);
    let mut of_frame: Vec<Vec<usize>> = vec![Vec::new(); frames];
    for (k, pair) in pairs.iter().enumerate() {
        for frame in [pair.a, pair.b] {
            all[frame] += pair.samples;
            if pair.wrong {
                bad[frame] += pair.samples;
            }
            of_frame[frame].push(k);
        }
    }
    let mut out = vec![false; frames];
    let mut rejections = Vec::new();
    loop {
        let worst = (0..frames)
            .filter(|k| !out[*k] && bad[*k] > MOST_CONTRADICTION * all[*k])
            .max_by(|a, b| (bad[*a] / all[*a]).total_cmp(&(bad[*b] / all[*b])));
        let Some(worst) = worst else {
            return rejections;
        };
        out[worst] = true;
        let mut against = (worst, 1.0);
        for pair in of_frame[worst].iter().map(|k| &pairs[*k]) {
            let other = if pair.a == worst { pair.b } else { pair.a };
            if out[other] {
                continue;
            }
            all[other] -= pair.samples;
            if pair.wrong {
                bad[other] -= pair.samples;
                if pair.quality < against.1 {
                    against = (other, pair.quality);
                }
            }
        }
        rejections.push((
            worst,
            RejectionReason::Contradicts {
                frame: against.0,
                correlation: against.1,
            },
        ));
    }
}

/// The frames that show less fine detail than those they overlap.
pub fn find_blurred_frames(pairs: &[Pair], frames: usize) -> Vec<(usize, RejectionReason)> {
    let mut ratios: Vec<Vec<f64>> = vec![Vec::new(); frames];
    for (pair, sharpness) in pairs.iter().filter_map(|p| Some((p, p.sharpness?))) {
        ratios[pair.a].push(sharpness);
        ratios[pair.b].push(1.0 / sharpness);
    }
    ratios
        .into_iter()
        .enumerate()
        .filter_map(|(frame, mut ratios)| {
            ratios.sort_unstable_by(f64::total_cmp);
            let share = *ratios.get(ratios.len() / 2)?;
            (share < LEAST_SHARPNESS).then_some((frame, RejectionReason::Blurred { share }))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::{FrameCache, GreyImage, Pyramid};
    use crate::refine::test_scene::{frame_states, independent_prior, test_context};
    use crate::surface::{GaugeMotion, WallPoint};
    use crate::test_wall::{TestWall, waves};
    use crate::trajectory::Pose;

    /// Bricks around.
    const BRICKS: f64 = 60.0;

    /// Bricks of tones of their own, 10 × 6 cm, between light joints of 1 cm.
    fn bricks(wall: WallPoint, perimeter_m: f64) -> f64 {
        let (x, y) = (BRICKS * wall.s_m / perimeter_m, wall.h_m / 0.06);
        let of_brick = |x: f64, joint: f64| x.rem_euclid(1.0) > joint;
        if !of_brick(x, 0.1) || !of_brick(y, 0.17) {
            return 160.0;
        }
        let brick = 12.9898 * x.floor().rem_euclid(BRICKS) + 78.233 * y.floor();
        90.0 + 80.0 * (43758.5453 * brick.sin()).rem_euclid(1.0)
    }

    /// Pairs of these frames.
    fn compared(wall: &TestWall, pictures: Vec<GreyImage>, poses: &[Pose]) -> Vec<Pair> {
        let pyramids = pictures.into_iter().map(|frame| Pyramid::new(frame, 1));
        let frames = FrameCache::of_pyramids(pyramids.collect());
        let prior = independent_prior(poses);
        let scene = test_context(wall, &frames, &prior);
        let tracked = frame_states(poses);
        compute_pairwise_ncc(&scene, 0, &tracked, &(0..poses.len())).unwrap()
    }

    #[test]
    fn true_poses_show_the_same_wall() {
        let wall = TestWall::ring(bricks);
        let pairs = compared(&wall, wall.frames(), &wall.poses);
        assert!(pairs.len() >= 14);
        for pair in pairs {
            assert!(!pair.wrong && pair.quality > 0.8, "{pair:?}");
        }
    }

    /// All joints lie on joints.
    #[test]
    fn a_frame_a_brick_off_does_not_show_the_same_wall() {
        let wall = TestWall::ring(bricks);
        let mut poses = wall.poses.clone();
        let brick = GaugeMotion::about_y(std::f64::consts::TAU / BRICKS, 0.0);
        poses[5] = brick.apply(&poses[5]);
        let pairs = compared(&wall, wall.frames(), &poses);
        assert!(pairs.iter().filter(|p| p.a == 5 || p.b == 5).count() >= 2);
        for pair in pairs {
            assert_eq!(pair.wrong, pair.a == 5 || pair.b == 5, "{pair:?}");
        }
    }

    /// Dark in some frames and bright in others, with the wall between as it is.
    #[test]
    fn what_stands_out_of_the_wall_does_not_contradict() {
        let faint =
            |wall: WallPoint, perimeter_m: f64| 128.0 + 0.1 * (waves(wall, perimeter_m) - 128.0);
        let wall = TestWall::ring(faint);
        let mut pictures = wall.frames();
        for (k, picture) in pictures.iter_mut().enumerate() {
            let (w, glint) = (picture.width(), if k % 2 == 0 { 240.0 } else { 20.0 });
            for (n, value) in picture.data_mut().iter_mut().enumerate() {
                if (n % w + 7 * k) % 40 < 6 && (n / w) % 30 < 6 {
                    *value = glint;
                }
            }
        }
        let pairs = compared(&wall, pictures, &wall.poses);
        // Of a strip hardly wider than what stands out nothing is left to look at.
        let wide = || pairs.iter().filter(|pair| pair.samples > 80.0);
        assert!(dispatch_simd().any(|pair| pair.quality < LEAST_QUALITY));
        for pair in dispatch_simd() {
            assert!(!pair.wrong, "{pair:?}");
        }
    }

    fn pair(a: usize, b: usize, quality: f64) -> Pair {
        Pair {
            a,
            b,
            samples: 100.0,
            quality,
            wrong: quality < LEAST_QUALITY,
            sharpness: Some(1.0),
        }
    }

    #[test]
    fn one_wrong_frame_is_taken_out_and_its_neighbours_stay() {
        let mut pairs = Vec::new();
        for a in 0..8usize {
            for b in a + 1..(a + 4).min(8) {
                let wrong = a == 5 || b == 5;
                pairs.push(pair(a, b, if wrong { 0.2 } else { 0.9 }));
            }
        }
        let rejections = find_contradictions(&pairs, 8);
        assert_eq!(rejections.len(), 1);
        assert_eq!(rejections[0].0, 5);
        assert!(find_contradictions(&pairs[..1], 8).is_empty());
    }

    #[test]
    fn the_frame_without_fine_detail_is_the_blurred_one() {
        let mut pairs = vec![pair(0, 1, 0.9), pair(1, 2, 0.9), pair(0, 2, 0.9)];
        (pairs[0].sharpness, pairs[1].sharpness) = (Some(5.0), Some(0.2));
        let blurred = find_blurred_frames(&pairs, 3);
        assert_eq!(blurred.len(), 1);
        assert_eq!(blurred[0].0, 1);
    }
}
