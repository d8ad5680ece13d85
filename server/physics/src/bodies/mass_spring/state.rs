//! What a tick changes of a mass-spring surface beside positions and velocities, and where tools and injected forces
//! make it refined and awake.
//!
//! A tool that touches the surface, or is about to, has a vertex about which the surface is refined: the one nearest to
//! where it is deepest, or to the tool. A capsule has such a vertex for each sample along its axis. Another vertex
//! takes its place when it is nearer by a tenth of the tool's radius, and there is none once the tool has been away for
//! [`AWAY_TICKS`]. Where not all vertices may be awake at once, those that are the fewest edges from such vertices, and
//! from those at which a force was injected, are awake; they stay awake until all of them are at rest.
use super::{
    around,
    body::{MOST_RINGS, MassSpringBody, Refining},
    motion::SpringMotion,
    region::Constants,
};
use crate::{
    hash::Chain,
    tick::{Environment, KindState, MechanicalState},
};
use serde::{Deserialize, Serialize};

/// Number of ticks that a tool has to be away before the surface is no longer refined about it.
const AWAY_TICKS: u32 = 100;
/// Largest number of vertices about which the surface is kept awake for injected forces, besides those of tools.
pub(super) const MOST_FORCED: usize = 8;
/// Relative change of constants below which they are left as they are.
const NO_CHANGE: f64 = 1e-6;
/// Part of the awake region's reach that a tool moves before the surface is awake about another vertex.
const FOLLOW: f64 = 0.25;

/// Everything that a tick changes of the surface beside positions and velocities.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MassSpringState {
    /// Awake nodes and levels.
    pub motion: SpringMotion,
    /// Vertices about which the surface is refined and awake, for each axis sample of each tool.
    pub(crate) about: Vec<About>,
    /// Vertices at which forces were injected while they slept.
    forced: Vec<u32>,
    /// Triangles that are to be refined, ascending.
    pub(crate) refined: Vec<u32>,
    /// Coarse vertices that are to be awake, ascending, besides those of triangles that are not coarse.
    pub(crate) awake: Vec<u32>,
    /// Energy (J) that changes of levels and nodes that enter and leave have added since reset; negative where they
    /// have taken it.
    pub given_j: f64,
}

/// The vertices about which the surface is refined and awake for one axis sample of a tool.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct About {
    /// Vertex about which the surface is refined.
    pub(crate) touched: Option<u32>,
    /// Vertex about which the surface is awake.
    awake: Option<u32>,
    /// Number of rings that its dent needs, at least one where it touches.
    rings: u32,
    /// Number of ticks that the tool has been away.
    away_ticks: u32,
}

/// What an axis sample of a tool is near to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Found {
    /// The nearest coarse vertex.
    pub(crate) vertex: u32,
    /// Distance (m) of that vertex.
    pub(crate) distance_m: f64,
    /// Distance (m) of the vertex about which the surface is refined now.
    pub(crate) present_m: f64,
    /// Gap (m) between tool and surface, 0 while they touch.
    pub(crate) gap_m: f64,
    /// Number of rings that the dent needs ([`super::body::rings_for`]).
    pub(crate) rings: f64,
}

/// Buffers of a query of what is to be refined and awake.
#[derive(Debug, Clone)]
pub(crate) struct ActivationQuery {
    centres: Vec<u32>,
    triangles: Vec<u32>,
    corners: Vec<u32>,
    seen: Vec<bool>,
}

impl ActivationQuery {
    pub(crate) fn new(body: &MassSpringBody) -> Self {
        let (most, samples) = (body.model().spec().most_refined, body.axis_sample_count());
        Self {
            centres: Vec::with_capacity(samples),
            triangles: Vec::with_capacity(most),
            corners: Vec::with_capacity(3 * most + samples),
            seen: vec![false; if body.is_all_awake() { 0 } else { body.model().vertices() as usize }],
        }
    }
}

impl About {
    /// Returns whether the surface is refined about any of the samples.
    pub(crate) fn is_fine(samples: &[Self]) -> bool {
        samples.iter().any(|about| about.touched.is_some())
    }

    /// Notes what the sample is near to, if anything, `ticks` ticks after the last query. A tool of the radius
    /// `radius_m` (m) counts as touching where its gap is less than `near_m` (m).
    pub(crate) fn note(&mut self, near: Option<Found>, near_m: f64, radius_m: f64, ticks: u32) {
        /// Part of the tool's radius by which another vertex has to be nearer.
        const NEARER: f64 = 0.1;
        /// Part of a ring by which a dent must have shrunk before it has one ring less.
        const SHRUNK: f64 = 0.25;
        match (self.touched, near) {
            (touched, Some(near)) if near.gap_m < near_m => {
                let follows = touched.is_none() || near.distance_m < near.present_m - NEARER * radius_m;
                self.touched = if follows { Some(near.vertex) } else { touched };
                self.away_ticks = 0;
                let wanted = near.rings.max(1.0).ceil().min(f64::from(MOST_RINGS)) as u32;
                let shrunk = near.rings + SHRUNK < f64::from(self.rings) - 1.0;
                self.rings = if wanted > self.rings || shrunk { wanted } else { self.rings };
            }
            (Some(_), near) if near.is_none_or(|near| near.gap_m > 2.0 * near_m) => {
                self.away_ticks += ticks;
                if self.away_ticks >= AWAY_TICKS {
                    (self.touched, self.rings) = (None, 0);
                }
            }
            (Some(_), _) => self.away_ticks = 0,
            (None, _) => {}
        }
    }
}

impl KindState for MassSpringState {
    type Body = MassSpringBody;

    fn at_rest(body: &MassSpringBody, _: &Environment) -> Self {
        let spec = body.model().spec();
        let mut awake = Vec::with_capacity(spec.most_awake.min(body.model().vertices() as usize));
        if body.is_all_awake() {
            awake.extend(0..body.model().vertices());
        }
        let motion = SpringMotion::at_rest(body.model(), awake.iter().copied());
        Self {
            motion: SpringMotion { fine: body.fine_at(0.0), ..motion },
            about: vec![About::default(); body.axis_sample_count()],
            forced: Vec::with_capacity(MOST_FORCED),
            refined: Vec::with_capacity(spec.most_refined),
            awake,
            given_j: 0.0,
        }
    }

    fn reset(&mut self, body: &MassSpringBody) {
        self.motion.reset(body.model());
        self.motion.fine = body.fine_at(0.0);
        self.about.fill(About::default());
        self.forced.clear();
        self.refined.clear();
        self.given_j = 0.0;
        if !body.is_all_awake() {
            self.awake.clear();
        }
        self.motion.ids.extend_from_slice(&self.awake);
    }

    fn copy_from(&mut self, other: &Self) {
        self.motion.copy_from(&other.motion);
        self.about.clone_from(&other.about);
        self.forced.clone_from(&other.forced);
        self.refined.clone_from(&other.refined);
        self.awake.clone_from(&other.awake);
        self.given_j = other.given_j;
    }

    fn fits(&self, body: &MassSpringBody, _: &Environment, _: &MechanicalState) -> bool {
        let model = body.model();
        let (vertices, triangles) = (model.vertices(), model.surface().triangles().len());
        let ascending = |list: &[u32]| list.windows(2).all(|pair| pair[0] < pair[1]);
        let known = |about: &About| about.touched.into_iter().chain(about.awake).all(|vertex| vertex < vertices);
        let refined = ascending(&self.refined) && self.refined.last().is_none_or(|last| (*last as usize) < triangles);
        let levels = self.motion.levels.triangles();
        let entering = self.refined.iter().filter(|t| levels.binary_search_by_key(*t, |level| level.0).is_err());
        refined
            && self.given_j.is_finite()
            && levels.len() + entering.count() <= model.spec().most_refined
            && self.about.len() == body.axis_sample_count()
            && self.about.iter().all(|about| known(about) && about.rings <= MOST_RINGS)
            && self.forced.len() <= MOST_FORCED
            && self.forced.iter().all(|vertex| *vertex < vertices)
            && (!body.is_all_awake() || self.awake.iter().copied().eq(0..vertices))
            && self.motion.fits(model, &self.awake)
    }

    fn chain(&self, chain: &mut Chain) {
        chain.wholes(&self.motion.ids);
        chain.list(self.motion.levels.triangles(), |chain, (triangle, progress)| {
            chain.whole(u64::from(*triangle));
            chain.real(*progress);
        });
        chain.real(self.motion.fine.mesh_n_per_m);
        chain.real(self.motion.fine.anchor_n_per_m);
        let vertex = |chain: &mut Chain, vertex: u32| chain.whole(u64::from(vertex));
        chain.list(&self.about, |chain, about| {
            chain.maybe(about.touched, vertex);
            chain.maybe(about.awake, vertex);
            chain.whole(u64::from(about.rings));
            chain.whole(u64::from(about.away_ticks));
        });
        for list in [&self.forced, &self.refined, &self.awake] {
            chain.wholes(list);
        }
        chain.real(self.given_j);
    }

    fn awake_nodes(&self) -> Option<&[u32]> {
        Some(&self.motion.ids)
    }

    /// Refines `rings` rings around the vertices `centres` and nothing else, of a body that is refined by hand
    /// ([`Refining::ByHand`]). As with tools, levels change from tick to tick. Triangles for which there is no room are
    /// left out.
    fn refine_only(&mut self, body: &MassSpringBody, centres: &[u32], rings: u32) {
        let springs = body.model();
        let known = centres.iter().copied().filter(|&vertex| vertex < springs.vertices()).collect::<Vec<_>>();
        let (mut triangles, mut corners) = (Vec::new(), Vec::new());
        let levels = self.motion.levels.triangles().len();
        let most = springs.spec().most_refined.saturating_sub(levels);
        around::rings_into(springs.surface(), &known, rings, most, &mut triangles, &mut corners);
        self.refined.clear();
        self.refined.extend_from_slice(&triangles);
    }
}

impl MassSpringState {
    /// Returns the number of nodes of type 2: the middles of edges that are not coarse.
    pub fn refined_nodes(&self, body: &MassSpringBody) -> usize {
        self.motion.ids.len() - self.motion.ids.partition_point(|id| *id < body.model().vertices())
    }

    /// Returns the constants `K′_m`, `K′_h` of the next tick. They move by `fraction` of the difference towards those
    /// at the displacement of the touched vertices; `away_m` tells how far (m) a vertex is from its rest position.
    pub(crate) fn next_fine(&self, body: &MassSpringBody, fraction: f64, away_m: impl Fn(u32) -> f64) -> Constants {
        let touched = self.about.iter().filter_map(|about| about.touched);
        let Some(farthest_m) = touched.map(away_m).reduce(f64::max) else { return self.motion.fine };
        let (now, then) = (self.motion.fine, body.fine_at(farthest_m));
        // While constants hardly change nothing is laid out anew.
        if (then.anchor_n_per_m / now.anchor_n_per_m - 1.0).abs() < NO_CHANGE {
            return now;
        }
        let towards = |now: f64, then: f64| now + (then - now) * fraction.min(1.0);
        Constants {
            mesh_n_per_m: towards(now.mesh_n_per_m, then.mesh_n_per_m),
            anchor_n_per_m: towards(now.anchor_n_per_m, then.anchor_n_per_m),
        }
    }

    /// Notes that a force is injected at a sleeping vertex.
    pub(crate) fn force(&mut self, vertex: u32) {
        if !self.forced.contains(&vertex) {
            if self.forced.len() == MOST_FORCED {
                self.forced.remove(0);
            }
            self.forced.push(vertex);
        }
    }

    /// Decides which triangles are to be refined. While entering triangles and those that still leave together have no
    /// room, only triangles that are not coarse already are kept. Nothing is allocated.
    pub(crate) fn want_refined(&mut self, body: &MassSpringBody, query: &mut ActivationQuery) {
        let Some(refinement) = body.refinement().filter(|refinement| refinement.by == Refining::ByTools) else {
            return;
        };
        let ActivationQuery { centres, triangles, corners, .. } = query;
        let most = body.model().spec().most_refined;
        centres.clear();
        centres.extend(self.about.iter().filter_map(|about| about.touched));
        let of_dents = self.about.iter().map(|about| about.rings).max().unwrap_or_default();
        let rings = if refinement.follows_dent { of_dents.clamp(1, refinement.rings) } else { refinement.rings };
        around::rings_into(body.model().surface(), centres, rings, most, triangles, corners);
        let levels = self.motion.levels.triangles();
        let is_there = |triangle: &u32| levels.binary_search_by_key(triangle, |level| level.0).is_ok();
        let entering = triangles.iter().filter(|triangle| !is_there(triangle)).count();
        let fits = levels.len() + entering <= most;
        self.refined.clear();
        self.refined.extend(triangles.iter().filter(|triangle| fits || is_there(triangle)));
    }

    /// Decides which vertices are to be awake, where not all are. `forced` tells that a force was injected at a
    /// sleeping vertex, `is_still` that all awake nodes are at rest. Nothing is allocated.
    pub(crate) fn want_awake(
        &mut self,
        body: &MassSpringBody,
        query: &mut ActivationQuery,
        forced: bool,
        is_still: bool,
    ) {
        let rest_m = body.model().rest_m();
        let mut changed = forced;
        for about in &mut self.about {
            let Some(touched) = about.touched else { continue };
            let far_m = |awake: u32| rest_m[awake as usize].distance(rest_m[touched as usize]);
            if about.awake.is_none_or(|awake| far_m(awake) > FOLLOW * body.awake_reach_m()) {
                about.awake = Some(touched);
                changed = true;
            }
        }
        let is_touched = self.about.iter().any(|about| about.touched.is_some());
        if !is_touched && !forced && is_still && !self.awake.is_empty() {
            self.forced.clear();
            self.about.iter_mut().for_each(|about| about.awake = None);
            changed = true;
        }
        if changed {
            let centres = self.about.iter().filter_map(|about| about.awake).chain(self.forced.iter().copied());
            let most = body.model().spec().most_awake;
            around::nearest_into(body.model().surface(), centres, most, &mut self.awake, &mut query.seen);
        }
    }
}
