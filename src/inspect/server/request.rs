//! Which requests are answered.

use super::reply::Reply;
use serde::de::DeserializeOwned;
use std::io::Read;
use tiny_http::{Method, Request};

/// The largest body, bytes.
const MOST_BYTES: u64 = 1 << 20;

fn header<'r>(request: &'r Request, name: &'static str) -> Option<&'r str> {
    let mut found = request
        .headers()
        .iter()
        .filter(|header| header.field.equiv(name));
    let first = found.next()?;
    // Of two, nobody knows which counts.
    found.next().is_none().then(|| first.value.as_str())
}

/// Whether `host` is this server's own name.
fn is_own(host: &str, port: u16) -> bool {
    ["127.0.0.1", "localhost"]
        .iter()
        .any(|name| host == format!("{name}:{port}"))
}

/// Refuses what does not come from this machine's user: another `Host`, another page's `Origin`, and changes without the
/// `Content-Type` that a browser lets no other page send unasked.
pub(super) fn check(request: &Request, port: u16) -> Result<(), Reply> {
    if !header(request, "Host").is_some_and(|host| is_own(host, port)) {
        return Err(Reply::refuse(
            421,
            "this server answers for 127.0.0.1 and localhost only",
        ));
    }
    let has_origin = request
        .headers()
        .iter()
        .any(|header| header.field.equiv("Origin"));
    let own_origin = header(request, "Origin")
        .and_then(|origin| origin.strip_prefix("http://"))
        .is_some_and(|host| is_own(host, port));
    if has_origin && !own_origin {
        return Err(Reply::refuse(403, "another page has no business here"));
    }
    let reads = matches!(request.method(), Method::Get | Method::Head);
    let is_json = header(request, "Content-Type") == Some("application/json");
    if !reads && !is_json {
        return Err(Reply::refuse(415, "changes are sent as application/json"));
    }
    Ok(())
}

/// The body of a request.
pub(super) fn json<T: DeserializeOwned>(request: &mut Request) -> Result<T, Reply> {
    let mut body = Vec::new();
    let read = request
        .as_reader()
        .take(MOST_BYTES + 1)
        .read_to_end(&mut body);
    if read.is_err() || body.len() as u64 > MOST_BYTES {
        return Err(Reply::refuse(413, "the body is too long or broken off"));
    }
    serde_json::from_slice(&body).map_err(|error| Reply::refuse(400, &error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_its_own_names_are_its_own() {
        for own in ["127.0.0.1:7770", "localhost:7770"] {
            assert!(is_own(own, 7770));
        }
        for other in [
            "127.0.0.1",
            "localhost",
            "127.0.0.1:80",
            "evil.example:7770",
            "127.0.0.1:7770.evil.example",
            "",
            "127.1:7770",
        ] {
            assert!(!is_own(other, 7770), "{other}");
        }
    }
}
