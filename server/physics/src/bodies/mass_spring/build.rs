//! Builds a mass-spring surface and its environment from specifications.
use super::{MassSpringBody, MassSpringError, MassSpringSpec};
use crate::{
    contact::{ContactModel, MostCarriers, SkinAtRest, SkinFollows},
    settings::Integrator,
    tick::{Environment, EnvironmentError, EnvironmentSpec, Frequencies, Steps, free_inverse_mass},
};
use glam::DVec3;

impl MassSpringBody {
    /// Checks the specification, builds the surface in its environment, and chooses the substeps.
    ///
    /// # Errors
    /// [`MassSpringError`]; nothing is repaired silently.
    pub(crate) fn build(
        mut spec: MassSpringSpec,
        around: EnvironmentSpec,
    ) -> Result<(Self, Environment), MassSpringError> {
        demand(&around)?;
        let vertices = spec.springs.surface.positions_m().len();
        spec.springs.held = held(&around, vertices)?;
        let mut body = Self::of(spec, &around.tools)?;
        demand_all_awake(&around, &body)?;
        let (surface, rest_m) = (body.skin(), body.model().rest_m());
        around.check(&surface, rest_m, vertices)?;
        let omega = body.model().frequency_rad_per_s();
        let bearing_kg = body.contact_mass_kg();
        let skin = SkinAtRest {
            positions_m: rest_m,
            surface: &surface,
            moduli: &body.moduli(),
            mass_kg: &bearing_kg,
            bearing_kg: &bearing_kg,
            max_natural_frequency_rad_per_s: omega,
            follows: SkinFollows::StiffElements,
            carriers: MostCarriers::default(),
        };
        let contact = ContactModel::build(&skin, &around.tools);
        // A wall that sleeps could not be pushed out.
        let is_hollow = body.model().surface().is_closed() && body.is_all_awake();
        let contact = if is_hollow { contact.hollow() } else { contact };
        body.cluster(contact.triangles());
        let omega_sq = body.model().touched_frequency_sq(&contact.nodal_stiffness_n_per_m) + contact.tool_frequency_sq;
        let frequencies = Frequencies { alone: omega, touched: omega_sq.sqrt(), damping_per_s: 0.0 };
        let steps = Steps::choose(&around.settings, frequencies)?;
        free_inverse_mass(&body.model().spec().mass_kg, &around.prescribed)?;
        Ok((body, Environment::new(around, surface, contact, steps)))
    }
}

fn refused(what: &'static str, instead: &'static str) -> MassSpringError {
    MassSpringError::NotForSprings { what, instead }
}

/// Refuses settings and constraints that a mass-spring surface cannot have.
fn demand(around: &EnvironmentSpec) -> Result<(), MassSpringError> {
    let settings = &around.settings;
    let demands = [
        (around.prescribed.iter().all(|set| set.axes == [true; 3]), "vertices held along some axes", "hold all three"),
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

/// Returns all prescribed vertices, ascending, of a surface with so many vertices.
fn held(around: &EnvironmentSpec, vertices: usize) -> Result<Vec<u32>, EnvironmentError> {
    let mut held: Vec<u32> = around.prescribed.iter().flat_map(|set| set.nodes.iter().copied()).collect();
    held.sort_unstable();
    held.dedup();
    match held.last().filter(|last| **last as usize >= vertices) {
        Some(&last) => Err(EnvironmentError::OutOfRange { what: "node", index: last as usize, count: vertices }),
        None => Ok(held),
    }
}

/// Refuses gravity and loads where not all vertices are awake, as they would move sleeping ones.
fn demand_all_awake(around: &EnvironmentSpec, body: &MassSpringBody) -> Result<(), MassSpringError> {
    if body.is_all_awake() {
        return Ok(());
    }
    let all = "let all of its vertices be awake, or leave it out";
    if around.gravity_m_per_s2 != DVec3::ZERO {
        return Err(refused("gravity, which moves vertices that sleep", all));
    }
    if around.loads.is_empty() { Ok(()) } else { Err(refused("loads, which move vertices that sleep", all)) }
}
