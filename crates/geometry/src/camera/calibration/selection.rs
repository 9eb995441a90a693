//! Selection of one camera of a file that holds several.

use super::error::{ParseError, ParseErrorKind};

/// Largest number of cameras that a message names.
const MAX_NAMED: usize = 8;

/// Selects a camera by name, which may be omitted if there is only one, or if all are equal.
///
/// # Errors
/// No camera, or none of the name; cameras that differ and no name.
pub fn select_camera<T: PartialEq>(
    mut cameras: Vec<(String, T)>,
    name: Option<&str>,
) -> Result<T, ParseError> {
    let at = match (name, cameras.as_slice()) {
        (_, []) => return Err(ParseError::new("the file holds no camera")),
        (Some(wanted), _) => cameras
            .iter()
            .position(|(name, _)| name == wanted)
            .ok_or_else(|| {
                let names = named(&cameras);
                ParseError::new(format!(
                    "there is no camera {wanted:?}; the file has {names}"
                ))
            })?,
        (None, [(_, first), others @ ..]) if others.iter().all(|(_, other)| other == first) => 0,
        (None, _) => return Err(several(&cameras)),
    };
    Ok(cameras.swap_remove(at).1)
}

/// The error of cameras that differ.
fn several<T>(cameras: &[(String, T)]) -> ParseError {
    let names = cameras.iter().map(|(name, _)| name.clone()).collect();
    ParseError {
        kind: ParseErrorKind::Several(names),
        ..ParseError::new(format!(
            "the file holds several cameras ({}); select one with `name` under [camera] of \
             survey.toml",
            named(cameras)
        ))
    }
}

/// The names of the first cameras, and the number of the others.
fn named<T>(cameras: &[(String, T)]) -> String {
    let names = cameras
        .iter()
        .take(MAX_NAMED)
        .map(|(name, _)| name.as_str());
    let names = names.collect::<Vec<_>>().join(", ");
    match cameras.len().saturating_sub(MAX_NAMED) {
        0 => names,
        others => format!("{names} and {others} more"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_cameras_are_one_and_others_are_selected_by_name() {
        let cameras = |values: &[i32]| {
            let named = values.iter().enumerate();
            named
                .map(|(k, value)| (format!("{}", k + 1), *value))
                .collect::<Vec<_>>()
        };
        assert_eq!(select_camera(cameras(&[5, 5, 5]), None), Ok(5));
        assert_eq!(select_camera(cameras(&[5, 6, 5]), Some("2")), Ok(6));
        let error = select_camera(cameras(&[5, 6]), None).unwrap_err();
        let names = ["1", "2"].map(str::to_owned).to_vec();
        assert_eq!(error.kind, ParseErrorKind::Several(names));
        let values: Vec<i32> = (0..232).collect();
        let said = select_camera(cameras(&values), None).unwrap_err().what;
        assert!(
            said.contains("(1, 2, 3, 4, 5, 6, 7, 8 and 224 more)"),
            "{said}"
        );
        let said = |values: &[i32]| select_camera(cameras(values), Some("9")).unwrap_err().what;
        assert!(said(&[5]).contains("no camera \"9\"; the file has 1"));
        assert!(said(&[]).contains("holds no camera"));
    }
}
