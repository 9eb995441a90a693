//! Decimation of curves without visible change.

/// Decimates a curve that is drawn in `columns` pixel columns over `[low, high]`: keeps the first,
/// the lowest, the highest and the last point of each column in their order. Points must be in the
/// order of the curve; points with NaN or infinity are dropped.
pub fn decimate(points: &[[f64; 2]], [low, high]: [f64; 2], columns: usize) -> Vec<[f64; 2]> {
    let finite = |point: &&[f64; 2]| point[0].is_finite() && point[1].is_finite();
    let points: Vec<[f64; 2]> = points.iter().filter(finite).copied().collect();
    if points.len() <= 2 * columns {
        return points;
    }
    let column = |x: f64| {
        let share = (x - low) / (high - low).max(f64::MIN_POSITIVE);
        (share * columns as f64).floor().clamp(0.0, columns as f64) as usize
    };
    points
        .chunk_by(|a, b| column(a[0]) == column(b[0]))
        .flat_map(|run| {
            let by_height = |a: &usize, b: &usize| run[*a][1].total_cmp(&run[*b][1]);
            let lowest = (0..run.len()).min_by(by_height).unwrap_or_default();
            let highest = (0..run.len()).max_by(by_height).unwrap_or_default();
            let mut kept = [0, lowest, highest, run.len() - 1].to_vec();
            kept.sort_unstable();
            kept.dedup();
            kept.into_iter().map(|k| run[k]).collect::<Vec<_>>()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_points_stay_as_they_are() {
        let points = [[0.0, 1.0], [1.0, f64::NAN], [2.0, 3.0]];
        assert_eq!(decimate(&points, [0.0, 2.0], 100), [[0.0, 1.0], [2.0, 3.0]]);
    }

    /// A single spike among ten thousand points must not vanish.
    #[test]
    fn extremes_survive_and_the_order_stays() {
        let mut points: Vec<[f64; 2]> = (0..10_000).map(|k| [f64::from(k), 0.1]).collect();
        points[4567][1] = 9.0;
        points[7001][1] = -7.0;
        let fewer = decimate(&points, [0.0, 9999.0], 300);
        assert!(fewer.len() <= 4 * 301, "{}", fewer.len());
        assert!(fewer.contains(&[4567.0, 9.0]) && fewer.contains(&[7001.0, -7.0]));
        assert!(fewer.is_sorted_by(|a, b| a[0] <= b[0]));
        assert_eq!((fewer[0][0], fewer[fewer.len() - 1][0]), (0.0, 9999.0));
    }
}
