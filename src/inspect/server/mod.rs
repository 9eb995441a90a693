//! The viewer's server: files of one folder, frames, and marks. For this machine only.
//!
//! **What it trusts.** Only programs of this machine can connect, since it listens on the loopback
//! address. But any page open in a browser here can send requests there, so: a `Host` other than
//! its own is refused (a name that was made to point here), and what changes marks must come from
//! its own page ([`Request::check`]). Paths are names below the folder, taken letter by letter;
//! nothing is decoded, and what they lead to must lie in it. Nothing is written but the marks.

mod files;
mod reply;
mod request;

use super::marks::{Mark, Marks};
use super::{InspectError, Viewer};
use crate::camera::Camera;
use crate::frames::FrameSet;
use crate::render::{Placement, sightings};
use crate::surface::{Surface, WallPoint};
use reply::Reply;
use request::Request;
use serde_json::json;
use std::io::Read;
use std::net::{Ipv4Addr, Shutdown, TcpListener, TcpStream};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Threads that answer, a connection each: more than a browser opens to one server.
const THREADS: usize = 12;

/// The longest silence on a connection.
const PATIENCE: Duration = Duration::from_secs(10);

/// Bytes of a refused request that are still read, so that its sender gets to the answer.
const DRAINED: u64 = 8 << 20;

/// The frames behind the layers.
pub struct Originals {
    /// The tunnel.
    pub surface: Box<dyn Surface>,
    /// The camera.
    pub camera: Camera,
    /// The frames.
    pub frames: FrameSet,
    /// Names of the layers, and where frames lie by them.
    pub placements: Vec<(String, Vec<Placement>)>,
}

/// What is served.
pub struct Served {
    /// The folder of the manifest and tiles.
    pub folder: PathBuf,
    /// The page.
    pub viewer: Viewer,
    /// The frames, where they are known.
    pub originals: Option<Originals>,
    /// The marks.
    pub marks: Marks,
}

/// A server that listens.
pub struct Server {
    listener: TcpListener,
    port: u16,
    folder: PathBuf,
    viewer: Viewer,
    originals: Option<Originals>,
    marks: Mutex<Marks>,
}

impl Server {
    /// Listens on 127.0.0.1 at `port` (0: any that is free).
    ///
    /// # Errors
    /// [`InspectError::Listen`]; a folder that is not there.
    pub fn listen(served: Served, port: u16) -> Result<Self, InspectError> {
        let fail = |error: std::io::Error| InspectError::Listen {
            port,
            what: error.to_string(),
        };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(fail)?;
        let port = listener.local_addr().map_err(fail)?.port();
        let folder = served
            .folder
            .canonicalize()
            .map_err(|error| InspectError::Folder {
                path: served.folder.clone(),
                what: error.to_string(),
            })?;
        Ok(Self {
            listener,
            port,
            folder,
            viewer: served.viewer,
            originals: served.originals,
            marks: Mutex::new(served.marks),
        })
    }

    /// Where a browser finds it.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/", self.port)
    }

    /// Answers until the program ends.
    pub fn run(&self) {
        std::thread::scope(|scope| {
            for _ in 0..THREADS {
                scope.spawn(|| {
                    loop {
                        // A connection that ends before it is there is no error, nor is a browser
                        // that has left.
                        if let Ok((stream, _)) = self.listener.accept() {
                            let _ = self.serve(stream);
                        }
                    }
                });
            }
        });
    }

    /// Reads a request and answers it.
    fn serve(&self, mut stream: TcpStream) -> std::io::Result<()> {
        stream.set_read_timeout(Some(PATIENCE))?;
        stream.set_write_timeout(Some(PATIENCE))?;
        stream.set_nodelay(true)?;
        match Request::read(&stream) {
            Ok(None) => return Ok(()),
            Ok(Some(request)) => {
                let reply = match request.check(self.port) {
                    Ok(()) => self.answer(&request),
                    Err(refused) => refused,
                };
                reply.write(&mut stream, request.method != "HEAD")?;
            }
            Err(refused) => refused.write(&mut stream, true)?,
        }
        stream.shutdown(Shutdown::Write)?;
        // What is left unread would break the connection before the answer arrives.
        std::io::copy(&mut stream.take(DRAINED), &mut std::io::sink())?;
        Ok(())
    }

    fn answer(&self, request: &Request) -> Reply {
        let target = request.target.as_str();
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        let read = request.reads();
        match path.strip_prefix("/api/") {
            Some(path) => match (path.split_once('/').unwrap_or((path, "")), read) {
                (("marks", ""), true) => self.marks(),
                (("marks", id), false) => self.change_marks(id, request),
                (("sightings", ""), true) => self.sightings(query),
                (("frames", index), true) => self.frame(index),
                _ => Reply::not_found(),
            },
            None if !read => Reply::refuse(405, "only marks can be changed"),
            None => self.file(path),
        }
    }

    fn file(&self, path: &str) -> Reply {
        match path {
            "/" | "/index.html" => Reply::ok("text/html; charset=utf-8", self.viewer.page.into()),
            "/viewer.js" => Reply::ok("text/javascript; charset=utf-8", self.viewer.script.into()),
            "/viewer.css" => Reply::ok("text/css; charset=utf-8", self.viewer.style.into()),
            "/server.json" => {
                Reply::json(&json!({ "marks": true, "frames": self.originals.is_some() }))
            }
            _ => files::read(&self.folder, path),
        }
    }

    fn marks(&self) -> Reply {
        let marks = self.marks.lock().unwrap_or_else(PoisonError::into_inner);
        match marks.geojson() {
            Ok(text) => Reply::ok("application/geo+json", text.into_bytes()),
            Err(error) => Reply::refuse(500, &error.to_string()),
        }
    }

    fn change_marks(&self, id: &str, request: &Request) -> Reply {
        let mark = match request.method.as_str() {
            "PUT" => match request.json::<Mark>() {
                Ok(mark) if mark.id == id => Some(mark),
                Ok(_) => return Reply::refuse(400, "the mark has another id than the address"),
                Err(refused) => return refused,
            },
            "DELETE" => None,
            _ => return Reply::refuse(405, "marks are PUT or DELETEd"),
        };
        let fault = mark.as_ref().and_then(Mark::fault);
        if let Some(what) = fault {
            return Reply::refuse(400, what);
        }
        let mut marks = self.marks.lock().unwrap_or_else(PoisonError::into_inner);
        let changed = match mark {
            Some(mark) => marks.put(mark),
            None => marks.remove(id),
        };
        match changed {
            Ok(()) => Reply::json(&json!({ "saved": true })),
            Err(error) => Reply::refuse(500, &error.to_string()),
        }
    }

    /// `?layer=NAME&s=M&h=M`: the frames that show a point, the sharpest first.
    fn sightings(&self, query: &str) -> Reply {
        let value = |name: &str| {
            query
                .split('&')
                .find_map(|pair| pair.split_once('=').filter(|(key, _)| *key == name))
        };
        let metres = |name: &str| value(name)?.1.parse::<f64>().ok().filter(|v| v.is_finite());
        let Some(originals) = &self.originals else {
            return Reply::not_found();
        };
        let (Some((_, layer)), Some(s_m), Some(h_m)) = (value("layer"), metres("s"), metres("h"))
        else {
            return Reply::refuse(400, "?layer=NAME&s=METRES&h=METRES is wanted");
        };
        let Some((_, placements)) = originals.placements.iter().find(|(name, _)| name == layer)
        else {
            return Reply::not_found();
        };
        let wall = WallPoint { s_m, h_m };
        let found = sightings(
            originals.surface.as_ref(),
            &originals.camera,
            originals.frames.mask().map(AsRef::as_ref),
            placements,
            wall,
        );
        Reply::json(&json!(found))
    }

    /// The picture of a frame, as the browser can show it.
    fn frame(&self, index: &str) -> Reply {
        let Some(Originals { camera, frames, .. }) = &self.originals else {
            return Reply::not_found();
        };
        let frame = index.parse::<usize>().ok().and_then(|k| frames.get(k));
        frame.map_or_else(Reply::not_found, |frame| files::picture(frame, camera))
    }
}
