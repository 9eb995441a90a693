#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| tunnelstitch_fuzz::targets::wall_files::run(data));
