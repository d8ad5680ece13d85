//! Every skip leaves the bits alone, in the very scenes in which the lab tells the time it saves.
use palpate_lab::skips;

#[test]
fn every_skip_is_exact() {
    for skip in skips::ALL {
        let found = (skip.run)(30).unwrap();
        assert!(found.same_bits, "{}", skip.name);
        assert!(found.with.median_s > 0.0 && found.without.median_s > 0.0, "{}", skip.name);
    }
}
