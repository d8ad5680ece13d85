//! Self-contact: walls of one body that meet.
//!
//! Every vertex `y` of the skin has a *gap* `g` to the walls that it may meet: its distance from the nearest point `p`
//! of their triangles, negative where it is behind them ([`gap`]). Below a margin `m` the vertex is pushed back, with
//! `s = m − g`, its stiffness `κ = k A` (the area `A` at rest that belongs to it), and `φ` that grows faster than its square ([`response`]):
//! ```text
//! Φ = Σ_v κ_v φ(m_v − g_v)      f_y = −∂Φ/∂y = κ φ'(s) n̂,  n̂ = ∂g/∂y      f_i = −w_i f_y  at the corners, p = Σ w_i x_i
//! ```
//! At a rim, where a wall that faces the vertex ends, all of it fades beside the wall.
//! Both walls press each other's vertices, so each has half of a foundation's stiffness. `f_y` acts along `y − p`, so
//! that momentum and angular momentum are conserved. The potential depends on positions alone: there is no history.
//!
//! *Which walls* a vertex may meet is settled at rest ([`rest`]): not those beside it along the skin, nor the other
//! side of its own wall. Of the others those count that face it now. The margin is at most half of the gap at rest,
//! so that nothing is pressed there.
//!
//! *What it costs where nothing is near*: every cluster of triangles knows at rest how far the walls are that it may
//! meet, and what it has been displaced since bounds how near they can be ([`query`]). A query tells how far the surface
//! may move until the next one is due. It changes no bit of a result.
//!
//! *Steps.* With `w = (1, −w_i)` on (vertex, corners), a pair's stiffness is at most `κ φ'' w wᵀ`, and its rows sum to
//! `2 κ φ''` and `2 w_i κ φ''`. The largest sum over mass that the walls that meet have is added to the body's squared
//! frequency ([`crate::tick`]'s substeps); no vertex at its margin adds more than [`rest::FREQUENCY_FRACTION`] of it.
mod bounds;
mod build;
mod coarse;
mod compact;
mod facing;
mod farthest;
mod gap;
mod later;
mod lists;
mod press;
mod query;
mod ray;
mod response;
mod rest;
mod stepping;
#[cfg(test)]
mod tests;

pub(crate) use coarse::coarse_walls;
pub(super) use lists::NearWalls;
pub use press::MeetingWalls;
pub(super) use query::WallScratch;
pub(crate) use rest::SelfContact;
