//! Round numbers for the ticks of an axis.

use super::quantity::fixed;

/// About `wanted` (three or more) round values in `[low, high]` with their texts: multiples of 1, 2
/// or 5 times a power of ten.
pub fn linear(low: f64, high: f64, wanted: usize) -> Vec<(f64, String)> {
    let span = high - low;
    if !(span.is_finite() && span > 0.0) {
        return vec![(low, super::quantity::short(low))];
    }
    // With fewer than three there may be no round value in the range.
    let min_step = span / wanted.max(3) as f64;
    let power = 10f64.powf(min_step.log10().floor());
    let step = [1.0, 2.0, 5.0]
        .map(|factor| factor * power)
        .into_iter()
        .find(|step| *step >= 0.999 * min_step)
        .unwrap_or(10.0 * power);
    let decimals = (-(step * 1.001).log10().floor()).max(0.0) as usize;
    // The tolerance includes ends that are round themselves.
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last)
        .map(|k| {
            let value = k as f64 * step;
            (value, fixed(value, decimals))
        })
        .collect()
}

/// About `wanted` powers of ten in `[low, high]` (both positive). Below two decades also 2 and 5
/// times the powers, below one decade the values of [`linear`].
pub fn logarithmic(low: f64, high: f64, wanted: usize) -> Vec<(f64, String)> {
    if !(low > 0.0 && high > low && high.is_finite()) {
        return Vec::new();
    }
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let decades = (last - first).max(1) as usize;
    let stride = decades.div_ceil(wanted.max(1)).max(1);
    let factors: &[f64] = if (high / low).log10() < 2.0 {
        &[1.0, 2.0, 5.0]
    } else {
        &[1.0]
    };
    let ticks: Vec<(f64, String)> = (first..=last)
        .step_by(stride)
        .flat_map(|decade| factors.iter().map(move |f| f * 10f64.powi(decade)))
        .filter(|value| (0.999 * low..=1.001 * high).contains(value))
        .map(|value| (value, power_text(value)))
        .collect();
    if ticks.len() < 3 && high < 10.0 * low {
        linear(low, high, wanted.min(4))
    } else {
        ticks
    }
}

/// Formats a power of ten with plain digits if they are short, else with an exponent.
fn power_text(value: f64) -> String {
    if (1e-4..1e5).contains(&value) {
        super::quantity::significant(value, 1)
    } else {
        let exponent = value.log10().floor();
        let factor = (value / 10f64.powf(exponent)).round();
        let superscript: String = format!("{exponent}")
            .chars()
            .map(|c| match c {
                '-' => '⁻',
                '1' => '¹',
                '2' => '²',
                '3' => '³',
                '0' | '4'..='9' => {
                    char::from_u32(0x2070 + c.to_digit(10).unwrap_or_default()).unwrap_or(c)
                }
                other => other,
            })
            .collect();
        if factor == 1.0 {
            format!("10{superscript}")
        } else {
            format!("{factor}·10{superscript}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn texts(ticks: &[(f64, String)]) -> Vec<&str> {
        ticks.iter().map(|(_, text)| text.as_str()).collect()
    }

    #[test]
    fn ticks_are_round_and_written_alike() {
        assert_eq!(texts(&linear(-1.45, 13.3, 5)), ["0", "5", "10"]);
        assert_eq!(texts(&linear(0.0, 0.7, 4)), ["0.0", "0.2", "0.4", "0.6"]);
        assert_eq!(texts(&linear(-0.02, 0.021, 4)), ["−0.02", "0.00", "0.02"]);
        assert_eq!(
            texts(&logarithmic(0.003, 40.0, 6)),
            ["0.01", "0.1", "1", "10"]
        );
        assert_eq!(texts(&logarithmic(1.5, 30.0, 5)), ["2", "5", "10", "20"]);
        assert_eq!(texts(&logarithmic(1.5, 9.0, 5)), ["2", "4", "6", "8"]);
        assert!(logarithmic(0.0, 1.0, 5).is_empty());
        assert_eq!(texts(&logarithmic(1e-7, 1e-5, 5)), ["10⁻⁷", "10⁻⁶", "10⁻⁵"]);
    }

    proptest! {
        #[test]
        fn there_are_neither_none_nor_too_many(
            low in -1e4f64..1e4,
            span in 1e-6f64..1e6,
            wanted in 3usize..9,
        ) {
            let ticks = linear(low, low + span, wanted);
            prop_assert!(!ticks.is_empty() && ticks.len() <= wanted + 2, "{:?}", ticks);
            for (value, _) in &ticks {
                prop_assert!(*value >= low - 1e-6 * span && *value <= low + span * (1.0 + 1e-6));
            }
        }
    }
}
