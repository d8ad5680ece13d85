//! What survives the process: the session's scene and state, written from time to time and read at the next start.
pub mod autosave;
pub mod folder;
