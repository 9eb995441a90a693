//! Decompression of LZF, as compressed PCD files use it.

/// Largest control byte of a run of literal bytes.
const MAX_LITERAL: u8 = 31;
/// Length that says that another byte of the length follows.
const LONG: usize = 7;

/// Decompresses `input` to exactly `size` bytes; None if it is damaged.
///
/// A control byte c of up to 31 is followed by c + 1 literal bytes. Any other has the length in its
/// upper three bits (7: plus the next byte) and, with the following byte, the distance less one of
/// the earlier bytes that are repeated; the length counts from two.
///
/// Source: M. A. Lehmann, LibLZF, 2000 (the format).
pub fn decompress(input: &[u8], size: usize) -> Option<Vec<u8>> {
    // The shortest input of so many bytes; a damaged size allocates nothing.
    if size / MAX_EXPANSION > input.len() {
        return None;
    }
    let mut output = Vec::with_capacity(size);
    let mut bytes = input.iter().copied();
    while let Some(control) = bytes.next() {
        if control <= MAX_LITERAL {
            for _ in 0..=control {
                output.push(bytes.next()?);
            }
        } else {
            let mut length = usize::from(control >> 5);
            if length == LONG {
                length += usize::from(bytes.next()?);
            }
            let high = usize::from(control & MAX_LITERAL) << 8;
            let distance = high + usize::from(bytes.next()?) + 1;
            let from = output.len().checked_sub(distance)?;
            for k in from..from + length + 2 {
                output.push(*output.get(k)?);
            }
        }
        if output.len() > size {
            return None;
        }
    }
    (output.len() == size).then_some(output)
}

/// Largest number of bytes that one byte of input stands for: three stand for 264.
const MAX_EXPANSION: usize = 88;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literals_and_repetitions_are_restored() {
        // "abc", then 9 bytes from 3 back, then 2 + 7 + 3 bytes from 1 back.
        let input = [2, b'a', b'b', b'c', (7 << 5), 0, 2, (7 << 5), 3, 0];
        let expected = b"abcabcabcabccccccccccccc".to_vec();
        assert_eq!(decompress(&input, 24), Some(expected));
    }

    #[test]
    fn damaged_input_is_refused() {
        assert_eq!(decompress(&[2, b'a'], 3), None);
        assert_eq!(decompress(&[0, b'a', 32, 5], 4), None);
        assert_eq!(decompress(&[0, b'a'], 2), None);
        assert_eq!(decompress(&[0, b'a'], usize::MAX), None);
        assert_eq!(decompress(&[224], 9), None);
    }
}
