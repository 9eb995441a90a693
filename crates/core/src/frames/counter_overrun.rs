//! Counters in names that begin anew after their last number, as `DSC_9999`, `DSC_0001`.

/// Smallest number of digits of such a counter: the Design rule for Camera File system has four.
const MIN_DIGITS: u32 = 4;

/// The place of the first frame among names in natural order, if their counter has begun anew: the
/// first number follows the last possible one that is there, and more numbers are missing somewhere
/// between them than there are on the way over the end.
pub(super) fn first_place(names: &[&str]) -> Option<usize> {
    let counters: Option<Vec<Counter>> = names.iter().map(|name| Counter::of(name)).collect();
    let counters = counters?;
    let (first, last) = (counters.first()?, counters.last()?);
    let is_alike = |counter: &Counter| {
        (counter.before, counter.after, counter.digits) == (first.before, first.after, first.digits)
    };
    let numbers = 10u64
        .checked_pow(first.digits)
        .filter(|_| first.digits >= MIN_DIGITS)?;
    if last.value + 1 != numbers || first.value > 1 || !counters.iter().all(is_alike) {
        return None;
    }
    let steps = counters
        .windows(2)
        .map(|pair| pair[1].value.saturating_sub(pair[0].value));
    let (place, gap) = steps.enumerate().max_by_key(|(_, step)| *step)?;
    (2 * gap > numbers).then_some(place + 1)
}

/// The last number of a name, and what surrounds it.
struct Counter<'a> {
    before: &'a str,
    value: u64,
    digits: u32,
    after: &'a str,
}

impl<'a> Counter<'a> {
    fn of(name: &'a str) -> Option<Self> {
        let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
        let is_digit = |c: char| c.is_ascii_digit();
        let end = stem.rfind(is_digit)? + 1;
        let start = stem[..end].trim_end_matches(is_digit).len();
        // What follows the number, with the extension.
        let after = &name[end..];
        Some(Self {
            before: &stem[..start],
            value: stem[start..end].parse().ok()?,
            digits: u32::try_from(end - start).ok()?,
            after,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_counter_that_begins_anew_is_told_by_its_last_number() {
        let place = |names: &[&str]| first_place(names);
        assert_eq!(
            place(&[
                "d/dsc_0001.jpg",
                "d/dsc_0002.jpg",
                "d/dsc_9998.jpg",
                "d/dsc_9999.jpg"
            ]),
            Some(2)
        );
        assert_eq!(place(&["a00000.png", "a99998.png", "a99999.png"]), Some(1));
        for names in [
            // Not the last number, not the first, few digits, another name, a gap that is small.
            &["a0001.png", "a9998.png"][..],
            &["a0002.png", "a9999.png"],
            &["a001.png", "a999.png"],
            &["a0001.png", "b9999.png"],
            &["a0001.png", "a4000.png", "a7000.png", "a9999.png"],
            &["a.png", "b.png"],
            &[],
        ] {
            assert_eq!(place(names), None, "{names:?}");
        }
    }
}
