//! Regions of the wall, bounded by angles and chainages.

use super::footprint::Footprint;
use super::shape::Surface;
use super::wall::WallPoint;
use std::f64::consts::TAU;

/// A set of wall regions, each between two angles and two chainages.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WallRegions {
    /// Sorted by their smallest chainage.
    boxes: Vec<Footprint>,
    /// Largest chainage of each box and of all before it, metres.
    farthest_m: Vec<f64>,
    perimeter_m: f64,
}

impl WallRegions {
    /// The empty set.
    pub const NONE: Self = Self {
        boxes: Vec::new(),
        farthest_m: Vec::new(),
        perimeter_m: 0.0,
    };

    /// Adds the region between two angles θ, in the direction of increasing θ, through 0 if the
    /// second is smaller, and between two chainages. Without angles it covers the full
    /// circumference, without chainages the full length. Angles are those of
    /// [`Surface::angle_rad`].
    pub fn add(
        &mut self,
        surface: &dyn Surface,
        theta_rad: Option<[f64; 2]>,
        chainage_m: Option<[f64; 2]>,
    ) {
        self.perimeter_m = surface.perimeter_m();
        let [from, to] = theta_rad.unwrap_or([0.0, TAU]);
        let from_m = surface.s_at_m(from);
        let span_m = match to - from {
            all if all >= TAU => self.perimeter_m,
            _ => (surface.s_at_m(to) - from_m).rem_euclid(self.perimeter_m),
        };
        let [h_min_m, h_max_m] = chainage_m.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let at = self.boxes.partition_point(|other| other.h_min_m <= h_min_m);
        self.boxes.insert(
            at,
            Footprint {
                s_min_m: from_m,
                s_max_m: from_m + span_m,
                h_min_m,
                h_max_m,
            },
        );
        self.farthest_m.truncate(at);
        let before = self.farthest_m.last().copied();
        let mut farthest_m = before.unwrap_or(f64::NEG_INFINITY);
        for added in &self.boxes[at..] {
            farthest_m = farthest_m.max(added.h_max_m);
            self.farthest_m.push(farthest_m);
        }
    }

    /// True if a region intersects `area`.
    pub fn intersects(&self, area: &Footprint) -> bool {
        // Those that begin beyond the area, and those before the last that may reach it, are not
        // compared.
        let end = (self.boxes).partition_point(|region| region.h_min_m <= area.h_max_m);
        let start = self.farthest_m[..end].partition_point(|h_m| *h_m < area.h_min_m);
        let mut near = self.boxes[start..end].iter();
        near.any(|region| region.overlaps(area, self.perimeter_m))
    }

    /// True if a region contains a point.
    pub fn contains(&self, point: &WallPoint) -> bool {
        self.intersects(&Footprint {
            s_min_m: point.s_m,
            s_max_m: point.s_m,
            h_min_m: point.h_m,
            h_max_m: point.h_m,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::circle::Circle;

    #[test]
    fn angles_go_on_through_zero_and_what_is_left_out_goes_all_the_way() {
        let circle = Circle::new(2.0).unwrap();
        let hold = |theta_deg: Option<[f64; 2]>, chainage_m, at: [f64; 2]| {
            let mut patches = WallRegions::default();
            let theta_rad = theta_deg.map(|theta| theta.map(f64::to_radians));
            patches.add(&circle, theta_rad, chainage_m);
            patches.contains(&WallPoint {
                s_m: 2.0 * at[0].to_radians(),
                h_m: at[1],
            })
        };
        let along = Some([2.0, 5.5]);
        for (theta_deg, chainage_m, at, expected) in [
            (Some([150.0, 210.0]), along, [180.0, 3.0], true),
            (Some([150.0, 210.0]), along, [180.0, 1.9], false),
            (Some([150.0, 210.0]), along, [149.0, 3.0], false),
            (Some([150.0, 210.0]), along, [211.0, 3.0], false),
            (Some([150.0, 210.0]), None, [180.0, -1e4], true),
            (Some([330.0, 30.0]), None, [359.0, 0.0], true),
            (Some([330.0, 30.0]), None, [29.0, 0.0], true),
            (Some([330.0, 30.0]), None, [31.0, 0.0], false),
            (Some([-30.0, 30.0]), None, [331.0, 0.0], true),
            (Some([-30.0, 30.0]), None, [-29.0, 0.0], true),
            (Some([0.0, 360.0]), along, [77.0, 2.0], true),
            (None, along, [77.0, 5.5], true),
            (None, along, [77.0, 5.6], false),
        ] {
            assert_eq!(
                hold(theta_deg, chainage_m, at),
                expected,
                "{theta_deg:?} {chainage_m:?} {at:?}"
            );
        }
        assert!(!WallRegions::NONE.contains(&WallPoint { s_m: 1.0, h_m: 1.0 }));
    }
}
