//! Every skip leaves the bits alone, or keeps to its tolerance, in the very scenes in which the lab tells the time it saves.
use palpate_lab::skips;

#[test]
fn every_skip_keeps_its_promise() {
    for skip in skips::ALL {
        let found = (skip.run)(30).unwrap();
        assert!(skip.is_kept(&found), "{}: {found:?}", skip.name);
        assert!(skip.tolerance_m.is_some() || found.farthest_m == 0.0, "{}", skip.name);
        assert!(found.with.median_s > 0.0 && found.without.median_s > 0.0, "{}", skip.name);
    }
}
