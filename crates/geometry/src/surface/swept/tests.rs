use super::*;
use crate::surface::centreline::CentrePoint;
use crate::surface::circle::Circle;
use crate::surface::displacement::wall_jacobian;
use crate::surface::gauge_component;
use crate::surface::section::{CircleOutline, Ellipse, PiecewiseOutline};
use crate::trajectory::{Pose, so3};
use proptest::prelude::*;
use std::f64::consts::TAU;

fn tunnel(section: Box<dyn Section>, nominal_m: f64, points: &[[f64; 4]]) -> Swept {
    let points: Vec<CentrePoint> = points
        .iter()
        .map(|[x, y, z, radius_m]| CentrePoint {
            point: Vector3::new(*x, *y, *z),
            radius_m: (*radius_m > 0.0).then_some(*radius_m),
        })
        .collect();
    let line = Centreline::through(&points, nominal_m, section.farthest_m()).unwrap();
    Swept::new(section, line)
}

/// Points of a line given by its parameter, from 0 to 1.
fn along(n: usize, point: impl Fn(f64) -> [f64; 3]) -> Vec<[f64; 4]> {
    (0..=n)
        .map(|k| {
            let [x, y, z] = point(k as f64 / n as f64);
            [x, y, z, 0.0]
        })
        .collect()
}

/// A bend of radius 60 m around (60, 0, 0), a fifth of a turn.
fn bend(section: Box<dyn Section>) -> Swept {
    let point = |t: f64| {
        let (sin, cos) = (0.2 * TAU * t).sin_cos();
        [60.0 - 60.0 * cos, 60.0 * sin, 0.0]
    };
    tunnel(section, 3.0, &along(40, point))
}

fn helix() -> Swept {
    let point = |t: f64| {
        let (sin, cos) = (TAU * t).sin_cos();
        [30.0 * cos, 20.0 * t, 30.0 * sin]
    };
    tunnel(
        Box::new(CircleOutline { radius_m: 3.0 }),
        3.0,
        &along(120, point),
    )
}

fn s_curve() -> Swept {
    let point = |t: f64| [4.0 * (TAU * t).sin(), 60.0 * t, 2.0 * t * t];
    tunnel(
        Box::new(Ellipse::new(6.0, 5.0).unwrap()),
        3.0,
        &along(30, point),
    )
}

fn funnel() -> Swept {
    let points = [
        [0.0, 0.0, 0.0, 3.0],
        [0.0, 10.0, 0.5, 3.0],
        [0.0, 20.0, 1.0, 2.0],
        [0.5, 30.0, 1.0, 2.0],
    ];
    tunnel(Box::new(CircleOutline { radius_m: 3.0 }), 3.0, &points)
}

fn tunnels() -> Vec<Swept> {
    vec![
        bend(Box::new(CircleOutline { radius_m: 3.0 })),
        bend(Box::new(PiecewiseOutline::rectangle(4.0, 3.0).unwrap())),
        bend(Box::new(PiecewiseOutline::horseshoe(5.0, 4.0).unwrap())),
        helix(),
        s_curve(),
        funnel(),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    /// A ray from inside towards a nearby wall point intersects the wall there.
    #[test]
    fn rays_meet_the_wall_they_are_sent_to(
        which in 0usize..6, place in 0.05f64..0.95, ahead in -3.0f64..3.0, around in 0.0f64..1.0,
        towards in 0.0f64..1.0, share in 0.0f64..0.9,
    ) {
        let tunnel = &tunnels()[which];
        let h_m = place * tunnel.line().length_m();
        let perimeter_m = tunnel.perimeter_m();
        let wall = |s: f64, h_m: f64| tunnel.frame(WallPoint { s_m: s * perimeter_m, h_m });
        let from = tunnel.line().at(h_m).point * (1.0 - share) + wall(around, h_m).x_w * share;
        let target = wall(towards, h_m + ahead);
        let d = target.x_w - from;
        let normal = target.e_s.cross(&target.e_h).normalize();
        // Grazing rays are excluded.
        prop_assume!(d.dot(&normal).abs() > 0.05 * d.norm());
        prop_assert!((tunnel.chainage_m(&from) - h_m).abs() < 1e-6);
        let hit = tunnel.hit(&from, &(d * 0.37)).unwrap();
        prop_assert!((hit.x_w - target.x_w).norm() < 1e-9, "{hit:?} {target:?}");
        let back = tunnel.frame(hit.wall).x_w;
        prop_assert!((back - target.x_w).norm() < 1e-9);
        prop_assert!((hit.wall.h_m - h_m - ahead).abs() < 1e-7);
    }

    #[test]
    fn the_frame_holds_the_derivatives_of_the_point(
        which in 0usize..6, place in 0.0f64..1.0, around in 0.0f64..1.0,
    ) {
        let tunnel = &tunnels()[which];
        let (s, h) = (around * tunnel.perimeter_m(), place * tunnel.line().length_m());
        let point = |s_m, h_m| tunnel.frame(WallPoint { s_m, h_m });
        let frame = point(s, h);
        let step = 1e-5;
        let corner = (point(s - step, h).e_s - point(s + step, h).e_s).norm() > 1e-3;
        prop_assume!(!corner);
        let e_s = (point(s + step, h).x_w - point(s - step, h).x_w) / (2.0 * step);
        let e_h = (point(s, h + step).x_w - point(s, h - step).x_w) / (2.0 * step);
        prop_assert!((e_s - frame.e_s).norm() < 1e-6);
        // Frames rotate in steps from node to node.
        prop_assert!((e_h - frame.e_h).norm() < 1e-4, "{e_h} {frame:?}");
    }
}

#[test]
fn a_straight_line_along_y_is_the_straight_tunnel() {
    let section = Box::new(CircleOutline { radius_m: 3.0 });
    let swept = tunnel(
        section,
        3.0,
        &[[0.0; 4], [0.0, 5.0, 0.0, 0.0], [0.0, 12.0, 0.0, 0.0]],
    );
    let circle = Circle::new(3.0).unwrap();
    for (t, d) in [
        (Vector3::new(0.5, 4.0, -1.0), Vector3::new(0.3, 0.4, 1.0)),
        // Beyond both ends.
        (Vector3::new(0.0, -7.0, 1.0), Vector3::new(-1.0, 0.1, 0.2)),
        (Vector3::new(1.0, 33.0, 1.0), Vector3::new(-1.0, -2.0, 0.2)),
    ] {
        let (a, b) = (swept.hit(&t, &d).unwrap(), circle.hit(&t, &d).unwrap());
        assert!((a.x_w - b.x_w).norm() < 1e-9);
        assert!((a.wall.s_m - b.wall.s_m).abs() < 1e-9 && (a.wall.h_m - b.wall.h_m).abs() < 1e-9);
    }
    let gauge = swept.gauge();
    assert!(gauge.turn && gauge.shift);
    assert!((gauge.axis.direction - Vector3::y()).norm() < 1e-9);
}

#[test]
fn a_bend_is_as_long_as_its_arc_and_turns_about_its_own_axis() {
    let bend = bend(Box::new(CircleOutline { radius_m: 3.0 }));
    assert!((bend.line().length_m() - 0.2 * TAU * 60.0).abs() < 1e-4);
    let gauge = bend.gauge();
    assert!(gauge.turn && !gauge.shift, "{gauge:?}");
    assert!((gauge.axis.direction.z.abs() - 1.0).abs() < 1e-6);
    assert!((gauge.axis.point.x - 60.0).abs() < 1e-2 && gauge.axis.point.y.abs() < 1e-2);
    assert!(gauge.pitch_m.abs() < 1e-2);
    // It moves every wall point along the tunnel, in proportion to its distance from the axis.
    let t = bend.line().at(30.0);
    let pose = Pose::new(t.frame * so3::exp(&Vector3::new(0.1, 0.4, 0.0)), t.point);
    let hit = bend.hit(&pose.t_wc, &(pose.r_wc * Vector3::z())).unwrap();
    let moved = wall_jacobian(&pose, &bend.frame(hit.wall)) * gauge.directions(&pose)[0];
    assert!(
        moved.x.abs() < 0.05 && (moved.y.abs() - 60.0).abs() < 0.05,
        "{moved}"
    );
}

#[test]
fn a_helix_is_a_screw_and_other_lines_are_nothing() {
    let gauge = helix().gauge();
    assert!(gauge.turn && !gauge.shift);
    assert!((gauge.pitch_m.abs() - 20.0 / TAU).abs() < 1e-2, "{gauge:?}");
    assert!((gauge.axis.direction.y.abs() - 1.0).abs() < 1e-4);
    for tunnel in [s_curve(), funnel()] {
        let gauge = tunnel.gauge();
        assert!(!gauge.turn && !gauge.shift, "{gauge:?}");
    }
}

/// Radii given at close points make no steps in the wall.
#[test]
fn radii_between_points_are_on_the_way_from_one_to_the_next() {
    let radius_m = |y: f64| 3.0 + 0.5 * (0.4 * y).sin();
    let points: Vec<[f64; 4]> = (0..=40)
        .map(|k| 0.5 * f64::from(k))
        .map(|y| [0.0, y, 0.0, radius_m(y)])
        .collect();
    let tunnel = tunnel(Box::new(CircleOutline { radius_m: 3.0 }), 3.0, &points);
    for k in 100..1900 {
        let y = 0.01 * f64::from(k);
        let at = tunnel.line().at(y);
        assert!((3.0 * at.scale - radius_m(y)).abs() < 5e-3, "{y}: {at:?}");
        assert!(
            (3.0 * at.growth - 0.2 * (0.4 * y).cos()).abs() < 3e-2,
            "{y}: {at:?}"
        );
    }
}

/// A straight tunnel of varying radius has a free rotation, but no free translation; rotations
/// determine the rotation of cameras on the axis.
#[test]
fn a_funnel_turns_about_its_axis() {
    let funnel = tunnel(
        Box::new(CircleOutline { radius_m: 3.0 }),
        3.0,
        &[[0.0, 0.0, 0.0, 3.0], [0.0, 10.0, 0.0, 2.0]],
    );
    let gauge = funnel.gauge();
    assert!(gauge.turn && !gauge.shift, "{gauge:?}");
    let truth = [0.3, 1.4, 2.5].map(|k: f64| {
        let turn = so3::exp(&Vector3::new(0.1 * k, k, -0.1));
        Pose::new(turn, Vector3::new(0.02 * k, k, -0.01))
    });
    let turned = gauge.motion(0.7, 0.0).apply_all(&truth);
    let back = gauge.align(&turned, &truth);
    for (pose, truth) in back.apply_all(&turned).iter().zip(&truth) {
        assert!(truth.local(pose).norm() < 1e-6);
    }
    // The rotation about the axis is free, the translation along it is not.
    let (made_m, _) = gauge_component(&funnel, &truth[1], &nalgebra::Vector2::new(0.2, 0.1));
    assert!(
        (made_m.x - 0.2).abs() < 1e-6 && made_m.y.abs() < 1e-6,
        "{made_m}"
    );
}

#[test]
fn impossible_lines_are_refused_with_the_reason() {
    let line = |points: &[[f64; 3]], radius_m: Option<f64>| {
        let points: Vec<CentrePoint> = points
            .iter()
            .map(|[x, y, z]| CentrePoint {
                point: Vector3::new(*x, *y, *z),
                radius_m,
            })
            .collect();
        Centreline::through(&points, 3.0, 3.0).map(|_| ())
    };
    let assert_refused = |result: Result<(), SurfaceError>, what: &str| {
        let error = result.unwrap_err().to_string();
        assert!(error.contains(what), "{error}");
    };
    assert_refused(line(&[], None), "no points");
    assert_refused(line(&[[0.0; 3]], None), "two or more");
    assert_refused(
        line(&[[0.0; 3], [0.0; 3], [0.0, 5.0, 0.0]], None),
        "points 1 and 2",
    );
    assert_refused(line(&[[0.0; 3], [f64::NAN; 3]], None), "points 1 and 2");
    assert_refused(
        line(&[[0.0; 3], [0.0, 9.0, 0.0]], Some(-1.0)),
        "radius at point 1",
    );
    let hairpin = [
        [0.0, 0.0, 0.0],
        [0.0, 10.0, 0.0],
        [2.0, 11.0, 0.0],
        [4.0, 10.0, 0.0],
        [4.0, 0.0, 0.0],
    ];
    assert_refused(line(&hairpin, None), "tighter than the tunnel");
    assert_refused(line(&[[0.0; 3], [0.0, 1e9, 0.0]], None), "too long");
    // Turns of 12 m radius; the tunnel is 6 m wide.
    let turns = |rise_m: f64, count: i32| -> Vec<[f64; 3]> {
        let angles = (0..20 * count).map(|k| f64::from(k) * TAU / 20.0);
        let point = |a: f64| [12.0 * a.cos(), 12.0 * a.sin(), rise_m * a / TAU];
        angles.map(point).collect()
    };
    assert_refused(line(&turns(5.9, 3), None), "intersects itself");
    assert_refused(line(&turns(-2.0, 2), None), "intersects itself");
    line(&turns(6.2, 40), None).unwrap();
    line(&turns(4.2, 3), Some(2.0)).unwrap();
}
