//! What awake particles are awake for.

/// How many of the awake particles are awake for what. One that several want counts for the first of them, in the order of
/// these fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AwakeFor {
    /// For tools.
    pub tools: usize,
    /// For loads.
    pub loads: usize,
    /// For forces that are injected.
    pub injected: usize,
    /// For nothing any more: they have not come to where they would be asleep, or are about to be put to sleep. Particles that
    /// were woken by hand are among these.
    pub nothing: usize,
}
