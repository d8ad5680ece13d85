#![no_main]
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = palpate_bridge_fuzz::woodenhaptics(bytes);
});
