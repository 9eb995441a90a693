//! States of an interrupted run, with a valid hash so that their content is parsed; without, if the
//! first byte is odd.

use tunnelstitch::frames::Shading;
use tunnelstitch::persist::checkpoint::{Checkpoint, Origin};
use tunnelstitch::refine::SolveRecord;

/// The types that states consist of.
type State = (Option<Shading>, Vec<SolveRecord>, Vec<f64>);

/// Reads the input.
pub fn run(data: &[u8]) {
    let Some((first, content)) = data.split_first() else {
        return;
    };
    let mut bytes = content.to_owned();
    if first % 2 == 0 {
        bytes.extend_from_slice(blake3::hash(content).as_bytes());
    }
    let origin = Origin {
        program: String::new(),
        options: String::new(),
        survey: String::new(),
        inputs: Vec::new(),
    };
    let folder = tempfile::tempdir().unwrap();
    for name in ["origin", "a.state"] {
        std::fs::write(folder.path().join(name), &bytes).unwrap();
    }
    let _ = Checkpoint::open(folder.path(), &origin, false);
    let checkpoint = Checkpoint::open(folder.path(), &origin, true).unwrap();
    std::fs::write(folder.path().join("a.state"), &bytes).unwrap();
    let _ = checkpoint.state::<State>("a");
}
