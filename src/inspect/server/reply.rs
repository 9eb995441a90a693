//! Answers and their headers.

use serde::Serialize;
use std::io::Cursor;
use tiny_http::{Header, Response};

/// An answer.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Reply {
    pub(super) status: u16,
    kind: &'static str,
    body: Vec<u8>,
}

/// Scripts and everything else from here only, and in no frame of another page. three.js decodes pictures from blobs.
const POLICY: &str = "default-src 'self'; img-src 'self' blob: data:; connect-src 'self' blob: data:; \
                      style-src 'self' 'unsafe-inline'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

impl Reply {
    pub(super) fn ok(kind: &'static str, body: Vec<u8>) -> Self {
        Self {
            status: 200,
            kind,
            body,
        }
    }

    pub(super) fn json(value: &impl Serialize) -> Self {
        match serde_json::to_vec(value) {
            Ok(body) => Self::ok("application/json", body),
            Err(error) => Self::refuse(500, &error.to_string()),
        }
    }

    pub(super) fn refuse(status: u16, why: &str) -> Self {
        let body = format!("{why}\n").into_bytes();
        Self {
            status,
            kind: "text/plain; charset=utf-8",
            body,
        }
    }

    pub(super) fn not_found() -> Self {
        Self::refuse(404, "there is nothing of that name")
    }

    pub(super) fn into_response(self) -> Response<Cursor<Vec<u8>>> {
        let headers = [
            ("Content-Type", self.kind),
            ("Content-Security-Policy", POLICY),
            ("X-Content-Type-Options", "nosniff"),
            ("Cross-Origin-Resource-Policy", "same-origin"),
            ("Referrer-Policy", "no-referrer"),
            // Tiles of another run may have the same names.
            ("Cache-Control", "no-cache"),
        ];
        let mut response = Response::from_data(self.body).with_status_code(self.status);
        for (name, value) in headers {
            // These are plain ASCII, so none is left out.
            if let Ok(header) = Header::from_bytes(name, value) {
                response.add_header(header);
            }
        }
        response
    }
}
