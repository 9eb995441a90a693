//! Rings of segments, each a step nearer to the axis or farther from it.
//!
//! Ring i reaches from chainage `i L` to `(i + 1) L`. Segment k of it reaches from
//! `θ = (k + ½ (i mod 2)) 2π/N` over `2π/N`. Its step is a normal number that depends on nothing
//! but the seed, i and k, so the lining has no ends.

use crate::as_built::Segments;
use crate::procedural_noise::normal;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// A lining of segments.
#[derive(Clone, Debug)]
pub(crate) struct SegmentRings {
    segments: Segments,
    seed: u64,
    /// Sine and cosine of the angles of the joints within even and odd rings.
    joints: [Vec<(f64, f64)>; 2],
}

/// One segment: its ring, and its number in the ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Segment {
    ring: i64,
    number: i64,
}

impl SegmentRings {
    /// The rings of validated options.
    pub fn new(segments: Segments, seed: u64) -> Self {
        let joints = [0, 1].map(|ring| {
            let angles = joint_angles(segments.count, ring);
            angles.map(f64::sin_cos).collect()
        });
        Self {
            segments,
            seed,
            joints,
        }
    }

    /// Length of a ring, metres.
    pub fn ring_length_m(&self) -> f64 {
        self.segments.ring_length_m
    }

    /// Width of the joints, metres; 0 if they are invisible.
    pub fn joint_m(&self) -> f64 {
        1e-3 * self.segments.joint_mm
    }

    /// The ring at a chainage.
    pub fn ring_at(&self, h_m: f64) -> i64 {
        (h_m / self.segments.ring_length_m).floor() as i64
    }

    /// The segment at a point of the wall.
    pub fn segment_at(&self, theta: f64, h_m: f64) -> Segment {
        let (ring, count) = (self.ring_at(h_m), self.segments.count);
        let number = theta / TAU * f64::from(count) - stagger(ring);
        Segment {
            ring,
            number: (number.floor() as i64).rem_euclid(i64::from(count)),
        }
    }

    /// Radial step of a segment, metres, positive outwards.
    pub fn step_m(&self, segment: Segment) -> f64 {
        1e-3 * self.segments.step_mm * normal(self.seed, segment.ring, segment.number)
    }

    /// Angles of the joints within a ring, radians in `[0, 2π)`.
    pub fn joint_angles(&self, ring: i64) -> impl Iterator<Item = f64> {
        joint_angles(self.segments.count, ring)
    }

    /// Distances at which the ray `t + λ d` crosses joints, for λ from `within[0]` to `within[1]`
    /// (metres, d a unit vector), in order.
    ///
    /// Joints between rings are planes `y = i L`. Those within a ring are half planes through the
    /// axis, `x cos θ_k = z sin θ_k` where `x sin θ_k + z cos θ_k > 0`.
    pub fn joints_crossed(&self, t: &Vector3<f64>, d: &Vector3<f64>, within: [f64; 2]) -> Vec<f64> {
        let mut crossed = Vec::new();
        let rings = within.map(|lambda| self.ring_at(t.y + lambda * d.y));
        let (first, last) = (rings[0].min(rings[1]), rings[0].max(rings[1]));
        for ring in first..=last {
            if ring > first {
                crossed.push((ring as f64 * self.segments.ring_length_m - t.y) / d.y);
            }
            for (sin, cos) in &self.joints[ring.rem_euclid(2) as usize] {
                let lambda = (t.z * sin - t.x * cos) / (d.x * cos - d.z * sin);
                let point = t + d * lambda;
                let is_near_half = point.x * sin + point.z * cos > 0.0;
                if is_near_half && self.ring_at(point.y) == ring {
                    crossed.push(lambda);
                }
            }
        }
        crossed.retain(|lambda| within[0] < *lambda && *lambda < within[1]);
        crossed.sort_unstable_by(f64::total_cmp);
        crossed
    }
}

/// Angles of the joints within a ring of `count` segments, radians in `[0, 2π)`.
fn joint_angles(count: u32, ring: i64) -> impl Iterator<Item = f64> {
    (0..count).map(move |k| (f64::from(k) + stagger(ring)) * TAU / f64::from(count))
}

/// Turn of a ring, segments.
fn stagger(ring: i64) -> f64 {
    0.5 * ring.rem_euclid(2) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rings(count: u32) -> SegmentRings {
        let segments = Segments {
            count,
            ring_length_m: 1.5,
            step_mm: 3.0,
            joint_mm: 8.0,
        };
        SegmentRings::new(segments, 7)
    }

    /// 6000 steps: 3.5 standard errors of the mean, of σ and of the correlation of neighbours.
    #[test]
    fn steps_have_their_sigma_and_are_independent() {
        let rings = rings(6);
        let step = |ring: i64, number: i64| rings.step_m(Segment { ring, number });
        let all = || (-500..500).flat_map(|ring| (0..6).map(move |number| (ring, number)));
        let n = all().count() as f64;
        let mean = all().map(|(ring, number)| step(ring, number)).sum::<f64>() / n;
        let square = all().map(|(i, k)| step(i, k).powi(2)).sum::<f64>() / n;
        assert!(mean.abs() < 3.5 * 0.003 / n.sqrt(), "{mean}");
        let sigma = square.sqrt();
        assert!(
            (sigma / 0.003 - 1.0).abs() < 3.5 / (2.0 * n).sqrt(),
            "{sigma}"
        );
        for (next_ring, next_number) in [(1, 0), (0, 1)] {
            let product = all()
                .map(|(i, k)| step(i, k) * step(i + next_ring, (k + next_number) % 6))
                .sum::<f64>();
            assert!((product / n / square).abs() < 3.5 / n.sqrt());
        }
        assert_eq!(step(3, 2), step(3, 2));
    }

    #[test]
    fn every_other_ring_is_turned_by_half_a_segment() {
        let rings = rings(4);
        let at = |theta_deg: f64, h_m: f64| rings.segment_at(theta_deg.to_radians(), h_m).number;
        assert_eq!(
            [1.0, 89.0, 91.0, 359.0].map(|deg| at(deg, 0.1)),
            [0, 0, 1, 3]
        );
        assert_eq!(
            [1.0, 46.0, 134.0, 316.0].map(|deg| at(deg, 1.6)),
            [3, 0, 0, 3]
        );
        assert_eq!(rings.segment_at(0.1, -0.1).ring, -1);
    }

    /// Between joints the segment stays the same, and at each it changes.
    #[test]
    fn a_ray_crosses_joints_where_its_segment_changes() {
        for count in [1, 2, 6] {
            let rings = rings(count);
            let t = Vector3::new(0.8, 0.4, -1.1);
            let d = Vector3::new(0.3, 0.6, 0.9).normalize();
            let segment = |lambda: f64| {
                let point = t + d * lambda;
                rings.segment_at(point.x.atan2(point.z), point.y)
            };
            let joints = rings.joints_crossed(&t, &d, [0.0, 6.0]);
            let steps = 60_000;
            let lambda = |k: usize| 6.0 * (k as f64 + 0.5) / steps as f64;
            let changes: Vec<usize> = (1..steps)
                .filter(|k| segment(lambda(*k)) != segment(lambda(k - 1)))
                .collect();
            // With one segment around, its own joint changes nothing.
            let changing = joints
                .iter()
                .filter(|at| segment(**at - 1e-6) != segment(**at + 1e-6));
            let changing: Vec<f64> = changing.copied().collect();
            assert_eq!(changing.len(), changes.len(), "{count}: {joints:?}");
            for (joint, change) in changing.iter().zip(changes) {
                assert!((joint - lambda(change)).abs() < 2e-4);
            }
        }
    }
}
