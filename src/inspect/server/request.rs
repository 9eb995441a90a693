//! Parsing and authorisation of HTTP requests.

use crate::inspect::server::response::Response;
use serde::de::DeserializeOwned;
use std::io::{BufRead, BufReader, Read};

/// Maximum size of a request's head, bytes.
const MAX_HEAD_BYTES: usize = 16 << 10;
/// Maximum size of a request's body, bytes.
const MAX_BODY_BYTES: usize = 1 << 20;
/// Maximum number of headers.
const MAX_HEADERS: usize = 64;

/// HTTP/1 request.
#[derive(Debug)]
pub(super) struct Request {
    pub(super) method: String,
    /// Path and query, not decoded.
    pub(super) target: String,
    headers: Vec<(String, String)>,
    body: Vec<u8>,
}

impl Request {
    /// Reads a request; `None` if the connection ends or times out.
    ///
    /// # Errors
    /// The response to an invalid or too long request.
    pub(super) fn read(stream: impl Read) -> Result<Option<Self>, Response> {
        let mut reader = BufReader::new(stream);
        let mut head = Vec::new();
        // Line by line up to the empty line.
        while !head.ends_with(b"\r\n\r\n") {
            let room = (MAX_HEAD_BYTES - head.len()) as u64;
            if room == 0 {
                return Err(Response::refuse(431, "the head is too long"));
            }
            match reader.by_ref().take(room).read_until(b'\n', &mut head) {
                Ok(0) | Err(_) => return Ok(None),
                Ok(_) => {}
            }
        }
        let mut request = Self::parse(&head)
            .ok_or_else(|| Response::refuse(400, "this is not a valid request"))?;
        let length = match (
            request.header("Content-Length"),
            request.has_header("Content-Length"),
        ) {
            (Some(length), _) => length
                .parse()
                .map_err(|_| Response::refuse(400, "the length is not a number"))?,
            (None, false) => 0,
            (None, true) => return Err(Response::refuse(400, "the length was sent twice")),
        };
        if request.has_header("Transfer-Encoding") {
            return Err(Response::refuse(411, "bodies are sent with their length"));
        }
        if length > MAX_BODY_BYTES {
            return Err(Response::refuse(413, "the body is too long"));
        }
        request.body = vec![0; length];
        match reader.read_exact(&mut request.body) {
            Ok(()) => Ok(Some(request)),
            Err(_) => Ok(None),
        }
    }

    /// Parses the head of a request.
    fn parse(head: &[u8]) -> Option<Self> {
        let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
        let mut parsed = httparse::Request::new(&mut headers);
        parsed
            .parse(head)
            .ok()
            .filter(|status| status.is_complete())?;
        let texts = parsed.headers.iter().map(|header| {
            let value = std::str::from_utf8(header.value).ok()?;
            Some((header.name.to_owned(), value.to_owned()))
        });
        Some(Self {
            method: parsed.method?.to_owned(),
            target: parsed.path?.to_owned(),
            headers: texts.collect::<Option<_>>()?,
            body: Vec::new(),
        })
    }

    /// True if a header was sent.
    fn has_header(&self, name: &str) -> bool {
        self.headers
            .iter()
            .any(|(key, _)| key.eq_ignore_ascii_case(name))
    }

    /// The value of a header that was sent exactly once; two would be ambiguous.
    fn header(&self, name: &str) -> Option<&str> {
        let mut found = self
            .headers
            .iter()
            .filter(|(key, _)| key.eq_ignore_ascii_case(name));
        match (found.next(), found.next()) {
            (Some((_, value)), None) => Some(value),
            _ => None,
        }
    }

    /// True for a request without side effects.
    pub(super) fn is_read(&self) -> bool {
        matches!(self.method.as_str(), "GET" | "HEAD")
    }

    /// Refuses requests that do not come from the server's own page.
    ///
    /// Refused are another `Host`, another page's `Origin`, and changes without the `Content-Type`
    /// that browsers do not let other pages send without a preflight request.
    ///
    /// # Errors
    /// The response to a refused request.
    pub(super) fn authorise(&self, port: u16) -> Result<(), Response> {
        if !self
            .header("Host")
            .is_some_and(|host| is_own_host(host, port))
        {
            return Err(Response::refuse(
                421,
                "this server answers for 127.0.0.1 and localhost only",
            ));
        }
        let origin = self
            .header("Origin")
            .and_then(|origin| origin.strip_prefix("http://"));
        if self.has_header("Origin") && !origin.is_some_and(|host| is_own_host(host, port)) {
            return Err(Response::refuse(
                403,
                "requests from other pages are refused",
            ));
        }
        if !self.is_read() && self.header("Content-Type") != Some("application/json") {
            return Err(Response::refuse(
                415,
                "changes are sent as application/json",
            ));
        }
        Ok(())
    }

    /// Parses the body as JSON.
    ///
    /// # Errors
    /// The response to an invalid body.
    pub(super) fn json<T: DeserializeOwned>(&self) -> Result<T, Response> {
        serde_json::from_slice(&self.body)
            .map_err(|error| Response::refuse(400, &error.to_string()))
    }
}

/// True if `host` is a name of this server.
fn is_own_host(host: &str, port: u16) -> bool {
    ["127.0.0.1", "localhost"]
        .iter()
        .any(|name| host == format!("{name}:{port}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_its_own_names_are_accepted() {
        for own in ["127.0.0.1:7770", "localhost:7770"] {
            assert!(is_own_host(own, 7770));
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
            assert!(!is_own_host(other, 7770), "{other}");
        }
    }

    #[test]
    fn an_invalid_request_is_refused() {
        let good = Request::parse(b"GET /a?b=c HTTP/1.1\r\nHost: x\r\nhost: y\r\n\r\n").unwrap();
        assert_eq!(
            (good.method.as_str(), good.target.as_str()),
            ("GET", "/a?b=c")
        );
        assert!(good.has_header("HOST") && good.header("Host").is_none());
        for bad in [
            &b"GET\r\n\r\n"[..],
            b"\xff\xfe\r\n\r\n",
            b"GET / HTTP/1.1\r\nHost: \xff\r\n\r\n",
            b"GET / HTTP/2.0\r\n\r\n",
        ] {
            assert!(Request::parse(bad).is_none(), "{bad:?}");
        }
    }
}
