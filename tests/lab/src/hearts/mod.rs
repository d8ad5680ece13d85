//! Irregular hearts: walls that no scene of ours was tuned on.
//!
//! A heart that was segmented from images is no ellipsoid: its axis points anywhere, its wall is thick here and thin there,
//! its septum flat, its base no plane, muscles stand out into its cavity, and its surfaces are those of voxels. A seed
//! decides all of it.
mod anatomy;
mod answers;
mod isosurface;
mod place;
mod scene;
mod shipped;
mod ticks;

pub(crate) use scene::Heart;
pub use shipped::{ShippedOptions, write as write_shipped};
pub(crate) use ticks::what;
pub use ticks::{Asleep, HeartTicks, Options, measure, print};
