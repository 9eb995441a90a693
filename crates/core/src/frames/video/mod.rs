//! Frames from videos, by the programs `ffprobe` and `ffmpeg`.
//!
//! `ffprobe` lists the pictures' times without decoding any ([`probe`]); `ffmpeg` decodes them into
//! a pipe ([`decoder`]); nothing is written to disk. A decoder runs forwards; a jump starts another
//! one at the preceding key picture. Each decoded picture is identified by its time, which `ffmpeg`
//! reports with it.

mod decoder;
mod info;
mod input;
mod probe;
mod stream;

pub use stream::Video;
