//! What a tick changes of a seed body beside what every body has.
use super::{SeedBody, SeedModel, SeedState, region::Region, state::Motion};
use crate::{
    hash::Chain,
    tick::{Environment, KindState, MechanicalState},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// What a tick changes of a seed body beside what every body has.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SeedBodyState {
    /// The state that the model's steps change.
    pub now: SeedState,
    /// Triangle of the surface that tools touch, for the next step.
    pub touched: Option<u32>,
    /// Number of awake particles.
    pub awake: u32,
}

impl SeedBodyState {
    /// Returns the state at rest.
    pub(super) fn of(model: &SeedModel) -> Self {
        Self { now: SeedState::at_rest(model), touched: None, awake: 0 }
    }

    /// Sets all velocities to zero.
    pub(crate) fn stop(&mut self) {
        for motion in [&mut self.now.core, &mut self.now.skin, &mut self.now.particles] {
            motion.v.fill(DVec3::ZERO);
        }
    }
}

impl KindState for SeedBodyState {
    type Body = SeedBody;

    fn at_rest(body: &SeedBody, _: &Environment) -> Self {
        Self::of(body.model())
    }

    fn reset(&mut self, body: &SeedBody) {
        let model = body.model();
        self.now.core.rest(model.core().rest_m());
        self.now.skin.rest(model.surface_rest_m());
        self.now.particles.rest(&[]);
        (self.now.step, self.now.touched) = (0, None);
        (self.touched, self.awake) = (None, 0);
    }

    fn copy_from(&mut self, other: &Self) {
        let (own, from) = (&mut self.now, &other.now);
        own.core.copy_from(&from.core);
        own.skin.copy_from(&from.skin);
        own.particles.copy_from(&from.particles);
        (own.step, own.touched) = (from.step, from.touched);
        (self.touched, self.awake) = (other.touched, other.awake);
    }

    /// Nodes have to be where everybody's positions and velocities say.
    fn fits(&self, body: &SeedBody, _: &Environment, state: &MechanicalState) -> bool {
        let model = body.model();
        let Self { now, touched, awake } = self;
        let same = |nodes: &[DVec3], of: [&[DVec3]; 2]| nodes.iter().eq(of.into_iter().flatten());
        now.fits(model)
            && same(&state.x, [&now.core.x, &now.skin.x])
            && same(&state.v, [&now.core.v, &now.skin.v])
            && touched.is_none_or(|triangle| (triangle as usize) < model.surface_triangles().len())
            && *awake as usize == model.awake(now).map_or(0, Region::len)
    }

    fn chain(&self, chain: &mut Chain) {
        let triangle = |chain: &mut Chain, triangle: u32| chain.whole(u64::from(triangle));
        chain.whole(self.now.step);
        chain.maybe(self.now.touched, triangle);
        chain.maybe(self.touched, triangle);
        chain.whole(u64::from(self.awake));
        // Entries beyond the awake particles are not used.
        let Motion { x, v } = &self.now.particles;
        let awake = self.awake as usize;
        for list in [&self.now.core.x, &self.now.core.v, &self.now.skin.x, &self.now.skin.v] {
            chain.vectors(list);
        }
        chain.vectors(&x[..awake]);
        chain.vectors(&v[..awake]);
    }

    fn awake_particles(&self) -> usize {
        self.awake as usize
    }

    fn awake_particles_m<'a>(&'a self, _: &'a MechanicalState) -> &'a [DVec3] {
        &self.now.particles.x[..self.awake as usize]
    }

    fn is_finite(&self) -> bool {
        self.now.particles.is_finite(self.awake as usize)
    }

    fn vectors(&self) -> Box<dyn Iterator<Item = &DVec3> + '_> {
        let SeedState { core, skin, particles, .. } = &self.now;
        let all = [core, skin, particles].into_iter();
        Box::new(all.flat_map(|motion: &Motion| motion.x.iter().chain(&motion.v)))
    }
}
