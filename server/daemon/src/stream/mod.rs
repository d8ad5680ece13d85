//! From the loop's surface to every viewer: quantise once, remember what changed, let each take the newest.
pub mod encode;
pub mod hub;
pub mod keyframe;
pub mod places;
pub mod refined;
pub mod viewer;
