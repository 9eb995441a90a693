//! Recognition of angular rates in degrees that are taken for radians, and the reverse.

/// Smallest planned turn that is compared, radians: a 57th of less is within the bias of a sensor.
const MIN_TURN_RAD: f64 = std::f64::consts::FRAC_PI_2;
/// Largest ratio to a factor of 180/π at which the unit is taken to be wrong.
const MAX_RATIO: f64 = 1.25;

/// Warning about rates of which the turn is 180/π times the planned one, or π/180 of it, with the
/// line of the log that mends it; `scale` is the log's `gscale`.
pub(super) fn wrong_unit(turned_rad: f64, planned_rad: f64, scale: f64) -> Option<String> {
    if planned_rad.abs() < MIN_TURN_RAD {
        return None;
    }
    let ratio = (turned_rad / planned_rad).abs();
    let is_near = |factor: f64| {
        let off = ratio / factor;
        (1.0 / MAX_RATIO..MAX_RATIO).contains(&off)
    };
    let degrees = 1f64.to_degrees();
    let (remedy, are, taken_for) = if is_near(degrees) {
        (scale / degrees, "degrees", "radians")
    } else if is_near(1.0 / degrees) {
        (scale * degrees, "radians", "degrees")
    } else {
        return None;
    };
    Some(format!(
        "the log turns by {:.1}° where {:.1}° are planned: its rates seem to be {are} per second \
         that are taken for {taken_for}; write into its header: gscale,{remedy:.6e}",
        turned_rad.to_degrees(),
        planned_rad.to_degrees()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_that_is_57_times_too_large_or_too_small_names_the_scale() {
        let planned = 720f64.to_radians();
        let warning = |turned: f64| wrong_unit(turned, planned, 0.01).unwrap();
        let large = warning(planned.to_degrees() * 1.1);
        assert!(large.contains("be degrees per second"), "{large}");
        assert!(large.ends_with("gscale,1.745329e-4"), "{large}");
        let small = warning(-planned.to_radians());
        assert!(small.contains("be radians per second"), "{small}");
        assert!(small.ends_with("gscale,5.729578e-1"), "{small}");
        for turned in [0.0, 1.0, planned, -planned, 10.0 * planned, f64::NAN] {
            assert_eq!(wrong_unit(turned, planned, 0.01), None);
        }
        assert_eq!(wrong_unit(57.3, 1.0, 0.01), None);
    }
}
