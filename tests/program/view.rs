//! The viewer: its server from outside, and its page in a browser.

use crate::support::server::{JSON, Running, export_site, mark};
use crate::support::{blender_survey, fail, json, npm, text};
use serde_json::Value;
use std::io::Write;
use std::net::TcpStream;
use std::path::Path;
use std::time::{Duration, Instant};
use tunnelstitch::inspect::Viewer;

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn without_the_page_it_says_what_to_install() {
    if Viewer::bundled().is_err() {
        let message = fail(&["view", text(&blender_survey())], 2);
        assert!(message.contains("npm"), "{message}");
    }
}

#[test]
fn the_server_answers_its_own_page_and_writes_nothing_but_marks() {
    if npm::is_viewer_missing() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("secret.json"), "secret").unwrap();
    let site = export_site(dir.path(), "20");
    let before = names(&site);
    let server = Running::start(&[text(&site)]);
    let port = server.port;

    // Only this machine: no other address of it listens.
    assert!(TcpStream::connect(("127.0.0.2", port)).is_err());

    for (path, start) in [
        ("/", "<!doctype html>"),
        ("/tunnel.json", "{"),
        ("/truth/tileset.json", "{"),
        ("/server.json", "{"),
    ] {
        let (status, body) = server.ask(&format!("GET {path}"), "", "");
        assert!(
            status == 200 && body.starts_with(start),
            "{path}: {status} {body:.60}"
        );
    }

    // Another name for this machine, as a page elsewhere could have made for it, or none.
    for host in [
        "Host: evil.example\r\n".to_owned(),
        format!("Host: evil.example:{port}\r\n"),
        "Host: 127.0.0.1\r\n".to_owned(),
        String::new(),
        format!("Host: 127.0.0.1:{port}\r\nHost: evil.example\r\n"),
    ] {
        for path in ["/", "/tunnel.json", "/api/marks"] {
            let (status, body) = server.send(&format!(
                "GET {path} HTTP/1.1\r\n{host}Connection: close\r\n\r\n"
            ));
            assert!(
                matches!(status, 400 | 421) && !body.contains("Feature"),
                "{host} {path}: {status} {body}"
            );
        }
    }

    // Ways out of the folder.
    for path in [
        "/../secret.json",
        "/truth/../../secret.json",
        "/%2e%2e/secret.json",
        "/..%2fsecret.json",
        "/..\\secret.json",
        "//secret.json",
        "/./../secret.json",
        "/api/frames/0",
        "/api/frames/../../secret.json",
        "/api/../../secret.json",
        "/marks.geojson/../../secret.json",
        "/truth",
        "/.npmrc",
    ] {
        let (status, body) = server.ask(&format!("GET {path}"), "", "");
        assert!(
            matches!(status, 400 | 404) && !body.contains("secret\""),
            "{path}: {status} {body}"
        );
    }
    let absolute = dir.path().join("secret.json");
    let (status, _) = server.ask(&format!("GET {}", absolute.display()), "", "");
    assert_eq!(status, 404);

    // Changes by other pages, and of anything but marks.
    let put = "PUT /api/marks/a";
    let own = format!("Origin: http://127.0.0.1:{port}\r\n{JSON}");
    for (line, headers, body, expected) in [
        (
            put,
            "Content-Type: text/plain\r\n".to_owned(),
            mark("a"),
            415,
        ),
        (
            put,
            format!("Origin: http://evil.example\r\n{JSON}"),
            mark("a"),
            403,
        ),
        (put, format!("Origin: null\r\n{JSON}"), mark("a"), 403),
        ("POST /api/marks/a", own.clone(), mark("a"), 405),
        ("PUT /tunnel.json", own.clone(), "{}".to_owned(), 405),
        ("DELETE /tunnel.json", own.clone(), String::new(), 405),
        (put, own.clone(), mark("b"), 400),
        (put, own.clone(), "{".to_owned(), 400),
        ("PUT /api/marks/..", own.clone(), mark(".."), 400),
        (put, own.clone(), mark("a").replace(":3,", ":9,"), 400),
        (put, own.clone(), " ".repeat(2 << 20), 413),
    ] {
        let (status, said) = server.ask(line, &headers, &body);
        assert_eq!(status, expected, "{line} {headers}: {said}");
    }
    assert_eq!(names(&site), before);

    let (status, said) = server.ask(put, &own, &mark("a"));
    assert_eq!(status, 200, "{said}");
    let (_, said) = server.ask("GET /api/marks", "", "");
    assert!(said.contains("\"BAB\""), "{said}");
    let mut with_marks = before.clone();
    with_marks.extend(["marks.csv".to_owned(), "marks.geojson".to_owned()]);
    with_marks.sort();
    assert_eq!(names(&site), with_marks);
    assert_eq!(names(dir.path()), ["secret.json", "site"]);

    // A file of marks that somebody has spoilt is not overwritten.
    drop(server);
    std::fs::write(site.join("marks.geojson"), "[]").unwrap();
    let message = fail(&["view", text(&site), "--port", "0"], 3);
    assert!(
        message.contains("marks.geojson") && message.contains("move it away"),
        "{message}"
    );
}

#[test]
fn without_the_token_nothing_is_told() {
    if npm::is_viewer_missing() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let server = Running::start(&[text(&export_site(dir.path(), "10"))]);
    let host = format!("Host: 127.0.0.1:{}\r\n", server.port);
    let wrong = "0".repeat(32);
    for path in [
        "/",
        "/api/marks",
        "/tunnel.json",
        &format!("/{wrong}/api/marks"),
    ] {
        let (status, body) = server.send(&format!("GET {path} HTTP/1.1\r\n{host}\r\n"));
        assert_eq!(status, 403, "{path}: {body}");
    }
    assert_eq!(server.ask("GET /api/marks", "", "").0, 200);
}

/// Idle and slow connections, before and after their request, keep nobody waiting.
#[test]
fn others_do_not_wait_for_idle_connections() {
    if npm::is_viewer_missing() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let server = Running::start(&[text(&export_site(dir.path(), "10"))]);
    let connect = || TcpStream::connect(("127.0.0.1", server.port)).expect("a connection");
    let begun = Instant::now();
    let idle: Vec<TcpStream> = (0..200).map(|_| connect()).collect();
    assert_eq!(server.ask("GET /server.json", "", "").0, 200);
    let answered: Vec<TcpStream> = (0..80)
        .map(|_| {
            let mut stream = connect();
            let request = format!("GET /x HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n\r\n", server.port);
            // The server may have dropped it already.
            let _ = stream.write_all(request.as_bytes());
            stream
        })
        .collect();
    assert_eq!(server.ask("GET /server.json", "", "").0, 200);
    assert!(
        begun.elapsed() < Duration::from_secs(8),
        "{:?}",
        begun.elapsed()
    );
    // A letter now and then does not prolong the time for a request.
    let mut slow = connect();
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_secs(20) && slow.write_all(b"G").is_ok() {
        std::thread::sleep(Duration::from_millis(500));
    }
    assert!(
        begun.elapsed() < Duration::from_secs(15),
        "{:?}",
        begun.elapsed()
    );
    drop((idle, answered));
}

/// Two servers of one survey lose no mark.
#[test]
fn marks_of_two_servers_are_all_kept() {
    if npm::is_viewer_missing() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let site = export_site(dir.path(), "10");
    let servers = [(); 2].map(|()| Running::start(&[text(&site)]));
    let put = |server: usize, id: &str, mark: &str| {
        servers[server].ask(&format!("PUT /api/marks/{id}"), JSON, mark)
    };
    for (server, id) in [(0, "a-1"), (1, "b-1"), (0, "a-2")] {
        let (status, said) = put(server, id, &mark(id));
        assert_eq!(status, 200, "{said}");
    }
    let kept = json(&site.join("marks.geojson"));
    assert_eq!(kept["features"].as_array().unwrap().len(), 3);
    // The same mark, changed by the other one: both versions are in the answer.
    let note = |note: &str| mark("a-1").replace("\"note\":\"\"", &format!("\"note\":\"{note}\""));
    assert_eq!(put(0, "a-1", &note("first")).0, 200);
    let (status, said) = put(1, "a-1", &note("second"));
    assert_eq!(status, 409, "{said}");
    let versions: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(versions["saved"]["properties"]["note"], "first");
    assert_eq!(versions["sent"]["properties"]["note"], "second");
    assert_eq!(put(1, "a-1", &note("second")).0, 200);
}

/// The browser is given the address that is printed.
#[cfg(unix)]
#[test]
fn the_page_is_opened_on_request() {
    use std::os::unix::fs::PermissionsExt;
    if npm::is_viewer_missing() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let site = export_site(dir.path(), "20");
    let opened = dir.path().join("opened");
    let browser = dir.path().join("xdg-open");
    let script = format!("#!/bin/sh\nprintf %s \"$1\" > {}\n", text(&opened));
    std::fs::write(&browser, script).unwrap();
    std::fs::set_permissions(&browser, std::fs::Permissions::from_mode(0o755)).unwrap();
    let mut program = std::process::Command::new(env!("CARGO_BIN_EXE_tunnelstitch"));
    program.env("PATH", dir.path());
    let server = Running::run(program, &[text(&site), "--open"]).unwrap();
    let end = Instant::now() + Duration::from_secs(20);
    while std::fs::read_to_string(&opened).unwrap_or_default() != server.address() {
        assert!(Instant::now() < end, "nothing was opened");
        std::thread::sleep(Duration::from_millis(20));
    }
}
