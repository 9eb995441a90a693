//! Arguments by which `ffprobe` and `ffmpeg` open a video, and nothing else.

use std::ffi::OsString;
use std::path::Path;

/// Formats that hold their pictures themselves. Playlists (`hls`, `dash`, `concat`, `sdp`) and
/// patterns of picture files (`image2`) name other files or addresses, which are not of the survey.
const FORMATS: &str = "mov,mp4,matroska,webm,avi,mpegts,mpeg,mpegvideo,m4v,h264,hevc,av1,obu,ivf,\
                       mjpeg,flv,asf,ogg,mxf,gxf,nut,dv,wtv,rm,yuv4mpegpipe,gif";

/// The arguments that open a local file as input, whatever its path looks like: without `file:`, a
/// folder `http:` would be an address, and a name that begins with `-` an option.
pub(super) fn input_arguments(path: &Path) -> Vec<OsString> {
    let mut url = OsString::from("file:");
    url.push(path);
    let options = [
        "-protocol_whitelist",
        "file",
        "-format_whitelist",
        FORMATS,
        "-i",
    ];
    options.into_iter().map(Into::into).chain([url]).collect()
}

/// True if the error output is of a format that is not read.
pub(super) fn is_refused_format(said: &str) -> bool {
    said.contains("not on whitelist")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_never_an_address_or_an_option() {
        for path in ["http:/host/a.mp4", "-dash/a.mp4", "a:b/c.mp4"] {
            let arguments = input_arguments(Path::new(path));
            assert_eq!(arguments[4], "-i");
            assert_eq!(arguments[5], *format!("file:{path}"));
        }
        for list in ["hls", "concat", "dash", "image2", "sdp"] {
            assert!(!FORMATS.split(',').any(|format| format == list));
        }
    }
}
