#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| tunnelstitch_fuzz::targets::frame_pixels::run(data));
