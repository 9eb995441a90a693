//! Calibration files parsed to a tree of values, and look-ups in it.

use super::error::ParseError;
use serde_json::Value;

/// Parses a YAML file. OpenCV's files begin with `%YAML:1.0`, which YAML does not allow, and mark
/// matrices with a tag of their own; both are removed first. Of several documents, as `rostopic
/// echo` prints them, the first counts.
pub fn parse_yaml(text: &str) -> Result<Value, ParseError> {
    let mut has_content = false;
    let lines = text.lines().take_while(|line| {
        let is_end = line.trim_end() == "---" && has_content;
        has_content |= !line.trim().is_empty() && !line.starts_with(['%', '#', '-']);
        !is_end
    });
    let lines = lines.map(|line| {
        let line = if line.starts_with("%YAML") { "" } else { line };
        line.replace("!!opencv-matrix", "")
    });
    let plain: String = lines.flat_map(|line| [line, "\n".to_owned()]).collect();
    let tree: Value = serde_saphyr::from_str(&plain).map_err(|error| {
        let line = error.location().map(|at| at.line() as usize);
        let what = error.to_string();
        let what = what.lines().next().unwrap_or_default();
        ParseError {
            line,
            ..ParseError::new(format!("this is not valid YAML: {what}"))
        }
    })?;
    if tree.is_object() {
        Ok(tree)
    } else {
        Err(ParseError::new("this YAML has no entries `name: value`"))
    }
}

/// Parses a JSON file.
pub fn parse_json(text: &str) -> Result<Value, ParseError> {
    serde_json::from_str(text).map_err(|error| ParseError::at(error.line(), error.to_string()))
}

/// The first entry that exists under one of the names.
pub fn entry<'a>(tree: &'a Value, names: &[&str]) -> Option<&'a Value> {
    names.iter().find_map(|name| tree.get(name))
}

/// The entry of that name.
pub fn needed<'a>(tree: &'a Value, name: &str) -> Result<&'a Value, ParseError> {
    let missing = || ParseError::new(format!("the entry `{name}` is missing"));
    tree.get(name).ok_or_else(missing)
}

/// The first entry that exists under one of the names, as a number.
pub fn number(tree: &Value, names: &[&str]) -> Result<f64, ParseError> {
    let value = entry(tree, names)
        .ok_or_else(|| ParseError::new(format!("the entry `{}` is missing", names[0])))?;
    value
        .as_f64()
        .filter(|value| value.is_finite())
        .ok_or_else(|| ParseError::new(format!("`{}` is {value}; it must be a number", names[0])))
}

/// The first entry that exists under one of the names, as a number of pixels.
pub fn pixels(tree: &Value, names: &[&str]) -> Result<u32, ParseError> {
    let value = number(tree, names)?;
    if value.fract() == 0.0 && (1.0..=1e6).contains(&value) {
        Ok(value as u32)
    } else {
        Err(ParseError::new(format!(
            "`{}` is {value}; it must be a whole number of pixels",
            names[0]
        )))
    }
}

/// A list of numbers, or the `data` of a matrix.
pub fn numbers(value: &Value, name: &str) -> Result<Vec<f64>, ParseError> {
    let list = value.get("data").unwrap_or(value).as_array();
    let list =
        list.ok_or_else(|| ParseError::new(format!("`{name}` must be a list of numbers")))?;
    // A matrix may be a list of rows.
    let rows = list.iter().flat_map(|item| match item.as_array() {
        Some(row) => row.as_slice(),
        None => std::slice::from_ref(item),
    });
    rows.map(|item| {
        item.as_f64()
            .ok_or_else(|| ParseError::new(format!("`{name}` holds {item}; it must be a number")))
    })
    .collect()
}

/// The entry as text.
pub fn text_entry<'a>(tree: &'a Value, name: &str) -> Option<&'a str> {
    tree.get(name).and_then(Value::as_str)
}
