//! The buffers that a tick works in.
use super::{Model, rollback::LastGood};
use crate::{
    bodies::BodyScratch,
    contact::{ContactScratch, MeetingWalls},
    integrate::ForceHistory,
};
use glam::DVec3;

/// Buffers of [`crate::step`], which are allocated once.
#[derive(Debug, Clone)]
pub struct Scratch {
    /// Reaction forces (N) of constrained axes at the end of the tick.
    pub(super) reaction_n: Vec<DVec3>,
    pub(super) last_good: LastGood,
    pub(super) history: ForceHistory,
    pub(super) contact: ContactScratch,
    pub(super) body: BodyScratch,
}

impl Scratch {
    /// Returns buffers for a model.
    pub fn new(model: &Model) -> Self {
        let (environment, body) = (model.environment(), model.body());
        let nodes = body.rest_positions_m().len();
        Self {
            reaction_n: vec![DVec3::ZERO; nodes],
            last_good: LastGood::new(model),
            history: if model.is_judged() {
                ForceHistory::new(nodes, body.most_positions())
            } else {
                ForceHistory::default()
            },
            contact: environment.contact.scratch(environment.settings.skips.distant_contact),
            body: BodyScratch::new(body, environment),
        }
    }

    /// Returns the walls of the body that meet, at the end of the last tick.
    pub fn meeting_walls(&self) -> MeetingWalls {
        self.contact.meeting_walls()
    }

    /// Returns the force (N) that holds each prescribed degree of freedom at the end of the last tick, which is zero on
    /// free ones.
    pub fn reactions_n(&self) -> &[DVec3] {
        &self.reaction_n
    }

    /// Forgets them, where the state is no longer that of the last tick: they are zero until the next one.
    pub fn forget_reactions(&mut self) {
        self.reaction_n.fill(DVec3::ZERO);
    }
}
