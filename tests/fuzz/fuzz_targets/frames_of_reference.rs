#![no_main]

libfuzzer_sys::fuzz_target!(
    |data: &[u8]| tunnelstitch_fuzz::targets::frames_of_reference::run(data)
);
