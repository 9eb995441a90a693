//! HTTP server of the viewer: files of one folder, frames and marks, for this machine only.
//!
//! # Security
//!
//! The server listens on the loopback address, so that only programs of this machine can connect.
//! Any page that is open in a browser here can send requests, too, so a `Host` other than the
//! server's own is refused (DNS rebinding), and requests that change marks must come from the
//! server's own page (cross-site request forgery; `Request::authorise`). Paths are plain names
//! below the folder without any decoding, and the files that they lead to must lie in the folder.
//! Nothing but the marks is written. Other programs and users of this machine can connect, too:
//! every path begins with a random token, which only the printed address has ([`token::Token`]).
//!
//! A connection has one request, a time for it, and a time for its answer, so that slow or idle
//! ones do not keep others waiting ([`connections::Connections`]).

mod connections;
mod files;
mod http_server;
mod request;
mod response;
mod token;

pub use http_server::{Server, ServerContent, SourceFrames};
