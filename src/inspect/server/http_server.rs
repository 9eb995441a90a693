//! HTTP server of the viewer: connections and routes.

use crate::camera::Cameras;
use crate::frames::FrameSet;
use crate::inspect::error::InspectError;
use crate::inspect::mark::Mark;
use crate::inspect::marks::Marks;
use crate::inspect::server::connections::{Connections, Place, Timed};
use crate::inspect::server::files;
use crate::inspect::server::request::Request;
use crate::inspect::server::response::Response;
use crate::inspect::server::token::Token;
use crate::inspect::viewer::Viewer;
use crate::render::{Placement, sightings};
use crate::surface::{Surface, WallPoint};
use serde_json::json;
use std::io::Read;
use std::net::{Ipv4Addr, Shutdown, TcpListener, TcpStream};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Time for a whole request.
const REQUEST_TIME: Duration = Duration::from_secs(10);
/// Time for a whole response, of some MiB at most.
const RESPONSE_TIME: Duration = Duration::from_secs(60);
/// Time in which the sender of a request is to read the response and close the connection.
const DRAIN_TIME: Duration = Duration::from_secs(2);
/// Pause after a connection that could not be accepted.
const ACCEPT_PAUSE: Duration = Duration::from_millis(50);

/// Maximum bytes of a refused request that are drained, so that its sender reads the response.
const MAX_DRAINED_BYTES: u64 = 8 << 20;

/// Source frames of the layers.
pub struct SourceFrames {
    /// The tunnel.
    pub surface: std::sync::Arc<dyn Surface>,
    /// The cameras.
    pub cameras: Cameras,
    /// The frames.
    pub frames: FrameSet,
    /// Names of the layers with the placements of the frames.
    pub placements: Vec<(String, Vec<Placement>)>,
}

/// Content of a server.
pub struct ServerContent {
    /// Folder of the manifest and tiles.
    pub folder: PathBuf,
    /// The page.
    pub viewer: Viewer,
    /// The frames, if available.
    pub source_frames: Option<SourceFrames>,
    /// The marks.
    pub marks: Marks,
}

/// Listening HTTP server.
pub struct Server {
    listener: TcpListener,
    port: u16,
    token: Token,
    connections: Connections,
    folder: PathBuf,
    viewer: Viewer,
    source_frames: Option<SourceFrames>,
    marks: Mutex<Marks>,
}

impl Server {
    /// Listens on 127.0.0.1 at `port` (0 for any free port).
    ///
    /// # Errors
    /// [`InspectError::Listen`]; [`InspectError::Folder`] for a missing folder.
    pub fn listen(content: ServerContent, port: u16) -> Result<Self, InspectError> {
        let fail = |error: std::io::Error| InspectError::Listen {
            port,
            what: error.to_string(),
        };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(fail)?;
        let port = listener.local_addr().map_err(fail)?.port();
        let folder = content
            .folder
            .canonicalize()
            .map_err(|error| InspectError::Folder {
                path: content.folder.clone(),
                what: error.to_string(),
            })?;
        Ok(Self {
            listener,
            port,
            token: Token::random(),
            connections: Connections::default(),
            folder,
            viewer: content.viewer,
            source_frames: content.source_frames,
            marks: Mutex::new(content.marks),
        })
    }

    /// The server's address for a browser, with the token without which requests are refused.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/{}/", self.port, self.token.text())
    }

    /// Serves requests until the program ends.
    pub fn run(&self) {
        std::thread::scope(|scope| {
            loop {
                let Ok((stream, _)) = self.listener.accept() else {
                    // Aborted connections are not errors; too many open files may be closed soon.
                    std::thread::sleep(ACCEPT_PAUSE);
                    continue;
                };
                if let Ok(place) = self.connections.admit(&stream) {
                    let serve = move || self.serve(&stream, &place);
                    // Without a thread, the connection is closed.
                    let _ = std::thread::Builder::new().spawn_scoped(scope, serve);
                }
            }
        });
    }

    /// Reads a request and writes its response.
    fn serve(&self, stream: &TcpStream, place: &Place) -> std::io::Result<()> {
        stream.set_nodelay(true)?;
        let read = Request::read(Timed::new(stream, REQUEST_TIME));
        if !place.begin_answer() {
            return Ok(());
        }
        let mut writer = Timed::new(stream, RESPONSE_TIME);
        match read {
            Ok(None) => return Ok(()),
            Ok(Some(request)) => {
                let response = self.answer(&request);
                response.write(&mut writer, request.method != "HEAD")?;
            }
            Err(refused) => refused.write(&mut writer, true)?,
        }
        stream.shutdown(Shutdown::Write)?;
        place.end_answer();
        // Unread data would reset the connection before the response arrives.
        let rest = Timed::new(stream, DRAIN_TIME);
        std::io::copy(&mut rest.take(MAX_DRAINED_BYTES), &mut std::io::sink())?;
        Ok(())
    }

    /// Checks a request and routes it.
    fn answer(&self, request: &Request) -> Response {
        match (
            request.authorise(self.port),
            self.token.strip(&request.target),
        ) {
            (Err(refused), _) => refused,
            (Ok(()), Some(target)) => self.route(target, request),
            (Ok(()), None) => Response::refuse(
                403,
                "the address is not the one that tunnelstitch view has printed",
            ),
        }
    }

    /// Routes a request; `target` is behind the token.
    fn route(&self, target: &str, request: &Request) -> Response {
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        let read = request.is_read();
        match path.strip_prefix("/api/") {
            Some(path) => match (path.split_once('/').unwrap_or((path, "")), read) {
                (("marks", ""), true) => self.marks(),
                (("marks", id), false) => self.change_marks(id, request),
                (("sightings", ""), true) => self.sightings(query),
                (("frames", index), true) => self.frame(index),
                _ => Response::not_found(),
            },
            None if !read => Response::refuse(405, "only marks can be changed"),
            None => self.file(path),
        }
    }

    /// Responds with a file of the page or of the folder.
    fn file(&self, path: &str) -> Response {
        match path {
            "/" | "/index.html" => {
                Response::ok("text/html; charset=utf-8", self.viewer.page.into())
            }
            "/viewer.js" => {
                Response::ok("text/javascript; charset=utf-8", self.viewer.script.into())
            }
            "/viewer.css" => Response::ok("text/css; charset=utf-8", self.viewer.style.into()),
            "/server.json" => {
                Response::json(&json!({ "marks": true, "frames": self.source_frames.is_some() }))
            }
            _ => files::read_file(&self.folder, path),
        }
    }

    /// Responds with all marks.
    fn marks(&self) -> Response {
        let marks = self.marks.lock().unwrap_or_else(PoisonError::into_inner);
        match marks.geojson() {
            Ok(text) => Response::ok("application/geo+json", text.into_bytes()),
            Err(error) => Response::refuse(500, &error.to_string()),
        }
    }

    /// Saves or removes a mark.
    fn change_marks(&self, id: &str, request: &Request) -> Response {
        let mark = match request.method.as_str() {
            "PUT" => match request.json::<Mark>() {
                Ok(mark) if mark.id == id => Some(mark),
                Ok(_) => return Response::refuse(400, "the mark has another id than the address"),
                Err(refused) => return refused,
            },
            "DELETE" => None,
            _ => return Response::refuse(405, "marks are PUT or DELETEd"),
        };
        if let Some(Err(what)) = mark.as_ref().map(Mark::validate) {
            return Response::refuse(400, what);
        }
        let mut marks = self.marks.lock().unwrap_or_else(PoisonError::into_inner);
        let changed = match mark {
            Some(mark) => marks.put(mark),
            None => marks.remove(id),
        };
        match changed {
            Ok(()) => Response::json(&json!({ "saved": true })),
            Err(InspectError::MarkConflict { versions }) => Response::conflict(&versions),
            Err(error) => Response::refuse(500, &error.to_string()),
        }
    }

    /// Responds with the frames that show a point, the sharpest first: `?layer=NAME&s=M&h=M`.
    fn sightings(&self, query: &str) -> Response {
        let value = |name: &str| {
            query
                .split('&')
                .find_map(|pair| pair.split_once('=').filter(|(key, _)| *key == name))
        };
        let metres = |name: &str| value(name)?.1.parse::<f64>().ok().filter(|v| v.is_finite());
        let Some(source_frames) = &self.source_frames else {
            return Response::not_found();
        };
        let (Some((_, layer)), Some(s_m), Some(h_m)) = (value("layer"), metres("s"), metres("h"))
        else {
            return Response::refuse(400, "?layer=NAME&s=METRES&h=METRES is wanted");
        };
        let Some((_, placements)) = source_frames
            .placements
            .iter()
            .find(|(name, _)| name == layer)
        else {
            return Response::not_found();
        };
        let wall = WallPoint { s_m, h_m };
        let found = sightings(
            source_frames.surface.as_ref(),
            &source_frames.cameras,
            source_frames.frames.masks(),
            placements,
            wall,
        );
        Response::json(&json!(found))
    }

    /// Responds with the image of a frame.
    fn frame(&self, index: &str) -> Response {
        let Some(SourceFrames {
            cameras, frames, ..
        }) = &self.source_frames
        else {
            return Response::not_found();
        };
        let frame = index.parse::<usize>().ok().and_then(|k| frames.get(k));
        frame.map_or_else(Response::not_found, |frame| {
            files::read_frame(frame, cameras.size())
        })
    }
}
