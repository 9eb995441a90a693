//! Selection of one camera of a file that holds several.

use super::error::ParseError;

/// Selects a camera by name; the name may be omitted if there is only one.
pub fn select_camera<T>(
    mut cameras: Vec<(String, T)>,
    name: Option<&str>,
) -> Result<T, ParseError> {
    let names = || {
        let names: Vec<_> = cameras.iter().map(|(name, _)| name.as_str()).collect();
        names.join(", ")
    };
    let at = match name {
        Some(wanted) => cameras
            .iter()
            .position(|(name, _)| name == wanted)
            .ok_or_else(|| {
                ParseError::new(format!(
                    "there is no camera {wanted:?}; the file has {}",
                    names()
                ))
            })?,
        None if cameras.len() == 1 => 0,
        None if cameras.is_empty() => return Err(ParseError::new("the file holds no camera")),
        None => {
            return Err(ParseError::new(format!(
                "the file holds several cameras ({}); select one with `name` under [camera] of \
                 survey.toml",
                names()
            )));
        }
    };
    Ok(cameras.swap_remove(at).1)
}
