//! A running `view`, asked by requests.

use super::{blender_survey, succeed, text};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// A server, ended with this.
pub struct Running {
    child: Child,
    /// The port.
    pub port: u16,
    /// The token of its addresses.
    pub token: String,
}

impl Running {
    /// Starts `view` at a free port and waits until it listens.
    pub fn start(arguments: &[&str]) -> Self {
        Self::run(Command::new(env!("CARGO_BIN_EXE_tunnelstitch")), arguments).expect("an address")
    }

    /// As [`start`](Self::start), by a command that runs the program; None if it ends without
    /// listening.
    pub fn run(mut program: Command, arguments: &[&str]) -> Option<Self> {
        let view = program.arg("view").args(arguments).args(["--port", "0"]);
        let mut child = view
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let out = BufReader::new(child.stdout.take().expect("its output"));
        let address = out
            .lines()
            .map_while(Result::ok)
            .find_map(|line| line.strip_prefix("http://127.0.0.1:").map(str::to_owned));
        let Some(address) = address else {
            let _ = child.wait();
            return None;
        };
        let (port, rest) = address.split_once('/').expect("a path");
        let token = rest.split('/').next().unwrap().to_owned();
        assert_eq!(token.len(), 32, "{rest}");
        let port = port.parse().expect("a port");
        Some(Self { child, port, token })
    }

    /// The address of its page.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/{}/", self.port, self.token)
    }

    /// Sends a request letter by letter as it is given; status and body of the answer.
    pub fn send(&self, request: &str) -> (u16, String) {
        let mut answer = Vec::new();
        let mut exchange = || {
            let mut stream = TcpStream::connect(("127.0.0.1", self.port))?;
            stream.write_all(request.as_bytes())?;
            stream.read_to_end(&mut answer)
        };
        // A server that ends meanwhile has given no answer, whose status is 0.
        let _ = exchange();
        let answer = String::from_utf8_lossy(&answer).into_owned();
        let status = answer
            .split(' ')
            .nth(1)
            .and_then(|s| s.parse().ok())
            .unwrap_or(0);
        let body = answer
            .split_once("\r\n\r\n")
            .map_or(String::new(), |(_, body)| body.to_owned());
        (status, body)
    }

    /// Sends a request with the correct host and token.
    pub fn ask(&self, line: &str, headers: &str, body: &str) -> (u16, String) {
        let length = body.len();
        let line = line.replacen(" /", &format!(" /{}/", self.token), 1);
        self.send(&format!(
            "{line} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nConnection: close\r\n\
             Content-Length: {length}\r\n{headers}\r\n{body}",
            self.port
        ))
    }
}

impl Drop for Running {
    /// Without a warning, as in a crash.
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Header of a request with a mark.
pub const JSON: &str = "Content-Type: application/json\r\n";

/// A mark with an identifier.
pub fn mark(id: &str) -> String {
    format!(
        r#"{{"type":"Feature","id":"{id}",
        "geometry":{{"type":"Point","coordinates":[2.0,1.5]}},
        "properties":{{"class":"BAB","severity":3,"note":"","chainage_m":2.0,"clock":"4:30",
        "theta_deg":135.0,"x_m":1.0,"y_m":2.0,"z_m":0.0,"layer":"truth","created":""}}}}"#
    )
}

/// A folder of the page that `export --web` has written, with so many pixels per metre of wall.
pub fn export_site(folder: &Path, px_per_metre: &str) -> PathBuf {
    let site = folder.join("site");
    let survey = blender_survey();
    let export = [
        "export",
        text(&survey),
        "--poses",
        "truth",
        "--layers",
        "truth",
    ];
    let options = [
        "--px-per-metre",
        px_per_metre,
        "--web",
        text(&site),
        "--quiet",
    ];
    succeed(&[&export[..], &options].concat());
    site
}
