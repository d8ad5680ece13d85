//! What unit tests of any module may use: numbers without a pattern, and shapes that know no body.
mod ball;
mod random;
mod slab;

pub(crate) use ball::sphere;
pub(crate) use random::Random;
pub(crate) use slab::{slab, tet_box};
