//! Properties that every outline has.

use super::*;
use proptest::prelude::*;

fn sections() -> Vec<Box<dyn Section>> {
    vec![
        Box::new(CircleOutline { radius_m: 2.0 }),
        Box::new(Ellipse::new(4.0, 2.5).unwrap()),
        Box::new(Ellipse::new(1.0, 8.0).unwrap()),
        Box::new(PiecewiseOutline::rectangle(4.0, 3.0).unwrap()),
        Box::new(PiecewiseOutline::horseshoe(4.0, 3.5).unwrap()),
    ]
}

proptest! {
    /// A ray from any point inside towards a point of the outline intersects it there.
    #[test]
    fn rays_meet_the_point_they_are_sent_to(
        which in 0usize..5, share in 0.0f64..1.0, inside in 0.0f64..0.98, towards in 0.0f64..1.0,
        length in 0.01f64..100.0,
    ) {
        let section = &sections()[which];
        let perimeter_m = section.perimeter_m();
        let from = section.at(towards * perimeter_m).point * inside;
        prop_assert!(section.contains(&from));
        let target = section.at(share * perimeter_m);
        let d = target.point - from;
        // Grazing rays are excluded.
        prop_assume!(d.perp(&target.tangent).abs() > 1e-3 * d.norm());
        let hit = section.hit(&from, &(d * length));
        prop_assert!((hit.range * length - 1.0).abs() < 1e-9, "{hit:?}");
        let point = section.at(hit.s_m).point;
        prop_assert!((point - target.point).norm() < 1e-9, "{point} {target:?}");
        prop_assert!((0.0..=perimeter_m).contains(&hit.s_m));
    }

    /// The tangent is the derivative of the point, of length one, and the outline closes.
    #[test]
    fn s_is_the_length_of_the_outline(which in 0usize..5, share in 0.0f64..1.0) {
        let section = &sections()[which];
        let s_m = share * section.perimeter_m();
        let at = section.at(s_m);
        prop_assert!((at.tangent.norm() - 1.0).abs() < 1e-12);
        let step = 1e-6;
        let [before, after] = [-step, step].map(|step| section.at(s_m + step));
        // Corners have no tangent.
        prop_assume!((before.tangent - after.tangent).norm() < 1e-4);
        let numeric = (after.point - before.point) / (2.0 * step);
        prop_assert!((numeric - at.tangent).norm() < 1e-7, "{numeric} {at:?}");
        let around = section.at(s_m + section.perimeter_m());
        prop_assert!((around.point - at.point).norm() < 1e-9);
        prop_assert!(at.point.norm() <= section.farthest_m() * (1.0 + 1e-12));
        prop_assert!(!section.contains(&(at.point * 1.000_001)));
        prop_assert!((section.distance_m(&at.point) / at.point.norm() - 1.0).abs() < 1e-9);
    }
}

#[test]
fn outlines_begin_at_twelve_and_run_towards_x() {
    for section in sections() {
        let start = section.at(0.0);
        assert!(start.point.x.abs() < 1e-12 && start.point.y > 0.0);
        assert!(start.tangent.x > 0.999_999);
        // Sum of chords once around.
        let n = 20_000;
        let point = |k: usize| {
            section
                .at(section.perimeter_m() * k as f64 / f64::from(n))
                .point
        };
        let length: f64 = (0..n as usize)
            .map(|k| (point(k + 1) - point(k)).norm())
            .sum();
        // Each of four corners is cut by at most half a step.
        assert!((length / section.perimeter_m() - 1.0).abs() < 2.0 / f64::from(n));
    }
}
