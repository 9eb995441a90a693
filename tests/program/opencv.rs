//! The camera models against reference values of OpenCV (`fixtures/opencv/make.py`).

use nalgebra::Vector3;
use tunnelstitch::camera::{BrownCoefficients, BrownConrady, Camera, KannalaBrandt, Lens};

/// The lens with a given name in `make.py`.
fn lens(model: &str) -> Lens {
    let brown = |k, p| Lens::BrownConrady(BrownConrady::new(BrownCoefficients { k, p }));
    match model {
        "pinhole" => Lens::default(),
        "brown4" => brown([-0.28, 0.07, 0.0, 0.0, 0.0, 0.0], [1e-3, -2e-3]),
        "brown5" => brown([-0.31, 0.12, -0.021, 0.0, 0.0, 0.0], [-4e-4, 7e-4]),
        "brown8" => brown([4.1, 2.0, 0.1, 4.4, 3.1, 0.45], [-4e-4, 6e-4]),
        "fisheye" => Lens::KannalaBrandt(KannalaBrandt::new([-0.01, 0.005, -0.004, 0.0007])),
        other => panic!("no lens {other}"),
    }
}

/// Projections agree to 1e-9 px, and the rays of those pixels lead back to the points.
#[test]
fn projections_agree_with_opencv() {
    let text = include_str!("../../fixtures/opencv/projections.csv");
    let mut compared = 0;
    for line in text.lines().skip(2) {
        let (model, numbers) = line.split_once(',').unwrap();
        let numbers: Vec<f64> = numbers.split(',').map(|n| n.parse().unwrap()).collect();
        let camera = Camera::at_rest([640, 480], [415.25, 417.5], [318.75, 241.125], lens(model));
        let x_c = Vector3::new(numbers[0], numbers[1], numbers[2]);
        let pixel = camera.project(&x_c).unwrap();
        let apart = (pixel.x - numbers[3]).hypot(pixel.y - numbers[4]);
        assert!(apart < 1e-9, "{line}: {pixel}");
        let ray = camera.ray(numbers[3], numbers[4]).unwrap();
        assert!(
            ray.normalize().metric_distance(&x_c.normalize()) < 1e-9,
            "{line}: {ray}"
        );
        compared += 1;
    }
    assert_eq!(compared, 3500);
}
