//! The values of one sensor, from all payloads of a video.

use super::axes::sensor_axes;
use super::klv::{Klv, KlvList};
use super::sample_clock::SampleClock;
use nalgebra::{Matrix3, Vector3};

/// A sensor whose values are read.
#[derive(Clone, Copy, Debug)]
pub struct SensorKind {
    /// Key of the values.
    pub key: [u8; 4],
    /// Their unit after division by `SCAL`, as `SIUN` begins.
    pub unit: &'static str,
}

/// Values of a sensor, in its own axes.
#[derive(Clone, Debug)]
pub struct Sensor {
    kind: SensorKind,
    /// Matrix from the values to up, left and backwards, if known.
    pub axes: Option<Matrix3<f64>>,
    /// The values.
    pub values: Vec<Vector3<f64>>,
    blocks: Vec<Block>,
}

/// The values of one payload.
#[derive(Clone, Copy, Debug)]
struct Block {
    /// Number of values.
    count: usize,
    /// Values since the begin of the recording, with these, as the camera counts them.
    total: Option<f64>,
    /// Begin and end of the payload, seconds.
    span_s: [f64; 2],
}

impl Sensor {
    /// Creates a sensor without values.
    pub fn new(kind: SensorKind) -> Self {
        Self {
            kind,
            axes: None,
            values: Vec::new(),
            blocks: Vec::new(),
        }
    }

    /// Adds the values of a payload that begins and ends at these times, seconds.
    ///
    /// # Errors
    /// Damaged GPMF; values that are not finite or not three; another unit; impossible axes.
    pub fn add(&mut self, payload: &[u8], span_s: [f64; 2]) -> Result<(), String> {
        let mut block = Block {
            count: 0,
            total: None,
            span_s,
        };
        for device in KlvList(payload) {
            let device = device?;
            for stream in device.children() {
                let stream = stream?;
                let Some(values) = stream.children().find(self.kind.key)? else {
                    continue;
                };
                if self.values.is_empty() {
                    let name = device.children().find(*b"DVNM")?.map(|name| name.text());
                    self.axes = sensor_axes(self.kind.key, stream.children(), name.as_deref())?;
                }
                block.total = first_number(&stream, *b"TSMP")?;
                block.count = self.add_values(&stream, &values)?;
                self.blocks.push(block);
                return Ok(());
            }
        }
        self.blocks.push(block);
        Ok(())
    }

    /// Adds the values of a stream, and returns their number.
    fn add_values(&mut self, stream: &Klv, values: &Klv) -> Result<usize, String> {
        let key = self.kind.key.escape_ascii();
        if let Some(unit) = stream.children().find(*b"SIUN")? {
            let unit = unit.text();
            if !unit.starts_with(self.kind.unit) {
                return Err(format!(
                    "its `{key}` are in `{}`; {} is read",
                    unit.escape_debug(),
                    self.kind.unit
                ));
            }
        }
        let divisor = match stream.children().find(*b"SCAL")? {
            Some(scale) => divisor(&scale.rows()?.concat())?,
            None => Vector3::repeat(1.0),
        };
        let rows = values.rows()?;
        let count = rows.len();
        for row in rows {
            let value = <[f64; 3]>::try_from(row)
                .map_err(|row| format!("its `{key}` have {} numbers instead of 3", row.len()))?;
            let value = Vector3::from(value).component_div(&divisor);
            if !value.iter().all(|number| number.is_finite()) {
                return Err(format!("its `{key}` have a number that is not finite"));
            }
            self.values.push(value);
        }
        Ok(count)
    }

    /// The time of each value, seconds.
    ///
    /// # Errors
    /// The errors of [`SampleClock::fit`].
    pub fn times_s(&self) -> Result<Vec<f64>, String> {
        let firsts = self.counted_by_camera().unwrap_or_else(|| self.counted());
        let blocks = || self.blocks.iter().zip(&firsts).filter(|(b, _)| b.count > 0);
        let mut points: Vec<(f64, f64)> = blocks()
            .map(|(block, first)| (*first, block.span_s[0]))
            .collect();
        if points.len() == 1 {
            // The end of the only payload takes the place of the begin of the next.
            points.extend(blocks().map(|(b, first)| (first + b.count as f64, b.span_s[1])));
        }
        let longest_s = blocks().map(|(block, _)| block.span_s[1] - block.span_s[0]);
        let clock = SampleClock::fit(&points, longest_s.fold(0.0, f64::max))
            .map_err(|what| format!("`{}`: {what}", self.kind.key.escape_ascii()))?;
        let times = |(block, first): (&Block, &f64)| {
            let first = *first;
            (0..block.count).map(move |k| clock.time_s(first + k as f64))
        };
        Ok(blocks().flat_map(times).collect())
    }

    /// The number of each payload's first value, counted here.
    fn counted(&self) -> Vec<f64> {
        let mut total = 0;
        let next = |block: &Block| {
            total += block.count;
            (total - block.count) as f64
        };
        self.blocks.iter().map(next).collect()
    }

    /// The number of each payload's first value by the camera's count, which goes on where values
    /// are missing; [`None`] if it is not there or increases by less than the number of values.
    fn counted_by_camera(&self) -> Option<Vec<f64>> {
        let mut last_total = 0.0;
        let next = |block: &Block| {
            if block.count == 0 {
                return Some(last_total);
            }
            let total = block.total?;
            let first = total - block.count as f64;
            (first >= last_total).then(|| {
                last_total = total;
                first
            })
        };
        self.blocks.iter().map(next).collect()
    }
}

/// The first number of a value in a stream.
fn first_number(stream: &Klv, key: [u8; 4]) -> Result<Option<f64>, String> {
    match stream.children().find(key)? {
        Some(value) => Ok(value.rows()?.concat().first().copied()),
        None => Ok(None),
    }
}

/// The divisor of each axis: one for all, or three.
fn divisor(numbers: &[f64]) -> Result<Vector3<f64>, String> {
    let divisor = match numbers {
        [all] => Vector3::repeat(*all),
        [x, y, z] => Vector3::new(*x, *y, *z),
        _ => Vector3::zeros(),
    };
    if divisor
        .iter()
        .all(|number| *number != 0.0 && number.is_finite())
    {
        return Ok(divisor);
    }
    Err(format!(
        "its SCAL is {numbers:?}; it must be one number or three, none of them 0"
    ))
}
