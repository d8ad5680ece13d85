//! What awake particles are awake for: worked out anew when it is asked for, by the claims of now.
use super::{
    activation_query::{Acting, ActivationQuery},
    body::HybridBody,
    spec::Waking,
    state::HybridState,
};
use crate::tick::{AwakeFor, Environment, PointForce};
use std::collections::BTreeSet;

impl HybridBody {
    /// Returns how many of the awake particles are awake for what: for what the next query would wake them for, as tools, loads
    /// and injected forces are now.
    pub(crate) fn awake_for(
        &self,
        environment: &Environment,
        own: &HybridState,
        load_factors: &[f64],
        points: &[PointForce],
    ) -> AwakeFor {
        let mut left: BTreeSet<u32> = own.ids().iter().copied().collect();
        let Waking::ByTools { reach_m } = self.particles.waking else {
            return AwakeFor { nothing: left.len(), ..AwakeFor::default() };
        };
        if left.is_empty() {
            return AwakeFor::default();
        }
        let mut query = ActivationQuery::new(self, environment);
        let acting = Acting { load_factors, points };
        let room = query.room(environment, self, own, acting, 0);
        let mut of_claim = |wanted: &mut Vec<u32>| wanted.drain(..).filter(|particle| left.remove(particle)).count();
        query.want_for_tools(environment, self, own, reach_m, room);
        let tools = of_claim(&mut query.wanted);
        query.want_for_loads(acting, room);
        let loads = of_claim(&mut query.wanted);
        query.want_for_points(environment, self, acting, reach_m, room);
        let injected = of_claim(&mut query.wanted);
        AwakeFor { tools, loads, injected, nothing: left.len() }
    }
}
