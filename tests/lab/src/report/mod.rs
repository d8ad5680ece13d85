//! `palpate-lab run` and `palpate-lab compare`: the run's CSV, its page, and what changed between two runs.
mod command;
mod compare;
mod convergence;
mod hearts;
mod page;
mod peers;
pub(crate) mod plot;
mod skips;
mod stress;
mod verdict;

pub use command::{Options, run};
pub use compare::{Options as CompareOptions, compare, run as run_compare};
pub(crate) use page::{COLOURS, STYLE};
