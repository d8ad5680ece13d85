//! Descriptors of the process: as many as the system allows without being asked by root, and what is left for connections.
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

/// More are never asked for.
const MOST: u64 = 65_536;
/// Kept for files, slots of sessions and the loop.
const APART: u64 = 256;

/// Raises the soft limit towards the hard one, and returns how many connections there may be then.
pub fn raise() -> usize {
    let limit = getrlimit(Resource::Nofile);
    let hard = limit.maximum.unwrap_or(MOST).min(MOST);
    let soft = limit.current.unwrap_or(MOST);
    let granted = if soft < hard && setrlimit(Resource::Nofile, Rlimit { current: Some(hard), ..limit }).is_ok() {
        hard
    } else {
        soft
    };
    granted.saturating_sub(APART).max(granted / 2) as usize
}
