//! Selection of the calibration in files that have one for each picture.

use super::error::ParseError;

/// Most pictures that an error message names.
const MAX_NAMED: usize = 3;

/// The calibration that all pictures share, or that of the picture of this name.
///
/// # Errors
/// No picture, or none of the name; pictures of different calibrations and no name.
pub fn select_shared<T: PartialEq>(
    mut pictures: Vec<(String, T)>,
    name: Option<&str>,
) -> Result<T, ParseError> {
    let at = match name {
        Some(wanted) => pictures
            .iter()
            .position(|(name, _)| name == wanted)
            .ok_or_else(|| {
                let what = format!("there is no picture {wanted:?}; {}", named(&pictures));
                ParseError::new(what)
            })?,
        None => 0,
    };
    let Some((_, first)) = pictures.get(at) else {
        return Err(ParseError::new("the file holds no camera"));
    };
    let others = pictures.iter().filter(|(_, other)| other != first).count();
    if name.is_none() && others > 0 {
        return Err(ParseError::new(format!(
            "{others} of {} pictures have another calibration than the first; {}. One camera is \
             read: let the program share the calibration among all pictures, or select that of one \
             with `name` under [camera]",
            pictures.len(),
            named(&pictures)
        )));
    }
    Ok(pictures.swap_remove(at).1)
}

/// The first pictures in words.
fn named<T>(pictures: &[(String, T)]) -> String {
    let names = pictures
        .iter()
        .take(MAX_NAMED)
        .map(|(name, _)| name.as_str());
    let names: Vec<&str> = names.collect();
    let more = match pictures.len() > MAX_NAMED {
        true => ", …",
        false => "",
    };
    format!("pictures are named {}{more}", names.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_calibrations_are_one_and_others_are_selected_by_picture() {
        let pictures = |values: &[i32]| {
            let named = values.iter().enumerate();
            named
                .map(|(k, value)| (format!("{k}.jpg"), *value))
                .collect()
        };
        assert_eq!(select_shared(pictures(&[5, 5, 5]), None), Ok(5));
        assert_eq!(select_shared(pictures(&[5, 6, 5]), Some("1.jpg")), Ok(6));
        let said = |values: &[i32], name| select_shared(pictures(values), name).unwrap_err().what;
        let differ = said(&[5, 6, 7, 5], None);
        assert!(
            differ.starts_with("2 of 4 pictures have another"),
            "{differ}"
        );
        assert!(differ.contains("0.jpg, 1.jpg, 2.jpg, …"), "{differ}");
        assert!(said(&[5], Some("b")).contains("no picture \"b\""));
        assert!(said(&[], None).contains("no camera"));
    }
}
