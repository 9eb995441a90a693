//! The pose of one frame of reference in another, through the frames between them.
//!
//! Transforms form a forest: each frame has one parent. From both frames the way leads up to the
//! first frame that they share; `T = T_up(fixed)⁻¹ T_up(frame)`, each `T_up` the product of the
//! transforms on the way, child to parent. At a time, a transform is the interpolation on SE(3)
//! between its two stamps around it ([`se3::between`]); a static one holds always.

use super::pose::Pose;
use super::se3;
use std::collections::{BTreeMap, HashSet};

/// Most transforms that an error message names.
const MAX_NAMED: usize = 30;

/// The transforms of one frame to another over time, at least one.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Motion {
    /// One that does not change.
    Static(Pose),
    /// One for each of some times, seconds, which increase.
    Moving(Vec<(f64, Pose)>),
}

impl Motion {
    /// The transform at a time within its stamps; [`None`] beyond them, or between two that are
    /// turned too far from each other.
    fn at(&self, time_s: f64) -> Option<Pose> {
        let stamped = match self {
            Self::Static(pose) => return Some(*pose),
            Self::Moving(stamped) => stamped,
        };
        let after = stamped.partition_point(|(stamp_s, _)| *stamp_s < time_s);
        let (next_s, next) = stamped.get(after)?;
        if *next_s == time_s {
            return Some(*next);
        }
        let (last_s, last) = stamped.get(after.checked_sub(1)?)?;
        se3::between(last, next, (time_s - last_s) / (next_s - last_s))
    }
}

/// Transforms by the names of child and parent.
pub(super) struct TransformTree(pub BTreeMap<(String, String), Motion>);

/// A transform on the way from one frame to another.
struct Step<'a> {
    child: &'a str,
    parent: &'a str,
    motion: &'a Motion,
}

impl TransformTree {
    /// The poses of a frame in a fixed one, at the stamps of all moving transforms between them
    /// that lie within all of these.
    ///
    /// # Errors
    /// A frame that is not there; no way between the two, with the link that is missing; a loop; a
    /// frame with two parents; only static transforms; moving ones without a common time; two
    /// transforms of a link that are turned too far from each other. All in words.
    pub fn poses(&self, fixed: &str, frame: &str) -> Result<Vec<(f64, Pose)>, String> {
        for name in [fixed, frame] {
            self.check_name(name)?;
        }
        let (mut down, mut up) = (self.way_up(fixed)?, self.way_up(frame)?);
        let (top_of_fixed, top) = (top(fixed, &down), top(frame, &up));
        if top_of_fixed != top {
            return Err(format!(
                "there is no way from {frame} to {fixed}: from {frame} it ends at {top}, from \
                 {fixed} at {top_of_fixed}, and no transform links the two; {}",
                self.listed()
            ));
        }
        // Beyond the first frame that they share, both go the same way.
        while let (Some(a), Some(b)) = (down.last(), up.last())
            && a.child == b.child
        {
            down.pop();
            up.pop();
        }
        let times_s = common_times(&down, &up)?;
        let at = |way: &[Step], time_s: f64| {
            way.iter().try_fold(Pose::identity(), |pose, step| {
                let motion = step.motion.at(time_s).ok_or_else(|| turned(step, time_s))?;
                Ok::<Pose, String>(motion.after(&pose))
            })
        };
        let pose = |time_s: f64| {
            let pose = at(&down, time_s)?.inverse().after(&at(&up, time_s)?);
            Ok((time_s, pose))
        };
        times_s.into_iter().map(pose).collect()
    }

    /// The transforms from a frame to that which has no parent.
    fn way_up<'a>(&'a self, frame: &'a str) -> Result<Vec<Step<'a>>, String> {
        let mut way: Vec<Step> = Vec::new();
        let mut passed = HashSet::from([frame]);
        let mut child = frame;
        while let Some((parent, motion)) = self.parent_of(child)? {
            way.push(Step {
                child,
                parent,
                motion,
            });
            if !passed.insert(parent) {
                let names = way.iter().map(|step| step.child).chain([parent]);
                let names: Vec<&str> = names.take(MAX_NAMED).collect();
                return Err(format!(
                    "its transforms form a loop: {}",
                    names.join(" to ")
                ));
            }
            child = parent;
        }
        Ok(way)
    }

    /// The parent of a frame and the transforms to it; [`None`] of a frame at the top.
    fn parent_of(&self, child: &str) -> Result<Option<(&str, &Motion)>, String> {
        let first = (child.to_owned(), String::new());
        let mut parents = self
            .0
            .range(first..)
            .take_while(|((own, _), _)| own == child);
        let Some(((_, parent), motion)) = parents.next() else {
            return Ok(None);
        };
        if let Some(((_, second), _)) = parents.next() {
            return Err(format!(
                "frame {child} has several parents, {parent} and {second}; a frame has one: record \
                 without the transforms of one of them"
            ));
        }
        Ok(Some((parent, motion)))
    }

    /// Checks that a frame is there.
    fn check_name(&self, name: &str) -> Result<(), String> {
        let is_there = |(child, parent): &(String, String)| child == name || parent == name;
        if self.0.keys().any(is_there) {
            return Ok(());
        }
        Err(format!("there is no frame {name:?}; {}", self.listed()))
    }

    /// The transforms in words.
    fn listed(&self) -> String {
        let line = |((child, parent), motion): (&(String, String), &Motion)| match motion {
            Motion::Static(_) => format!("{parent} to {child} (static)"),
            Motion::Moving(stamped) => format!("{parent} to {child} ({})", stamped.len()),
        };
        let mut lines: Vec<String> = self.0.iter().take(MAX_NAMED).map(line).collect();
        if self.0.len() > MAX_NAMED {
            lines.push("…".to_owned());
        }
        format!("its transforms are {}", lines.join(", "))
    }
}

/// The frame at the upper end of a way.
fn top<'a>(frame: &'a str, way: &[Step<'a>]) -> &'a str {
    way.last().map_or(frame, |step| step.parent)
}

/// The stamps of all moving transforms that lie within the stamps of all of them, sorted.
fn common_times(down: &[Step], up: &[Step]) -> Result<Vec<f64>, String> {
    let mut span_s = [f64::NEG_INFINITY, f64::INFINITY];
    let mut times_s = Vec::new();
    let mut spans = Vec::new();
    for step in down.iter().chain(up) {
        let Motion::Moving(stamped) = step.motion else {
            continue;
        };
        let (Some((first_s, _)), Some((last_s, _))) = (stamped.first(), stamped.last()) else {
            continue;
        };
        span_s = [span_s[0].max(*first_s), span_s[1].min(*last_s)];
        times_s.extend(stamped.iter().map(|(time_s, _)| *time_s));
        spans.push(format!(
            "{} to {} {first_s} s to {last_s} s",
            step.parent, step.child
        ));
    }
    times_s.retain(|time_s| (span_s[0]..=span_s[1]).contains(time_s));
    times_s.sort_by(f64::total_cmp);
    times_s.dedup();
    match (spans.is_empty(), times_s.is_empty()) {
        (true, _) => Err(
            "all transforms between the two frames are static: there is no motion; name the fixed \
             frame as `parent`"
                .to_owned(),
        ),
        (false, true) => Err(format!(
            "its transforms have no time in common: {}; one that never changes belongs on \
             /tf_static",
            spans.join(", ")
        )),
        (false, false) => Ok(times_s),
    }
}

/// The error of two transforms that are turned too far from each other.
fn turned(step: &Step, time_s: f64) -> String {
    format!(
        "the transforms from {} to {} around {time_s} s are turned too far from each other to find \
         the way between them",
        step.parent, step.child
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::so3;
    use nalgebra::Vector3;

    fn motion(angle_rad: f64, x: f64) -> Pose {
        Pose::new(so3::exp(&(Vector3::z() * angle_rad)), Vector3::x() * x)
    }

    fn tree(links: &[(&str, &str, Motion)]) -> TransformTree {
        let link = |(child, parent, motion): &(&str, &str, Motion)| {
            ((child.to_string(), parent.to_string()), motion.clone())
        };
        TransformTree(links.iter().map(link).collect())
    }

    /// A robot that drives and turns in `odom`, which drifts in `map`; its camera on a mast.
    fn robot() -> TransformTree {
        let drift = vec![(0.0, motion(0.0, 0.0)), (4.0, motion(0.0, 0.4))];
        let drive = (0..5).map(|k| (f64::from(k), motion(0.2 * f64::from(k), 1.0)));
        tree(&[
            ("odom", "map", Motion::Moving(drift)),
            ("base", "odom", Motion::Moving(drive.collect())),
            ("mast", "base", Motion::Static(motion(0.0, 0.5))),
            ("camera", "mast", Motion::Static(motion(1.0, 0.0))),
            ("lidar", "base", Motion::Static(motion(0.0, -0.5))),
        ])
    }

    #[test]
    fn a_chain_is_the_product_along_its_way() {
        let poses = robot().poses("map", "camera").unwrap();
        assert_eq!(poses.len(), 5);
        for (k, (time_s, pose)) in poses.iter().enumerate() {
            let turn = 0.2 * k as f64;
            let mast = Vector3::new(0.5 * turn.cos(), 0.5 * turn.sin(), 0.0);
            let expected = Vector3::x() * (1.0 + 0.1 * k as f64) + mast;
            assert_eq!(*time_s, k as f64);
            assert!((pose.t_wc - expected).norm() < 1e-12, "{pose:?}");
            let turned = so3::log(&pose.r_wc);
            assert!((turned - Vector3::z() * (turn + 1.0)).norm() < 1e-12);
        }
    }

    #[test]
    fn a_way_may_lead_up_and_down_again() {
        // Static on the way up to base and down from it, so that nothing moves.
        let said = robot().poses("lidar", "camera").unwrap_err();
        assert!(
            said.contains("all transforms between the two frames are static"),
            "{said}"
        );
        // The inverse of a chain is that from the other end.
        let tree = robot();
        let there = tree.poses("map", "camera").unwrap();
        let back = tree.poses("camera", "map").unwrap();
        for ((_, a), (_, b)) in there.iter().zip(&back) {
            assert!(a.after(b).local(&Pose::identity()).norm() < 1e-12);
        }
    }

    #[test]
    fn stamps_that_differ_are_interpolated_where_all_transforms_are() {
        let early = Motion::Moving(vec![(0.0, motion(0.0, 0.0)), (2.0, motion(0.0, 2.0))]);
        let late = Motion::Moving(vec![(0.5, motion(0.0, 5.0)), (2.5, motion(0.0, 7.0))]);
        let tree = tree(&[("b", "a", early), ("c", "b", late)]);
        let poses = tree.poses("a", "c").unwrap();
        let found: Vec<(f64, f64)> = poses.iter().map(|(t, pose)| (*t, pose.t_wc.x)).collect();
        assert_eq!(found, [(0.5, 5.5), (2.0, 8.5)]);
    }

    #[test]
    fn what_is_missing_is_named() {
        let at = |time_s: f64, turn: f64| (time_s, motion(turn, 0.0));
        let still = || Motion::Static(motion(0.0, 0.0));
        let moving = |stamped: &[(f64, Pose)]| Motion::Moving(stamped.to_vec());
        for (tree, expected) in [
            (
                tree(&[("base", "map", still()), ("camera", "mast", still())]),
                "from camera it ends at mast, from map at map, and no transform links the two; its \
                 transforms are map to base (static), mast to camera (static)",
            ),
            (
                tree(&[("camera", "base", still())]),
                "there is no frame \"map\"",
            ),
            (
                tree(&[
                    ("camera", "base", still()),
                    ("base", "map", still()),
                    ("map", "camera", still()),
                ]),
                "a loop: map to camera to base to map",
            ),
            (
                tree(&[("camera", "camera", still()), ("a", "map", still())]),
                "a loop: camera to camera",
            ),
            (
                tree(&[("camera", "map", still()), ("camera", "odom", still())]),
                "frame camera has several parents, map and odom",
            ),
            (
                tree(&[
                    ("camera", "base", moving(&[at(0.0, 0.0), at(1.0, 0.0)])),
                    ("base", "map", moving(&[at(2.0, 0.0), at(3.0, 0.0)])),
                ]),
                "no time in common: base to camera 0 s to 1 s, map to base 2 s to 3 s",
            ),
            (
                tree(&[
                    ("camera", "base", moving(&[at(0.0, 0.0), at(1.0, 3.1)])),
                    (
                        "base",
                        "map",
                        moving(&[at(0.0, 0.0), at(0.5, 0.0), at(1.0, 0.0)]),
                    ),
                ]),
                "from base to camera around 0.5 s are turned too far",
            ),
        ] {
            let said = tree.poses("map", "camera").unwrap_err();
            assert!(said.contains(expected), "{said}");
        }
    }
}
