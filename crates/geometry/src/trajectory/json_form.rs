//! The form of JSON that is no file of poses known here, in words.

use serde_json::Value;

/// Largest number of keys that are named.
const MAX_KEYS: usize = 6;

/// Forms that are read.
const KNOWN: &str = "JSON is read from nerfstudio and Instant NGP (`frames` with `file_path` and \
                     `transform_matrix`), Meshroom (`views` and `poses`), OpenMVG (`views` and \
                     `extrinsics`), OpenSfM (a list with `cameras` and `shots`) and Open3D (a \
                     `PoseGraph` or `PinholeCameraTrajectory`)";
/// The way for all others.
const REMEDY: &str = "write the poses as one of these, or as CSV with \
                      `name,tx_m,ty_m,tz_m,qx,qy,qz,qw` in its first line, camera to world";

/// The keys of a JSON text, the forms that are read, and the remedy; None if it is no JSON object
/// or list.
pub(super) fn explain(text: &str) -> Option<String> {
    let mut values = serde_json::Deserializer::from_str(text).into_iter::<Value>();
    let found = describe(&values.next()?.ok()?)?;
    let lines = match values.next() {
        Some(_) => " (of the first of several values)",
        None => "",
    };
    Some(format!(
        "is JSON of another form: {found}{lines}; {KNOWN}; {REMEDY}"
    ))
}

/// The error of the parser of one form; of JSON that lacks something, with what it has instead.
pub(super) fn mismatch(text: &str, error: &serde_json::Error) -> String {
    match explain(text).filter(|_| error.is_data()) {
        Some(form) => format!("{form} ({error})"),
        None => error.to_string(),
    }
}

/// The keys of an object, or of the first object in a list; those of what it holds follow if it
/// has no more than one list or object.
fn describe(value: &Value) -> Option<String> {
    match value {
        Value::Object(map) if map.is_empty() => Some("it has no keys".to_owned()),
        Value::Object(map) => {
            let names = map.keys().take(MAX_KEYS).map(|key| format!("`{key}`"));
            let names = names.collect::<Vec<_>>().join(", ");
            let more = match map.len().saturating_sub(MAX_KEYS) {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            let inner = map.iter().find_map(|(key, inner)| {
                let keys = first_object(inner).and_then(describe_flat)?;
                Some(format!("; in `{key}`: {keys}"))
            });
            Some(format!(
                "its keys are {names}{more}{}",
                inner.unwrap_or_default()
            ))
        }
        Value::Array(list) => match list.first() {
            None => Some("it is an empty list".to_owned()),
            Some(first) => Some(match describe_flat(first) {
                Some(keys) => format!("it is a list of objects with {keys}"),
                None => "it is a list without keys".to_owned(),
            }),
        },
        _ => None,
    }
}

/// The object itself, or the first one in a list.
fn first_object(value: &Value) -> Option<&Value> {
    match value {
        Value::Object(_) => Some(value),
        Value::Array(list) => list.first().filter(|first| first.is_object()),
        _ => None,
    }
}

/// The first keys of an object; None for anything else, and for one without keys.
fn describe_flat(value: &Value) -> Option<String> {
    let map = value.as_object().filter(|map| !map.is_empty())?;
    let names = map.keys().take(MAX_KEYS).map(|key| format!("`{key}`"));
    Some(names.collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_named_at_the_top_and_below() {
        let said = |text: &str| explain(text).unwrap();
        let poses = said(r#"{"version": 1, "camera_poses": [{"image": "a.png", "T_wc": []}]}"#);
        assert!(
            poses.contains("`camera_poses`, `version`; in `camera_poses`: `T_wc`, `image`"),
            "{poses}"
        );
        let list = said(r#"[{"file": "a.png", "pose": []}]"#);
        assert!(
            list.contains("a list of objects with `file`, `pose`"),
            "{list}"
        );
        assert!(said("[[1, 0], [0, 1]]").contains("a list without keys"));
        assert!(said("{}").contains("no keys") && said("[]").contains("empty list"));
        let many: String = (0..9).map(|k| format!("\"k{k}\": 0,")).collect();
        assert!(said(&format!("{{{}\"z\": 1}}", many)).contains("and 4 more"));
        assert_eq!(explain("1 0 0 0"), None);
        assert_eq!(explain("{broken"), None);
        assert!(said("{\"t\": 0}\n{\"t\": 1}").contains("`t` (of the first of several"));
    }
}
