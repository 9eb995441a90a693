//! Numbers of JSON files.

use serde_json::Value;

/// The finite number that a value is, or that it has as text, as some programs write all of theirs.
pub fn number(value: &Value) -> Option<f64> {
    let number = match value {
        Value::String(text) => text.trim().parse().ok(),
        other => other.as_f64(),
    };
    number.filter(|number| number.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn numbers_may_be_texts() {
        assert_eq!(number(&json!("-1.5")), Some(-1.5));
        assert_eq!(number(&json!(2)), Some(2.0));
        for other in [json!("x"), json!("inf"), json!(null), json!([1])] {
            assert_eq!(number(&other), None);
        }
    }
}
