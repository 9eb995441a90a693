//! Slips by which the coefficients of one lens are given as those of another.

use super::brown_conrady::{BrownCoefficients, BrownConrady};
use super::kannala_brandt::KannalaBrandt;
use super::lens::Lens;

/// A slip that people make when they write a calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LensSlip {
    /// k1 to k4 of a fisheye are given as those of a pinhole, or as its k1 k2 p1 p2.
    FisheyeAsPinhole,
    /// The coefficients of a pinhole are given as those of a fisheye.
    PinholeAsFisheye,
    /// The radial coefficients have the other sign.
    OppositeSign,
    /// The radial coefficients remove the distortion instead of making it.
    Inverse,
    /// k1 k2 k3 p1 p2, as Metashape writes them, are given as OpenCV's k1 k2 p1 p2 k3.
    RadialFirst,
    /// OpenCV's k1 k2 p1 p2 k3 are given as k1 k2 k3 p1 p2.
    TangentialInside,
    /// p1 and p2 are given for each other.
    TangentialSwapped,
}

impl LensSlip {
    /// All slips.
    pub const ALL: [Self; 7] = [
        Self::FisheyeAsPinhole,
        Self::PinholeAsFisheye,
        Self::OppositeSign,
        Self::Inverse,
        Self::RadialFirst,
        Self::TangentialInside,
        Self::TangentialSwapped,
    ];

    /// The lens that was meant by `given`; None if that cannot be this slip.
    pub fn meant(self, given: &Lens) -> Option<Lens> {
        let meant = match (self, given) {
            (Self::FisheyeAsPinhole, Lens::BrownConrady(lens)) => {
                fisheye(lens.coefficients()).map(Lens::KannalaBrandt)
            }
            (Self::PinholeAsFisheye, Lens::KannalaBrandt(lens)) => {
                Some(brown(pinhole(lens.coefficients())))
            }
            (Self::OppositeSign, Lens::KannalaBrandt(lens)) => {
                let k = lens.coefficients().map(|k| -k);
                Some(Lens::KannalaBrandt(KannalaBrandt::new(k)))
            }
            (_, Lens::BrownConrady(lens)) => of_polynomial(self, lens.coefficients()).map(brown),
            _ => None,
        };
        let meant = meant.filter(|meant| meant != given)?;
        Some(match given.max_angle_rad() {
            Some(max_angle_rad) => meant.limited_to(max_angle_rad),
            None => meant,
        })
    }
}

fn brown(coefficients: BrownCoefficients) -> Lens {
    Lens::BrownConrady(BrownConrady::new(coefficients))
}

/// The fisheye whose coefficients are k1 to k4, or k1 k2 p1 p2.
fn fisheye(given: &BrownCoefficients) -> Option<KannalaBrandt> {
    let k = match (given.k, given.p) {
        ([k1, k2, k3, k4, 0.0, 0.0], [0.0, 0.0]) => [k1, k2, k3, k4],
        ([k1, k2, 0.0, 0.0, 0.0, 0.0], [p1, p2]) => [k1, k2, p1, p2],
        _ => return None,
    };
    Some(KannalaBrandt::new(k))
}

/// The pinhole whose coefficients are k1 k2 k3, or OpenCV's k1 k2 p1 p2.
fn pinhole(given: &[f64; 4]) -> BrownCoefficients {
    match *given {
        [k1, k2, k3, 0.0] => BrownCoefficients {
            k: [k1, k2, k3, 0.0, 0.0, 0.0],
            p: [0.0; 2],
        },
        [k1, k2, p1, p2] => BrownCoefficients {
            k: [k1, k2, 0.0, 0.0, 0.0, 0.0],
            p: [p1, p2],
        },
    }
}

/// Other coefficients of a polynomial `1 + k1 q + k2 q² + k3 q³`; None of a rational one.
///
/// The inverse has the first terms of its series: `−k1`, `3 k1² − k2`, `8 k1 k2 − 12 k1³ − k3`.
///
/// Source: P. Drap and J. Lefèvre, "An exact formula for calculating inverse radial lens
/// distortions", Sensors 16(6), 2016.
fn of_polynomial(slip: LensSlip, given: &BrownCoefficients) -> Option<BrownCoefficients> {
    let [k1, k2, k3, 0.0, 0.0, 0.0] = given.k else {
        return None;
    };
    let [p1, p2] = given.p;
    let ([k1, k2, k3], p) = match slip {
        LensSlip::OppositeSign => ([-k1, -k2, -k3], given.p),
        LensSlip::Inverse => {
            let third = 8.0 * k1 * k2 - 12.0 * k1.powi(3) - k3;
            ([-k1, 3.0 * k1 * k1 - k2, third], given.p)
        }
        LensSlip::RadialFirst => ([k1, k2, p1], [p2, k3]),
        LensSlip::TangentialInside => ([k1, k2, p2], [k3, p1]),
        LensSlip::TangentialSwapped => ([k1, k2, k3], [p2, p1]),
        LensSlip::FisheyeAsPinhole | LensSlip::PinholeAsFisheye => return None,
    };
    Some(BrownCoefficients {
        k: [k1, k2, k3, 0.0, 0.0, 0.0],
        p,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;

    fn polynomial(k: [f64; 3], p: [f64; 2]) -> Lens {
        let [k1, k2, k3] = k;
        brown(BrownCoefficients {
            k: [k1, k2, k3, 0.0, 0.0, 0.0],
            p,
        })
    }

    /// A list in one order is read in the other, and back.
    #[test]
    fn coefficients_in_another_order_are_put_right() {
        let right = polynomial([0.1, -0.2, 0.03], [0.004, -0.005]);
        let as_opencv = polynomial([0.1, -0.2, -0.005], [0.03, 0.004]);
        assert_eq!(LensSlip::RadialFirst.meant(&as_opencv), Some(right));
        let of_opencv = polynomial([0.1, -0.2, 0.004], [-0.005, 0.03]);
        assert_eq!(LensSlip::TangentialInside.meant(&of_opencv), Some(right));
        let swapped = polynomial([0.1, -0.2, 0.03], [-0.005, 0.004]);
        assert_eq!(LensSlip::TangentialSwapped.meant(&swapped), Some(right));
        let radial = polynomial([0.1, -0.2, 0.0], [0.0; 2]);
        assert_eq!(LensSlip::RadialFirst.meant(&radial), None);
    }

    #[test]
    fn coefficients_go_to_the_lens_that_was_meant() {
        let fisheye = Lens::KannalaBrandt(KannalaBrandt::new([0.1, -0.2, 0.3, -0.4]));
        let as_list = polynomial([0.1, -0.2, 0.0], [0.3, -0.4]);
        assert_eq!(LensSlip::FisheyeAsPinhole.meant(&as_list), Some(fisheye));
        assert_eq!(LensSlip::PinholeAsFisheye.meant(&fisheye), Some(as_list));
        let by_key = brown(BrownCoefficients {
            k: [0.1, -0.2, 0.3, -0.4, 0.0, 0.0],
            p: [0.0; 2],
        });
        assert_eq!(LensSlip::FisheyeAsPinhole.meant(&by_key), Some(fisheye));
        let limited = LensSlip::PinholeAsFisheye.meant(&fisheye.limited_to(0.5));
        assert_eq!(limited, Some(as_list.limited_to(0.5)));
    }

    /// The distortion of the inverse lens is removed by that of the given one.
    #[test]
    fn the_inverse_lens_undoes_the_given_one() {
        let given = BrownConrady::radial(-0.1, 0.02);
        let Some(Lens::BrownConrady(inverse)) = LensSlip::Inverse.meant(&Lens::BrownConrady(given))
        else {
            unreachable!()
        };
        let p = Vector2::new(0.3, -0.2);
        let both = given.distort(&inverse.distort(&p));
        assert!((both - p).norm() < 1e-4 && (given.distort(&p) - p).norm() > 1e-3);
        assert_eq!(inverse.coefficients().k[0], 0.1);
    }

    #[test]
    fn a_lens_without_such_a_slip_has_no_other_meaning() {
        let ideal = Lens::default();
        let meant = |lens: &Lens| -> Vec<Lens> {
            let slips = LensSlip::ALL.into_iter();
            slips.filter_map(|slip| slip.meant(lens)).collect()
        };
        let fisheye = Lens::KannalaBrandt(KannalaBrandt::new([0.0; 4]));
        assert_eq!(meant(&ideal), [fisheye]);
        let rational = brown(BrownCoefficients {
            k: [4.1, 2.0, 0.1, 4.4, 3.1, 0.45],
            p: [1e-3; 2],
        });
        assert_eq!(meant(&rational), []);
    }
}
