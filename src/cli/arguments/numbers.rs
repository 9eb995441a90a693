//! Parsers of numbers for clap.

/// Parses a number above zero.
///
/// # Errors
/// Anything else.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("must be a positive number".to_owned()),
    }
}

/// Parses a share: `90%` or `0.9`.
///
/// # Errors
/// Anything else.
pub fn share(text: &str) -> Result<f64, String> {
    let (number, unit) = match text.strip_suffix('%') {
        Some(number) => (number, 0.01),
        None => (text, 1.0),
    };
    match number.trim().parse::<f64>().map(|number| number * unit) {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err("must be a share from 0% to 100%, as 90%".to_owned()),
    }
}

/// Parses a rate of false alarms.
///
/// # Errors
/// Anything else.
pub fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if rate > 0.0 && rate < 0.5 => Ok(rate),
        _ => Err("must be above 0 and below 0.5, as 0.001".to_owned()),
    }
}

/// Parses N finite numbers separated by commas.
///
/// # Errors
/// Anything else.
pub fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let parse = |part: &str| part.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    let values: Option<Vec<f64>> = text.split(',').map(parse).collect();
    values
        .and_then(|values| <[f64; N]>::try_from(values).ok())
        .ok_or_else(|| format!("must be {N} numbers separated by commas"))
}

/// Parses width and height of a picture, pixels: "640x480".
///
/// # Errors
/// Anything else.
pub fn picture_size(text: &str) -> Result<[u32; 2], String> {
    let parsed = text.split_once(['x', '×']).and_then(|(width, height)| {
        Some([width.trim().parse().ok()?, height.trim().parse().ok()?])
    });
    parsed.ok_or_else(|| "must be width x height in pixels, as 640x480".to_owned())
}

/// Parses a size of memory, bytes: "512MiB", "2GiB".
///
/// # Errors
/// Anything else.
pub fn memory_size(text: &str) -> Result<u64, String> {
    const FORM: &str = "must be a size as 512MiB or 2GiB";
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = match text[digits.len()..].to_ascii_lowercase().as_str() {
        "mib" | "m" => 1u64 << 20,
        "gib" | "g" => 1 << 30,
        _ => return Err(FORM.to_owned()),
    };
    match digits.trim().parse::<f64>() {
        Ok(size) if size.is_finite() && size > 0.0 => Ok((size * unit as f64) as u64),
        _ => Err(FORM.to_owned()),
    }
}

/// Parses the angle between a camera's optical axis and the tunnel's, degrees: "side" (90),
/// "forward" (0) or a number.
///
/// # Errors
/// Anything else.
pub fn view_angle(text: &str) -> Result<f64, String> {
    match (text, text.parse::<f64>()) {
        ("side", _) => Ok(90.0),
        ("forward", _) => Ok(0.0),
        (_, Ok(degrees)) if (0.0..=180.0).contains(&degrees) => Ok(degrees),
        _ => Err("must be side, forward, or an angle of 0 to 180 degrees".to_owned()),
    }
}
