//! The straight line that a camera moved along.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// Smallest number of camera centres that show a line.
const MIN_CENTRES: usize = 4;
/// Largest number of centres whose pairs are tried as lines.
const MAX_TRIED_CENTRES: usize = 48;
/// Largest distance of a centre from the line, in medians of the distances: 5 σ of normal errors
/// across it, whose median distance is 1.18 σ.
const MAX_MEDIANS: f64 = 4.2;
/// Smallest share of the centres on the line.
const MIN_SHARE: f64 = 0.8;
/// Smallest extent along the line in extents across it (root mean squares). The sagitta of an arc
/// of that ratio is a fiftieth of its length.
const MIN_ELONGATION: f64 = 50.0;
/// Distances below this share of the extent are rounding errors of the files.
const MIN_RELATIVE_DISTANCE: f64 = 1e-9;

/// A straight line through camera centres, in their unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StraightPath {
    /// The point of the line next to the first centre on it.
    pub start: Vector3<f64>,
    /// Direction towards the last centre, of length 1.
    pub direction: Vector3<f64>,
    /// Extent of the centres along the line.
    pub length: f64,
    /// Root mean square of the distances of the centres on the line from it.
    pub rms_distance: f64,
    /// Largest distance of a centre on the line from it.
    pub max_distance: f64,
    /// Number of the centres on the line; the others are outliers.
    pub count: usize,
}

impl StraightPath {
    /// Fits a line to camera centres in the order of the frames; None if they are not on a line.
    ///
    /// The line of least median distance among those through pairs of centres tells outliers; the
    /// principal direction of the others is the line's.
    pub fn of(centres: &[Vector3<f64>]) -> Option<Self> {
        if centres.len() < MIN_CENTRES || !centres.iter().flatten().all(|x| x.is_finite()) {
            return None;
        }
        let (line, median) = line_of_least_median(centres)?;
        let floor = MIN_RELATIVE_DISTANCE * extent(centres);
        let max_distance = (MAX_MEDIANS * median).max(floor);
        let near = centres.iter().copied();
        let near: Vec<Vector3<f64>> = near.filter(|c| line.distance(c) <= max_distance).collect();
        if (near.len() as f64) < MIN_SHARE * centres.len() as f64 {
            return None;
        }
        Self::through(&near)
    }

    /// The principal line of centres without outliers, if they are on a line.
    fn through(centres: &[Vector3<f64>]) -> Option<Self> {
        let count = centres.len() as f64;
        let middle = centres.iter().sum::<Vector3<f64>>() / count;
        let moments: Matrix3<f64> = centres
            .iter()
            .map(|centre| centre - middle)
            .map(|off| off * off.transpose() / count)
            .sum();
        let eigen = SymmetricEigen::new(moments);
        let largest = eigen.eigenvalues.imax();
        let along = eigen.eigenvalues[largest];
        let (first, last) = (centres.first()?, centres.last()?);
        let principal = eigen.eigenvectors.column(largest).into_owned();
        let direction = if principal.dot(&(last - first)) < 0.0 {
            -principal
        } else {
            principal
        };
        let path = Self::along(centres, direction)?;
        let is_long = along > (MIN_ELONGATION * path.rms_distance).powi(2);
        is_long.then_some(path)
    }

    /// The line of a direction, a unit vector, through the mean of camera centres, however far they
    /// are off it; None without centres.
    pub fn along(centres: &[Vector3<f64>], direction: Vector3<f64>) -> Option<Self> {
        let first = centres.first()?;
        let count = centres.len() as f64;
        let middle = centres.iter().sum::<Vector3<f64>>() / count;
        let line = Line { middle, direction };
        let distances: Vec<f64> = centres.iter().map(|c| line.distance(c)).collect();
        let mean_square = distances.iter().map(|d| d * d).sum::<f64>() / count;
        let stations = || centres.iter().map(|c| direction.dot(&(c - middle)));
        Some(Self {
            start: middle + direction * direction.dot(&(first - middle)),
            direction,
            length: stations().fold(f64::NEG_INFINITY, f64::max)
                - stations().fold(f64::INFINITY, f64::min),
            rms_distance: mean_square.sqrt(),
            max_distance: distances.into_iter().fold(0.0, f64::max),
            count: centres.len(),
        })
    }
}

/// A line by a point and a unit vector.
struct Line {
    middle: Vector3<f64>,
    direction: Vector3<f64>,
}

impl Line {
    fn distance(&self, point: &Vector3<f64>) -> f64 {
        self.direction.cross(&(point - self.middle)).norm()
    }
}

/// The line through two of some dozen centres that has the least median distance of these, and that
/// distance; None if all centres are equal.
///
/// *Source*: P. J. Rousseeuw, Least median of squares regression, 1984.
fn line_of_least_median(centres: &[Vector3<f64>]) -> Option<(Line, f64)> {
    let step = centres.len().div_ceil(MAX_TRIED_CENTRES);
    let tried: Vec<&Vector3<f64>> = centres.iter().step_by(step).collect();
    let mut best: Option<(Line, f64)> = None;
    for (k, from) in tried.iter().enumerate() {
        for to in &tried[k + 1..] {
            let Some(direction) = (*to - *from).try_normalize(0.0) else {
                continue;
            };
            let line = Line {
                middle: **from,
                direction,
            };
            let mut distances: Vec<f64> = tried.iter().map(|c| line.distance(c)).collect();
            distances.sort_by(f64::total_cmp);
            let median = distances[distances.len() / 2];
            if best.as_ref().is_none_or(|(_, least)| median < *least) {
                best = Some((line, median));
            }
        }
    }
    best
}

/// Largest distance of a centre from the first one.
fn extent(centres: &[Vector3<f64>]) -> f64 {
    let first = centres.first().copied().unwrap_or_default();
    let distances = centres.iter().map(|centre| (centre - first).norm());
    distances.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    /// Centres 0.1 apart along a line, each off it by an error.
    fn along(direction: Vector3<f64>, sigma: f64) -> Vec<Vector3<f64>> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let error = Normal::new(0.0, sigma).unwrap();
        let mut off = || Vector3::from_fn(|_, _| error.sample(&mut rng));
        (0..120)
            .map(|k| Vector3::new(3.0, -2.0, 5.0) + direction * (0.1 * f64::from(k)) + off())
            .collect()
    }

    #[test]
    fn the_line_is_found_among_errors_and_outliers() {
        let direction = Vector3::new(-1.0, 2.0, 2.0) / 3.0;
        let mut centres = along(direction, 0.01);
        for (k, centre) in centres.iter_mut().enumerate().skip(5).step_by(10) {
            *centre += Vector3::new(k as f64, 0.0, 3.0);
        }
        let path = StraightPath::of(&centres).unwrap();
        assert_eq!(path.count, 108);
        assert!(path.direction.dot(&direction) > 0.99999, "{path:?}");
        assert!((path.start - Vector3::new(3.0, -2.0, 5.0)).norm() < 0.02);
        assert!((path.length - 11.9).abs() < 0.1, "{path:?}");
        assert!((path.rms_distance / (2f64.sqrt() * 0.01) - 1.0).abs() < 0.2);
    }

    #[test]
    fn an_exact_line_is_one() {
        let path = StraightPath::of(&along(-Vector3::z(), 0.0)).unwrap();
        assert!(path.max_distance < 1e-12 && path.count == 120, "{path:?}");
        assert!(path.direction.z < -1.0 + 1e-12);
    }

    /// A camera that revolves off the axis, a bend, a camera at rest, too few cameras.
    #[test]
    fn other_paths_are_no_line() {
        let revolving = |k: u32| {
            let (sin, cos) = (0.5 * f64::from(k)).sin_cos();
            Vector3::new(0.5 * cos, 0.1 * f64::from(k), 0.5 * sin)
        };
        let bend = |k: u32| {
            let (sin, cos) = (0.005 * f64::from(k)).sin_cos();
            Vector3::new(20.0 * cos, 20.0 * sin, 0.0)
        };
        let of = |at: &dyn Fn(u32) -> Vector3<f64>, count: u32| {
            StraightPath::of(&(0..count).map(at).collect::<Vec<_>>())
        };
        assert_eq!(of(&revolving, 60), None);
        assert_eq!(of(&bend, 120), None);
        assert_eq!(of(&|_| Vector3::x(), 9), None);
        assert_eq!(of(&|k| Vector3::x() * f64::from(k), 3), None);
        assert_eq!(of(&|_| Vector3::x() * f64::NAN, 9), None);
    }
}
