//! Entries of a calibration by the names that programs give them.

use serde_json::Value;

/// The entries of a tree at its top, and those of the objects there, by their names without
/// capitals and signs: `Camera_Matrix` and `cameraMatrix` are `cameramatrix`.
pub struct NamedEntries<'a>(Vec<(String, &'a Value)>);

impl<'a> NamedEntries<'a> {
    /// The entries of a tree, those at the top first.
    pub fn of(tree: &'a Value) -> Self {
        let top = || tree.as_object().into_iter().flatten();
        let is_matrix = |value: &Value| value.get("data").is_some();
        let parts = top().filter(|(_, value)| !is_matrix(value));
        let inner = parts.flat_map(|(_, value)| value.as_object().into_iter().flatten());
        let named = |(name, value): (&String, &'a Value)| (plain(name), value);
        Self(top().chain(inner).map(named).collect())
    }

    /// The first entry under one of the names for which `is_so` holds, in the order of the names.
    pub fn find(&self, names: &[&str], is_so: impl Fn(&Value) -> bool) -> Option<&'a Value> {
        names.iter().find_map(|name| {
            let mut entries = self.0.iter();
            let found = entries.find(|(own, value)| own == name && is_so(value))?;
            Some(found.1)
        })
    }

    /// The first finite number under one of the names.
    pub fn number(&self, names: &[&str]) -> Option<f64> {
        let value = self.find(names, Value::is_number)?.as_f64();
        value.filter(|value| value.is_finite())
    }

    /// The first list of numbers, or matrix, under one of the names.
    pub fn list(&self, names: &[&str]) -> Option<&'a Value> {
        self.find(names, is_list)
    }

    /// The first text under one of the names.
    pub fn text(&self, names: &[&str]) -> Option<&'a str> {
        self.find(names, Value::is_string)?.as_str()
    }
}

/// True for a list, or a matrix with `data`.
fn is_list(value: &Value) -> bool {
    value.get("data").unwrap_or(value).is_array()
}

/// The small letters and the digits of a name.
pub fn plain(name: &str) -> String {
    let kept = name.chars().filter(char::is_ascii_alphanumeric);
    kept.map(|c| c.to_ascii_lowercase()).collect()
}
