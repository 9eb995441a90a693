//! Requests to the viewer's server, through a connection; `PORT` in them becomes the server's.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::io::{Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::OnceLock;
use tunnelstitch::inspect::{Marks, Server, ServerContent, SourceFrames, Viewer};
use tunnelstitch::render::place;
use tunnelstitch::survey::Survey;
use tunnelstitch_fuzz::small_survey;

/// The port of a server that runs until the process ends.
fn port() -> &'static str {
    static PORT: OnceLock<String> = OnceLock::new();
    PORT.get_or_init(|| {
        let survey = Survey::open(small_survey()).unwrap();
        let surface = survey.surface.as_ref();
        let placed = place(
            surface,
            &survey.camera,
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
                camera: survey.camera,
                frames: survey.frames,
                placements: vec![("initial".to_owned(), placed)],
            }),
        };
        let server = Server::listen(served, 0).unwrap();
        let address = server.address();
        std::thread::spawn(move || server.run());
        let port = address.rsplit(':').next().unwrap();
        port.trim_end_matches('/').to_owned()
    })
}

fuzz_target!(|data: &[u8]| {
    let mut request = Vec::new();
    let mut rest = data;
    while let Some(at) = rest.windows(4).position(|word| word == b"PORT") {
        request.extend_from_slice(&rest[..at]);
        request.extend_from_slice(port().as_bytes());
        rest = &rest[at + 4..];
    }
    request.extend_from_slice(rest);
    let mut stream = TcpStream::connect(format!("127.0.0.1:{}", port())).unwrap();
    // The server may answer and close the connection before everything is sent.
    let _ = stream.write_all(&request);
    let _ = stream.shutdown(Shutdown::Write);
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    assert!(answer.is_empty() || answer.starts_with(b"HTTP/1.1 "));
});
