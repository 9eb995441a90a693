//! Every fuzz target on its stored seeds and on damaged copies of them.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::Path;

#[path = "../fuzz/src/lib.rs"]
mod fuzz;

/// Damaged copies for each target; fewer where one takes long.
const COPIES: usize = 200;
const FEW_COPIES: usize = 40;

/// Targets of which a call takes long.
const SLOW: [&str; 2] = ["runs", "gyro"];
/// A target that needs another ffprobe, which the whole process would get.
const ELSEWHERE: &str = "video";

/// A copy with some bytes changed, parts removed and repeated, or a part of another seed.
fn damaged(rng: &mut ChaCha8Rng, seed: &[u8], other: &[u8]) -> Vec<u8> {
    let mut copy = seed.to_vec();
    for _ in 0..rng.random_range(1..6) {
        let at = rng.random_range(0..=copy.len());
        let length = rng.random_range(0..=(copy.len() - at).min(16));
        match rng.random_range(0..5) {
            0 if at < copy.len() => copy[at] ^= 1 << rng.random_range(0..8),
            1 if at < copy.len() => copy[at] = b"0-9.e\n,: \"{[\0\xff"[rng.random_range(0..14)],
            2 => drop(copy.drain(at..at + length)),
            3 => {
                let part = copy[at..at + length].to_vec();
                copy.splice(at..at, part);
            }
            _ => {
                let from = rng.random_range(0..=other.len());
                let to = (from + length).min(other.len());
                copy.splice(at..at + length, other[from..to].iter().copied());
            }
        }
    }
    copy
}

#[test]
fn damaged_seeds_do_no_harm() {
    let seeds = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fuzz/seeds");
    for (name, target) in fuzz::targets::TARGETS {
        if name == ELSEWHERE {
            continue;
        }
        let mut files: Vec<_> = std::fs::read_dir(seeds.join(name))
            .unwrap_or_else(|error| panic!("seeds of {name}: {error}"))
            .map(|entry| entry.unwrap().path())
            .collect();
        files.sort();
        let seeds: Vec<Vec<u8>> = files
            .iter()
            .map(|path| std::fs::read(path).unwrap())
            .collect();
        assert!(!seeds.is_empty(), "{name}");
        seeds.iter().for_each(|seed| target(seed));
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let copies = if SLOW.contains(&name) {
            FEW_COPIES
        } else {
            COPIES
        };
        for _ in 0..copies {
            let mut pick = || &seeds[rng.random_range(0..seeds.len())];
            let (seed, other) = (pick(), pick());
            let copy = damaged(&mut rng, seed, other);
            // The input is in the message of the failure.
            let kept = copy.clone();
            let caught = std::panic::catch_unwind(move || target(&kept));
            assert!(caught.is_ok(), "{name}: {}", copy.escape_ascii());
        }
    }
}
