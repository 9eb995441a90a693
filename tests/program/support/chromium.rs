//! Looking at pages with headless Chromium.

use super::missing::find_program;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Longest time for one look.
const PATIENCE: Duration = Duration::from_secs(120);

/// Finds the browser; without one the test is skipped.
pub fn find() -> Option<PathBuf> {
    find_program(&["chromium", "chromium-browser", "google-chrome"])
}

/// Window and colour scheme of a screenshot.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// Width and height of the window.
    pub size: [u32; 2],
    /// True for the dark colour scheme.
    pub dark: bool,
}

/// A picture of the page.
pub fn screenshot(browser: &Path, page: &Path, look: Look, out: &Path) -> image::RgbImage {
    let picture = format!("--screenshot={}", path_text(out));
    run(browser, page, look, &[&picture]);
    image::open(out).expect("a screenshot").to_rgb8()
}

/// The page as it is after its scripts have run. No window is narrower than some 500 pixels.
pub fn dump(browser: &Path, page: &Path, look: Look) -> String {
    run(browser, page, look, &["--dump-dom"])
}

fn run(browser: &Path, page: &Path, look: Look, arguments: &[&str]) -> String {
    let profile = tempfile::tempdir().expect("a folder for the browser");
    let [width, height] = look.size;
    let scheme = if look.dark { 0 } else { 1 };
    let output = profile.path().join("stdout");
    let mut child = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-quic",
            "--disable-dev-shm-usage",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--hide-scrollbars",
            "--force-device-scale-factor=1",
            "--virtual-time-budget=4000",
        ])
        .arg(format!("--user-data-dir={}", path_text(profile.path())))
        .arg(format!("--window-size={width},{height}"))
        .arg(format!("--blink-settings=preferredColorScheme={scheme}"))
        .args(arguments)
        .arg(format!("file://{}", path_text(page)))
        .stdout(std::fs::File::create(&output).expect("a file"))
        .stderr(Stdio::null())
        .spawn()
        .expect("the browser starts");
    let since = Instant::now();
    loop {
        if let Some(status) = child.try_wait().expect("a child") {
            assert!(status.success(), "the browser: {status}");
            break;
        }
        if since.elapsed() > PATIENCE {
            let _ = child.kill();
            panic!("the browser takes more than {PATIENCE:?}");
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    std::fs::read_to_string(&output).expect("what the browser said")
}

fn path_text(path: &Path) -> &str {
    path.to_str().expect("a path in UTF-8")
}
