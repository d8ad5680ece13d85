//! All that the loop needs for one session, built outside it and swapped in whole.
use super::{
    arm::BuiltinArm,
    exchange::{self, SurfaceEnd, SurfacePort, SurfaceSnapshot, ToolEnd},
    inject::{InjectRefusal, Injection, Injections},
    inside::Inside,
    tool::{ArmLimits, ToolLoop},
};
use crate::stream::hub::Demand;
use glam::DVec3;
use palpate_physics::{Model, Scratch, State, contact::ToolTarget};
use palpate_scene::{Driver, ScriptedHand, Timeline};
use std::{io, sync::Arc};
use tokio::runtime::Handle;

/// A session in the loop.
#[derive(Debug)]
pub struct Simulation {
    /// Number of the session.
    pub session: u64,
    pub(super) model: Arc<Model>,
    pub(super) state: State,
    pub(super) scratch: Scratch,
    pub(super) timeline: Timeline,
    pub(super) tools: Vec<ToolLoop>,
    pub(super) targets: Vec<ToolTarget>,
    pub(super) load_factors: Vec<f64>,
    pub(super) prescribed_m: Vec<DVec3>,
    pub(super) injections: Injections,
    pub(super) max_injected_force_n: f64,
    pub(super) surface: SurfacePort,
    pub(super) inside: Inside,
    pub(super) demand: Arc<Demand>,
    pub(super) ticks_to_frame: u32,
}

/// What a session is built from.
#[derive(Debug)]
pub struct Parts {
    /// Number of the session, from 1.
    pub session: u64,
    /// The body.
    pub model: Arc<Model>,
    /// Its loads and prescribed motions.
    pub timeline: Timeline,
    /// Its tools' drivers.
    pub drivers: Vec<Driver>,
    /// The hand on the simulated arm, when there is one.
    pub arm: Option<ScriptedHand>,
    /// Limits of every arm.
    pub limits: ArmLimits,
    /// What viewers want.
    pub demand: Arc<Demand>,
    /// Where tools' bells are heard.
    pub arms: Handle,
}

/// What the rest of the daemon holds of a session in the loop.
#[derive(Debug)]
pub struct Ends {
    /// One per tool.
    pub tools: Vec<ToolEnd>,
    /// The surface.
    pub surface: SurfaceEnd,
}

impl Simulation {
    /// Allocates everything.
    ///
    /// # Errors
    /// The operating system's, when it has no descriptors left.
    pub fn build(parts: Parts) -> io::Result<(Box<Self>, Ends)> {
        let Parts { session, model, timeline, drivers, arm, limits, demand, arms } = parts;
        let (surface, surface_end) = exchange::surface(&model)?;
        let period_s = model.settings().tick_period_s;
        let mut tools = Vec::new();
        let mut tool_ends = Vec::new();
        for (index, driver) in drivers.into_iter().enumerate() {
            let (port, end) = {
                let _of_arms = arms.enter();
                exchange::tool()?
            };
            let hand = arm.as_ref().filter(|hand| hand.tool == index);
            let arm = hand.map(|hand| BuiltinArm::new(hand.path.clone(), period_s)).transpose();
            let arm = arm.map_err(io::Error::other)?;
            tools.push(ToolLoop::new(driver, port, arm, limits));
            tool_ends.push(end);
        }
        let state = State::at_rest(&model);
        let simulation = Self {
            session,
            scratch: Scratch::new(&model),
            timeline,
            targets: state.mechanical.tools.iter().map(|tool| tool.target).collect(),
            tools,
            load_factors: vec![0.0; model.loads().len()],
            prescribed_m: vec![DVec3::ZERO; model.prescribed().len()],
            injections: Injections::default(),
            max_injected_force_n: limits.max_injected_force_n,
            surface,
            inside: Inside::new(&model),
            demand,
            ticks_to_frame: 0,
            state,
            model,
        };
        Ok((Box::new(simulation), Ends { tools: tool_ends, surface: surface_end }))
    }

    /// The body.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// The state.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Period of the tick (s).
    pub fn period_s(&self) -> f64 {
        self.model.settings().tick_period_s
    }

    /// Whether no arm has a force.
    pub fn is_released(&self) -> bool {
        self.tools.iter().all(ToolLoop::is_without_force)
    }

    /// Whether no device has a force.
    pub fn are_devices_released(&self) -> bool {
        self.tools.iter().all(|tool| !tool.is_attached() || tool.is_without_force())
    }

    /// Back to rest at tick 0. Does not allocate.
    pub fn reset(&mut self) {
        self.state.reset(&self.model);
        self.scratch.forget_reactions();
        self.injections.clear();
        self.tools.iter_mut().for_each(ToolLoop::reset);
    }

    /// Takes forces, all or none; see [`Injections::add`].
    ///
    /// # Errors
    /// [`InjectRefusal`].
    pub fn inject(&mut self, forces: &[Injection], next_tick: u64) -> Result<u64, InjectRefusal> {
        self.injections.add(forces, next_tick)
    }

    /// Takes another state of the same model. Does not allocate. False when it is not one of this model's.
    pub fn restore(&mut self, state: &State) -> bool {
        if !self.state.try_copy_from(state) {
            return false;
        }
        self.scratch.forget_reactions();
        self.injections.clear();
        for (tool, state) in self.tools.iter_mut().zip(&self.state.mechanical.tools) {
            tool.restored(state);
        }
        true
    }

    /// Fills the surface's slot and rings.
    pub(super) fn publish_surface(&mut self, tick_cost_us: f64) {
        let snapshot: &mut SurfaceSnapshot = self.surface.slot.input_buffer_mut();
        snapshot.tick = self.state.mechanical.tick;
        snapshot.time_s = self.state.time_s(&self.model);
        snapshot.tick_cost_us = tick_cost_us;
        snapshot.quarantine = self.state.quarantine;
        snapshot.wants_vertices = self.demand.wants_vertices();
        snapshot.shape.fill(&self.model, &self.state);
        for (view, (tool, state)) in snapshot.tools.iter_mut().zip(self.tools.iter().zip(&self.state.mechanical.tools))
        {
            *view = tool.view(state);
        }
        self.surface.slot.publish();
        self.surface.bell.ring();
    }
}
