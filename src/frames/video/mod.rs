//! Frames out of a video, by the programs `ffprobe` and `ffmpeg`.
//!
//! `ffprobe` lists the pictures' times without decoding any ([`probe`]); `ffmpeg` decodes them into
//! a pipe ([`decoder`]): nothing is written to disk. A decoder runs forwards and is cheap to go on
//! with; a jump starts another at the key picture before. A picture is the one asked for because it
//! has that one's time, which the decoder tells with each.

mod decoder;
mod info;
mod probe;
mod stream;

pub use stream::Video;
