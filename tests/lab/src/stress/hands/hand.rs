//! A random press: which tool, where, in which direction, how fast and how far.
use super::Body;
use crate::random::Random;
use glam::{DQuat, DVec3};
use miette::{Result, bail};
use palpate_physics::{
    Model,
    contact::{Coupling, ToolShape, ToolSpec, ToolTarget, closest_weights},
};
use std::fmt;

/// Force (N) at which a hand goes no deeper: the largest that the strongest of common arms renders.
pub(super) const LARGEST_FORCE_N: f64 = 20.0;
/// Depth (m) to which a hand goes that meets no such force.
const LARGEST_DEPTH_M: f64 = 0.03;
/// Points on either half of a capsule's axis at which it is looked whether it is clear of a body.
const AXIS_PARTS: i32 = 8;
/// Ticks for which it stays there.
const STAYS_TICKS: u32 = 60;

/// A press.
#[derive(Debug, Clone)]
pub(super) struct Press {
    pub(super) tool: ToolSpec,
    /// Unit vector into the body.
    pub(super) along: DVec3,
    /// Way (m) of the hand from its start to where it would touch the body at rest.
    pub(super) gap_m: f64,
    depth_m: f64,
    /// How far (m) it is dragged once it is there.
    drag_m: DVec3,
    pub(super) speed_m_per_s: f64,
    /// Whether the tool is far from the body's edges.
    pub(super) is_inland: bool,
}

impl Press {
    /// Chooses tool, place, direction, speed and depth.
    pub(super) fn random(bare: &Model, body: &Body, random: &mut Random) -> Result<Self> {
        let (x, surface) = (bare.surface_rest_positions_m(), bare.surface());
        let lowest_m = x.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
        let longest_m =
            (0..surface.triangles.len()).map(|triangle| surface.longest_edge_m(triangle, x)).fold(0.0, f64::max);
        for _ in 0..1000 {
            let least_m = (1.1 * longest_m / palpate_physics::contact::LARGEST_TRIANGLE).max(1e-3);
            let radius_m = random.log_within(least_m, 0.02_f64.min(0.4 * body.edge_m));
            let coupling = random_coupling(0.7, random);
            let shape = if random.chance(0.75) {
                ToolShape::Sphere
            } else {
                ToolShape::capsule(coupling, radius_m, radius_m * random.within(0.5, 2.0), random.vector())
            };
            let [a, b, c] = surface.triangle_nodes(random.below(surface.triangles.len())).map(|node| x[node as usize]);
            let normal = (b - a).cross(c - a).normalize_or(DVec3::Z);
            let axis = normal.any_orthonormal_vector();
            let tilt = DQuat::from_axis_angle(axis, random.within(0.0, 1.05));
            let along = -(DQuat::from_axis_angle(normal, random.within(0.0, std::f64::consts::TAU)) * (tilt * normal));
            let touch_m = (a + b + c) / 3.0 + normal * radius_m;
            let gap_m = random.within(0.0, 0.01);
            let start_position_m = touch_m - along * gap_m;
            let friction_coefficient = if random.chance(0.5) { 0.0 } else { random.within(0.0, 0.8) };
            let speed_m_per_s = random.log_within(0.05, 5.0);
            let deepest_m = if coupling == Coupling::Rigid { body.rigid_depth_m } else { LARGEST_DEPTH_M };
            let depth_m = random.within(0.2, 1.0) * deepest_m;
            let name = "hand".to_owned();
            let tool = ToolSpec { name, shape, radius_m, coupling, friction_coefficient, start_position_m };
            let reach_m = radius_m + shape.half_length_m();
            let is_clear = |way_m: f64| {
                let at_m = start_position_m + along * way_m;
                x.iter().all(|p| p.distance(at_m) > reach_m + 1e-4)
            };
            let is_below = touch_m.z < lowest_m + reach_m;
            if is_below || !is_clear(0.0) || cuts(&shape, start_position_m, radius_m, bare) {
                continue;
            }
            let inland_m = 0.5 * body.edge_m - 2.0 * reach_m - depth_m;
            let is_inland = normal.z > 0.99 && touch_m.x.abs() < inland_m && touch_m.y.abs() < inland_m;
            return Ok(Self { tool, along, gap_m, depth_m, drag_m: DVec3::ZERO, speed_m_per_s, is_inland });
        }
        bail!("no place for a tool was found")
    }

    /// Returns the press of a hand that is dragged on so far (m) where it touched, in the direction nearest to this across the one in which it pressed.
    pub(super) fn dragged(self, direction: DVec3, length_m: f64) -> Self {
        let across = direction.reject_from_normalized(self.along).normalize_or(self.along.any_orthonormal_vector());
        Self { drag_m: across * length_m, ..self }
    }
}

/// Returns the coupling of a random hand: a damped spring with this probability, else none.
pub(super) fn random_coupling(probability: f64, random: &mut Random) -> Coupling {
    if !random.chance(probability) {
        return Coupling::Rigid;
    }
    let (stiffness_n_per_m, mass_kg) = (random.log_within(200.0, 1000.0), random.log_within(0.02, 0.1));
    let critical = 2.0 * (stiffness_n_per_m * mass_kg).sqrt();
    Coupling::Spring { stiffness_n_per_m, mass_kg, damping_n_s_per_m: critical * random.within(0.2, 1.0) }
}

/// Tells what a hand's tool is.
pub(super) fn told(tool: &ToolSpec) -> String {
    let kind = if tool.coupling == Coupling::Rigid { "rigid" } else { "coupled" };
    let shape = if tool.shape.as_capsule().is_some() { "capsule" } else { "sphere" };
    format!("{kind} {shape} of {:.1} mm", 1e3 * tool.radius_m)
}

/// Returns whether a capsule at its start reaches into a body at rest, between vertices too.
fn cuts(shape: &ToolShape, centre_m: DVec3, radius_m: f64, bare: &Model) -> bool {
    let Some(capsule) = shape.as_capsule() else { return false };
    let half_m = capsule.start_orientation * (DVec3::Z * capsule.half_length_m);
    let (x, surface) = (bare.surface_rest_positions_m(), bare.surface());
    (-AXIS_PARTS..=AXIS_PARTS).any(|part| {
        let at_m = centre_m + half_m * (f64::from(part) / f64::from(AXIS_PARTS));
        (0..surface.triangles.len()).any(|triangle| {
            let corners = surface.triangle_nodes(triangle).map(|node| x[node as usize]);
            let [wa, wb, wc] = closest_weights(at_m, corners);
            at_m.distance(corners[0] * wa + corners[1] * wb + corners[2] * wc) < radius_m
        })
    })
}

impl fmt::Display for Press {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {:.2} m/s, {:.0} mm deep", told(&self.tool), self.speed_m_per_s, 1e3 * self.depth_m)?;
        if self.drag_m == DVec3::ZERO { Ok(()) } else { write!(f, ", dragged {:.0} mm", 1e3 * self.drag_m.length()) }
    }
}

/// The hand in the course of a press.
#[derive(Debug, Clone)]
pub(super) struct Hand<'a> {
    press: &'a Press,
    /// How far (m) it has gone.
    way_m: f64,
    /// The part of its drag that it has gone.
    dragged: f64,
    stayed: u32,
    is_back: bool,
}

impl<'a> Hand<'a> {
    pub(super) fn new(press: &'a Press) -> Self {
        Self { press, way_m: 0.0, dragged: 0.0, stayed: 0, is_back: false }
    }

    /// Returns whether it still goes deeper.
    pub(super) fn presses(&self) -> bool {
        self.stayed == 0
    }

    /// Returns whether it is over.
    pub(super) fn is_over(&self) -> bool {
        self.is_back
    }

    /// Moves on by a tick, against this force (N) on the device.
    pub(super) fn go_on(&mut self, period_s: f64, force_n: f64) -> ToolTarget {
        let Press { along, gap_m, depth_m, drag_m, speed_m_per_s, .. } = *self.press;
        let step_m = speed_m_per_s * period_s;
        let (mut moved_m, mut dragged) = (0.0, 0.0);
        if self.presses() && force_n < LARGEST_FORCE_N && self.way_m < gap_m + depth_m {
            moved_m = step_m.min(gap_m + depth_m - self.way_m);
        } else if self.stayed < STAYS_TICKS {
            self.stayed += 1;
        } else if self.dragged < 1.0 && drag_m != DVec3::ZERO && self.way_m > gap_m {
            dragged = (step_m / drag_m.length()).min(1.0 - self.dragged);
        } else {
            moved_m = -step_m.min(self.way_m);
            self.is_back = self.way_m <= step_m;
        }
        self.way_m += moved_m;
        self.dragged += dragged;
        ToolTarget {
            velocity_m_per_s: (along * moved_m + drag_m * dragged) / period_s,
            orientation: self.press.tool.start().orientation,
            ..ToolTarget::at(self.press.tool.start_position_m + along * self.way_m + drag_m * self.dragged)
        }
    }
}
