//! The lab: what Palpate costs, measured beside what it gets wrong.
pub mod bodies;
pub mod jitter;
pub mod press;
pub mod reference;
pub mod table;
pub mod timing;
