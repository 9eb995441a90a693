//! OpenCV's XML as the tree that its YAML and JSON have.

use super::error::ParseError;
use crate::files::xml::{child, parse};
use roxmltree::Node;
use serde_json::{Map, Value, json};

/// Parses a file of `cv::FileStorage`; a matrix is an object with the list `data`.
pub fn parse_storage(text: &str) -> Result<Value, ParseError> {
    let document = parse(text).map_err(ParseError::new)?;
    let elements = document.root_element().children().filter(Node::is_element);
    let entry = |node: Node| (node.tag_name().name().to_owned(), value(node));
    let entries: Map<String, Value> = elements.map(entry).collect();
    Ok(Value::Object(entries))
}

/// A matrix, a list of numbers, a number or a text.
fn value(node: Node) -> Value {
    if let Some(data) = child(node, "data") {
        return json!({ "data": value_of_text(data.text().unwrap_or_default(), true) });
    }
    value_of_text(node.text().unwrap_or_default(), false)
}

fn value_of_text(text: &str, is_list: bool) -> Value {
    let numbers: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
    match numbers.as_deref() {
        Ok([number]) if !is_list => json!(number),
        Ok(numbers) if is_list || !numbers.is_empty() => json!(numbers),
        _ => json!(text.trim()),
    }
}
