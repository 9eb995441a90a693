//! HTTP server of the viewer: files of one folder, frames and marks, for this machine only.
//!
//! # Security
//!
//! The server listens on the loopback address, so that only programs of this machine can connect.
//! Any page that is open in a browser here can send requests, too, so a `Host` other than the
//! server's own is refused (DNS rebinding), and requests that change marks must come from the
//! server's own page (cross-site request forgery; `Request::authorise`). Paths are plain names
//! below the folder without any decoding, and the files that they lead to must lie in the folder.
//! Nothing but the marks is written.

mod files;
mod http_server;
mod request;
mod response;

pub use http_server::{Server, ServerContent, SourceFrames};
