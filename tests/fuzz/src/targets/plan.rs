//! Plans as tables.

use super::super::file;
use tunnelstitch::trajectory::PlanTable;

/// Reads the input.
pub fn run(data: &[u8]) {
    let (_folder, path) = file("plan.csv", data);
    if let Ok(table) = PlanTable::read(&path)
        && let Ok(stations) = table.stations(&[0.0, 0.5, 1.0])
    {
        assert!(
            stations
                .iter()
                .all(|station| station.chainage_m.is_finite() && station.angle_rad.is_finite())
        );
    }
}
