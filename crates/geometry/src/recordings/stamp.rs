//! Headers of messages: their time and the name of their frame of reference.

use super::fields::Fields;
use super::topic::Wire;

/// `std_msgs/Header`, or the times that others are read with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Header<'a> {
    /// The time, seconds.
    pub time_s: f64,
    /// The name of the frame of reference.
    pub frame_id: &'a str,
}

impl<'a> Header<'a> {
    /// Reads a header: the stamp and the name, after a counter in ROS 1.
    ///
    /// # Errors
    /// A message that ends before, in words.
    pub fn read(fields: &mut Fields<'a>, wire: Wire) -> Result<Self, String> {
        if wire == Wire::Ros1 {
            fields.u32()?;
        }
        // Seconds of ROS 2 are signed; none is before 1970.
        let (seconds, nanoseconds) = (fields.u32()?, fields.u32()?);
        if nanoseconds >= 1_000_000_000 {
            return Err(format!("a time with {nanoseconds} ns after the second"));
        }
        Ok(Self {
            time_s: f64::from(seconds) + f64::from(nanoseconds) / 1e9,
            frame_id: fields.text()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_are_seconds() {
        let mut message = Vec::new();
        for number in [9u32, 12, 500_000_000, 3] {
            message.extend(number.to_le_bytes());
        }
        message.extend(b"cam");
        let expected = Header {
            time_s: 12.5,
            frame_id: "cam",
        };
        let mut fields = Fields::packed(&message);
        assert_eq!(Header::read(&mut fields, Wire::Ros1), Ok(expected));
        message[8..12].copy_from_slice(&1_000_000_000u32.to_le_bytes());
        let said = Header::read(&mut Fields::packed(&message), Wire::Ros1).unwrap_err();
        assert!(said.contains("1000000000 ns"), "{said}");
    }
}
