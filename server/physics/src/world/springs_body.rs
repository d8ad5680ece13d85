//! What a mass-spring surface needs of a specification, and what it cannot have.
use super::{ModelError, ModelSpec};
use crate::bodies::mass_spring::{SpringBody, SpringBodyError};
use crate::settings::Integrator;
use glam::DVec3;

fn refused(what: &'static str, instead: &'static str) -> ModelError {
    SpringBodyError::NotForSprings { what, instead }.into()
}

pub(super) fn demand(spec: &ModelSpec) -> Result<(), ModelError> {
    let settings = &spec.settings;
    let demands = [
        (spec.mesh.tets().is_empty(), "tets", "give it a surface alone"),
        (spec.particles.is_none() && spec.seed.is_none(), "particles", "leave them out"),
        (spec.regions.is_empty(), "materials", "its constants are those of its springs"),
        (spec.prescribed.iter().all(|set| set.axes == [true; 3]), "vertices held along some axes", "hold all three"),
        (settings.integrator == Integrator::Leapfrog, "this integrator", "take leapfrog"),
        (
            settings.sleep_tolerance_m == 0.0,
            "a body that sleeps as a whole",
            "leave sleep_tolerance at 0: its vertices sleep where nothing touches them, if fewer may be awake than it has",
        ),
    ];
    match demands.into_iter().find(|(kept, ..)| !kept) {
        Some((_, what, instead)) => Err(refused(what, instead)),
        None => Ok(()),
    }
}

/// All that is prescribed, of so many vertices.
pub(super) fn held(spec: &ModelSpec, vertices: usize) -> Result<Vec<u32>, ModelError> {
    let mut held: Vec<u32> = spec.prescribed.iter().flat_map(|set| set.nodes.iter().copied()).collect();
    held.sort_unstable();
    held.dedup();
    match held.last().filter(|last| **last as usize >= vertices) {
        Some(&last) => Err(ModelError::OutOfRange { what: "node", index: last as usize, count: vertices }),
        None => Ok(held),
    }
}

/// Gravity and loads act on what would sleep.
pub(super) fn demand_all_awake(spec: &ModelSpec, body: &SpringBody) -> Result<(), ModelError> {
    if body.is_all_awake() {
        return Ok(());
    }
    let all = "let all of its vertices be awake, or leave it out";
    if spec.gravity_m_per_s2 != DVec3::ZERO {
        return Err(refused("gravity, which moves vertices that sleep", all));
    }
    if spec.loads.is_empty() { Ok(()) } else { Err(refused("loads, which move vertices that sleep", all)) }
}
