//! Checks for bends tighter than the section and for tunnels that intersect themselves.

use super::line::{Centreline, NODES_PER_SPHERE};
use crate::surface::error::SurfaceError;
use std::f64::consts::PI;

impl Centreline {
    /// Rejects bends tighter than the section.
    pub(super) fn check_bends(&self, farthest_m: f64) -> Result<(), SurfaceError> {
        for (k, turn) in self.turns.iter().enumerate() {
            let bend_m = self.step_m / turn.norm().max(1e-12);
            let size_m = farthest_m * self.nodes[k].scale.max(self.nodes[k + 1].scale);
            if bend_m <= size_m {
                return Err(SurfaceError::Centreline {
                    what: format!(
                        "at chainage {:.2} m it bends with a radius of {bend_m:.2} m, tighter \
                         than the tunnel, which reaches {size_m:.2} m from it",
                        k as f64 * self.step_m
                    ),
                });
            }
        }
        Ok(())
    }

    /// Rejects lines on which the tunnel intersects itself: pairs of points at least half a turn of
    /// the tightest bend apart along the line, and nearer to each other than the sum of their
    /// sections' radii.
    ///
    /// Compares bounding spheres of nodes. From one sphere to the next, centre and radius change by
    /// no more than the length of its nodes, so that distant spheres are skipped.
    pub(super) fn check_self_intersection(&self, farthest_m: f64) -> Result<(), SurfaceError> {
        let most = self.nodes.iter().map(|node| node.scale);
        let size_m = farthest_m * most.fold(0.0, f64::max);
        let run_m = NODES_PER_SPHERE as f64 * self.step_m;
        for (a, (middle, radius)) in self.spheres.iter().enumerate() {
            let mut b = a;
            while let Some((other, other_radius)) = self.spheres.get(b) {
                let between_m = (other - middle).norm() - radius - other_radius;
                if between_m < 2.0 * size_m {
                    self.check_sphere_pair(a, b, farthest_m)?;
                }
                b += ((between_m - 2.0 * size_m) / (2.0 * run_m)).max(1.0) as usize;
            }
        }
        Ok(())
    }

    fn check_sphere_pair(&self, a: usize, b: usize, farthest_m: f64) -> Result<(), SurfaceError> {
        let nodes = |run: usize| {
            run * NODES_PER_SPHERE..((run + 1) * NODES_PER_SPHERE).min(self.nodes.len())
        };
        for i in nodes(a) {
            for j in nodes(b).rev() {
                let (from, to) = (&self.nodes[i], &self.nodes[j]);
                let along_m = j.saturating_sub(i) as f64 * self.step_m;
                if along_m < PI * farthest_m * from.scale.max(to.scale) {
                    break;
                }
                let apart_m = (to.point - from.point).norm();
                if apart_m < farthest_m * (from.scale + to.scale) {
                    return Err(SurfaceError::Centreline {
                        what: format!(
                            "the tunnel intersects itself: chainages {:.2} m and {:.2} m are \
                             {apart_m:.2} m apart",
                            i as f64 * self.step_m,
                            j as f64 * self.step_m
                        ),
                    });
                }
            }
        }
        Ok(())
    }
}
