//! Plans as tables.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tunnelstitch::trajectory::PlanTable;
use tunnelstitch_fuzz::file;

fuzz_target!(|data: &[u8]| {
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
});
