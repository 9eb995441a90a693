//! HTTP responses and their headers.

use serde::Serialize;
use std::io::Write;

/// HTTP response.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Response {
    pub(super) status: u16,
    kind: &'static str,
    body: Vec<u8>,
}

/// Content security policy: only own resources, and no embedding in other pages.
///
/// three.js decodes images from blobs.
const POLICY: &str = "default-src 'self'; img-src 'self' blob: data:; \
                      connect-src 'self' blob: data:; style-src 'self' 'unsafe-inline'; \
                      frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

impl Response {
    /// A successful response of a media type.
    pub(super) fn ok(kind: &'static str, body: Vec<u8>) -> Self {
        Self {
            status: 200,
            kind,
            body,
        }
    }

    /// A successful JSON response.
    pub(super) fn json(value: &impl Serialize) -> Self {
        match serde_json::to_vec(value) {
            Ok(body) => Self::ok("application/json", body),
            Err(error) => Self::refuse(500, &error.to_string()),
        }
    }

    /// An error response with its reason.
    pub(super) fn refuse(status: u16, why: &str) -> Self {
        let body = format!("{why}\n").into_bytes();
        Self {
            status,
            kind: "text/plain; charset=utf-8",
            body,
        }
    }

    /// The response to a change of what somebody else has changed: both versions, as JSON.
    pub(super) fn conflict(versions: &impl Serialize) -> Self {
        Self {
            status: 409,
            ..Self::json(versions)
        }
    }

    /// The response for an unknown path.
    pub(super) fn not_found() -> Self {
        Self::refuse(404, "there is nothing of that name")
    }

    /// Writes the response as the only one of its connection; `body`: the body is written, too.
    ///
    /// # Errors
    /// An [`std::io::Error`] if the connection is closed.
    pub(super) fn write(&self, stream: &mut impl Write, body: bool) -> std::io::Result<()> {
        let mut head = format!("HTTP/1.1 {} {}\r\n", self.status, reason(self.status));
        let length = self.body.len().to_string();
        for (name, value) in [
            ("Content-Type", self.kind),
            ("Content-Length", &length),
            ("Connection", "close"),
            ("Content-Security-Policy", POLICY),
            ("X-Content-Type-Options", "nosniff"),
            ("Cross-Origin-Resource-Policy", "same-origin"),
            ("Referrer-Policy", "no-referrer"),
            // Tiles of other poses may have the same names.
            ("Cache-Control", "no-cache"),
        ] {
            head += &format!("{name}: {value}\r\n");
        }
        head += "\r\n";
        stream.write_all(head.as_bytes())?;
        if body {
            stream.write_all(&self.body)?;
        }
        stream.flush()
    }
}

/// Reason phrase of a status.
fn reason(status: u16) -> &'static str {
    match status {
        200 => "OK",
        400 => "Bad Request",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        409 => "Conflict",
        411 => "Length Required",
        413 => "Content Too Large",
        415 => "Unsupported Media Type",
        421 => "Misdirected Request",
        431 => "Request Header Fields Too Large",
        _ => "Internal Server Error",
    }
}
