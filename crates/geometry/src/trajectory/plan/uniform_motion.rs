//! Uniform motion of the carrier.

use super::station::Station;

/// A rate of change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rate {
    /// Change per frame.
    PerFrame(f64),
    /// Change per second.
    PerSecond(f64),
}

impl Rate {
    /// The change from the first frame to frame `frame`, which is `time_s` later.
    fn until(self, frame: usize, time_s: f64) -> f64 {
        match self {
            Self::PerFrame(step) => step * frame as f64,
            Self::PerSecond(rate) => rate * time_s,
        }
    }
}

/// A carrier that advances and rotates at constant rates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UniformMotion {
    /// The station at the first frame.
    pub start: Station,
    /// Advance along the axis, metres.
    pub advance_m: Rate,
    /// Rotation about the axis, radians.
    pub turn_rad: Rate,
}

impl UniformMotion {
    /// The stations at the frames' times, seconds.
    pub fn stations(&self, times_s: &[f64]) -> Vec<Station> {
        let first_s = times_s.first().copied().unwrap_or_default();
        let station = |(k, time_s): (usize, &f64)| Station {
            chainage_m: self.start.chainage_m + self.advance_m.until(k, time_s - first_s),
            angle_rad: self.start.angle_rad + self.turn_rad.until(k, time_s - first_s),
            offset_m: self.start.offset_m,
        };
        times_s.iter().enumerate().map(station).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_goes_by_the_frame_or_by_the_second() {
        let plan = UniformMotion {
            start: Station {
                chainage_m: 5.0,
                angle_rad: 1.0,
                offset_m: [0.1, -0.2],
            },
            advance_m: Rate::PerSecond(0.2),
            turn_rad: Rate::PerFrame(0.5),
        };
        let stations = plan.stations(&[10.0, 10.5, 12.0]);
        assert_eq!(stations[0], plan.start);
        assert_eq!(
            stations[2],
            Station {
                chainage_m: 5.4,
                angle_rad: 2.0,
                ..plan.start
            }
        );
    }
}
