//! Requests as they come over a connection, and which of them are answered.

use super::reply::Reply;
use serde::de::DeserializeOwned;
use std::io::{BufRead, BufReader, Read};
use std::net::TcpStream;

/// The longest head and body, bytes, and the most headers.
const MOST_HEAD: usize = 16 << 10;
const MOST_BODY: usize = 1 << 20;
const MOST_HEADERS: usize = 64;

/// A request of HTTP/1.
#[derive(Debug)]
pub(super) struct Request {
    pub(super) method: String,
    /// Path and query, as sent.
    pub(super) target: String,
    headers: Vec<(String, String)>,
    body: Vec<u8>,
}

impl Request {
    /// Reads a request; nothing if the connection ends or is not in time.
    ///
    /// # Errors
    /// The answer to what is none, or too long.
    pub(super) fn read(stream: &TcpStream) -> Result<Option<Self>, Reply> {
        let mut reader = BufReader::new(stream);
        let mut head = Vec::new();
        // Line by line up to the empty one.
        while !head.ends_with(b"\r\n\r\n") {
            let room = (MOST_HEAD - head.len()) as u64;
            if room == 0 {
                return Err(Reply::refuse(431, "the head is too long"));
            }
            match reader.by_ref().take(room).read_until(b'\n', &mut head) {
                Ok(0) | Err(_) => return Ok(None),
                Ok(_) => {}
            }
        }
        let mut request =
            Self::parse(&head).ok_or_else(|| Reply::refuse(400, "this is no request"))?;
        let length = match (
            request.header("Content-Length"),
            request.has("Content-Length"),
        ) {
            (Some(length), _) => length
                .parse()
                .map_err(|_| Reply::refuse(400, "the length is no number"))?,
            (None, false) => 0,
            (None, true) => return Err(Reply::refuse(400, "the length was sent twice")),
        };
        if request.has("Transfer-Encoding") {
            return Err(Reply::refuse(411, "bodies are sent with their length"));
        }
        if length > MOST_BODY {
            return Err(Reply::refuse(413, "the body is too long"));
        }
        request.body = vec![0; length];
        match reader.read_exact(&mut request.body) {
            Ok(()) => Ok(Some(request)),
            Err(_) => Ok(None),
        }
    }

    fn parse(head: &[u8]) -> Option<Self> {
        let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
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

    fn has(&self, name: &str) -> bool {
        self.headers
            .iter()
            .any(|(key, _)| key.eq_ignore_ascii_case(name))
    }

    /// The value of a header that was sent once: of two, nobody knows which counts.
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

    /// Whether it asks only.
    pub(super) fn reads(&self) -> bool {
        matches!(self.method.as_str(), "GET" | "HEAD")
    }

    /// Refuses what does not come from this machine's user: another `Host`, another page's
    /// `Origin`, and changes without the `Content-Type` that a browser lets no other page send
    /// unasked.
    ///
    /// # Errors
    /// The answer.
    pub(super) fn check(&self, port: u16) -> Result<(), Reply> {
        if !self.header("Host").is_some_and(|host| is_own(host, port)) {
            return Err(Reply::refuse(
                421,
                "this server answers for 127.0.0.1 and localhost only",
            ));
        }
        let origin = self
            .header("Origin")
            .and_then(|origin| origin.strip_prefix("http://"));
        if self.has("Origin") && !origin.is_some_and(|host| is_own(host, port)) {
            return Err(Reply::refuse(403, "another page has no business here"));
        }
        if !self.reads() && self.header("Content-Type") != Some("application/json") {
            return Err(Reply::refuse(415, "changes are sent as application/json"));
        }
        Ok(())
    }

    /// The body.
    ///
    /// # Errors
    /// The answer to one that is something else.
    pub(super) fn json<T: DeserializeOwned>(&self) -> Result<T, Reply> {
        serde_json::from_slice(&self.body).map_err(|error| Reply::refuse(400, &error.to_string()))
    }
}

/// Whether `host` is this server's own name.
fn is_own(host: &str, port: u16) -> bool {
    ["127.0.0.1", "localhost"]
        .iter()
        .any(|name| host == format!("{name}:{port}"))
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

    #[test]
    fn what_is_no_request_is_none() {
        let good = Request::parse(b"GET /a?b=c HTTP/1.1\r\nHost: x\r\nhost: y\r\n\r\n").unwrap();
        assert_eq!(
            (good.method.as_str(), good.target.as_str()),
            ("GET", "/a?b=c")
        );
        assert!(good.has("HOST") && good.header("Host").is_none());
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
