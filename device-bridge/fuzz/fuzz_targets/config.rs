#![no_main]
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| palpate_bridge_fuzz::config(bytes));
