//! Local polynomials against the projection of the camera itself.

use crate::layout::canvas::Canvas;
use crate::layout::placement::{Placement, place_frames};
use crate::layout::tiles::tiles;
use crate::sampling::point_batch::PointBatch;
use crate::warp::control_points::ControlPoints;
use crate::warp::local_polynomial::{LocalPolynomialWarp, ProjectedControlPoints};
use crate::warp::patches::PATCH_EDGE;
use crate::warp::projection::{LocalPoints, LocalProjection};
use tunnelstitch_geometry::camera::{Camera, DoubleSphere, KannalaBrandt, Lens, Mei, Sweep};
use tunnelstitch_geometry::surface::Circle;
use tunnelstitch_geometry::trajectory::{Shutter, spiral};

fn cameras() -> Vec<Camera> {
    let plain = Camera::from_vertical_fov(960, 720, 60f64.to_radians());
    let fisheye = KannalaBrandt::new([-0.01, 0.005, -0.004, 0.0007]);
    let lenses = [
        Lens::default(),
        Lens::radial(-0.2, 0.03),
        Lens::KannalaBrandt(fisheye),
        Lens::DoubleSphere(DoubleSphere::new(-0.2, 0.6).unwrap()),
        Lens::Mei(Mei::new(0.4, [-0.1, 0.02], [1e-3, -2e-3]).unwrap()),
    ];
    let rest = lenses.map(|lens| Camera { lens, ..plain });
    let sweep = Sweep {
        omega_rad: [0.01, -0.03, 0.02].into(),
        nu_m: [0.0, -0.002, 0.001].into(),
    };
    rest.into_iter()
        .chain(rest.map(|camera| camera.with_sweep(&sweep)))
        .collect()
}

/// Every pixel of every tile, against the projection in double precision.
#[test]
fn charts_project_as_cameras_do() {
    let circle = Circle::new(3.0).unwrap();
    for camera in cameras() {
        let still = Camera {
            sweep: Sweep::default(),
            ..camera
        };
        let poses = spiral(4, 0.3, 80f64.to_radians());
        let placements = place_frames(&circle, still, &poses, &Shutter::default()).unwrap();
        let placement = Placement {
            sweep: camera.sweep,
            ..placements[1]
        };
        let canvas = Canvas::of_placements(&circle, &placements, camera.fx / 3.0).unwrap();
        let (mut control_points, mut projected) =
            (ControlPoints::default(), ProjectedControlPoints::default());
        let (mut batch, mut points) = (PointBatch::default(), LocalPoints::default());
        let (mut seen, mut smooth, mut all) = (0, 0, 0);
        let all_tiles = tiles(&circle, &canvas, &placements, 128);
        for tile in all_tiles
            .iter()
            .flatten()
            .filter(|tile| tile.frames.contains(&1))
        {
            control_points.set(&circle, &canvas, tile);
            let projection =
                LocalProjection::new(&camera, &placement.pose, &control_points.points().origin);
            let warp = LocalPolynomialWarp::new(&projection, &control_points, &mut projected);
            smooth += (0..warp.len())
                .filter(|k| warp.coefficients(*k).is_some())
                .count();
            let across = tile.columns.div_ceil(PATCH_EDGE as u32) as usize;
            let corner = |k: usize| (k / across * PATCH_EDGE, k % across * PATCH_EDGE);
            all += (0..warp.len())
                .map(corner)
                .filter(|(row, column)| !warp.is_outside_at(*row, *column))
                .count();
            let exact = tile.points(&circle, &canvas);
            points.set(&exact);
            let width = tile.columns as usize;
            for row in 0..tile.rows as usize {
                batch.locate(&warp, &projection, &points, (row, width), 0..width);
                for k in 0..width {
                    let x_c = placement.pose.to_camera(&exact[row * width + k]);
                    let pixel = camera.project(&x_c);
                    let there = pixel.is_some_and(|pixel| camera.is_in_image(&pixel, 0.0));
                    let (u, v) = (
                        f64::from(batch.pixels().0[k]),
                        f64::from(batch.pixels().1[k]),
                    );
                    let Some(pixel) = pixel.filter(|pixel| camera.is_in_image(pixel, -1.0)) else {
                        assert!(!batch.seen()[k]);
                        continue;
                    };
                    // At the very border rounding decides.
                    if camera.is_in_image(&pixel, 2e-3) || !camera.is_in_image(&pixel, -2e-3) {
                        assert_eq!(batch.seen()[k], there, "{camera:?} {pixel}");
                    }
                    if there {
                        let off = (u - pixel.x).hypot(v - pixel.y);
                        assert!(off < 2e-3, "{camera:?} {pixel}: {off}");
                        seen += 1;
                    }
                }
            }
        }
        assert!(seen * 2 > camera.width * camera.height, "{seen}");
        assert!(
            10 * smooth > 9 * all,
            "{camera:?}: {smooth} of {all} patches are smooth"
        );
    }
}
