//! Requests to the viewer's server, through a connection; `PORT` and `TOKEN` in them become the
//! server's.

use super::super::small_survey;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::OnceLock;
use tunnelstitch::inspect::{Marks, Server, ServerContent, SourceFrames, Viewer};
use tunnelstitch::render::place_frames;
use tunnelstitch::survey::Survey;

/// Port and token of a server that runs until the process ends.
fn address() -> &'static [String; 2] {
    static ADDRESS: OnceLock<[String; 2]> = OnceLock::new();
    ADDRESS.get_or_init(|| {
        let survey = Survey::open(small_survey()).unwrap();
        let surface = survey.surface.as_ref();
        let placed = place_frames(
            surface,
            &survey.cameras,
            &survey.initial_poses(),
            &survey.shutter(),
        )
        .unwrap();
        let folder = tempfile::tempdir().unwrap().keep();
        std::fs::write(folder.join("tile.webp"), "tile").unwrap();
        let served = ServerContent {
            marks: Marks::open(&folder).unwrap(),
            folder,
            viewer: Viewer {
                page: b"page",
                style: b"style",
                script: b"script",
            },
            source_frames: Some(SourceFrames {
                surface: survey.surface,
                cameras: survey.cameras,
                frames: survey.frames,
                placements: vec![("initial".to_owned(), placed)],
            }),
        };
        let server = Server::listen(served, 0).unwrap();
        let address = server.address();
        std::thread::spawn(move || server.run());
        let rest = address.rsplit(':').next().unwrap();
        let (port, token) = rest.trim_end_matches('/').split_once('/').unwrap();
        [port, token].map(str::to_owned)
    })
}

/// Replaces a word.
fn replaced(text: &[u8], word: &[u8], by: &str) -> Vec<u8> {
    let (mut to, mut rest) = (Vec::new(), text);
    while let Some(at) = rest.windows(word.len()).position(|found| found == word) {
        to.extend_from_slice(&rest[..at]);
        to.extend_from_slice(by.as_bytes());
        rest = &rest[at + word.len()..];
    }
    to.extend_from_slice(rest);
    to
}

/// Reads the input.
pub fn run(data: &[u8]) {
    let [port, token] = address();
    let request = replaced(&replaced(data, b"PORT", port), b"TOKEN", token);
    let mut stream = TcpStream::connect(format!("127.0.0.1:{port}")).unwrap();
    // The server may answer and close the connection before everything is sent.
    let _ = stream.write_all(&request);
    let _ = stream.shutdown(Shutdown::Write);
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    assert!(answer.is_empty() || answer.starts_with(b"HTTP/1.1 "));
}
