//! Builds a hybrid body and its environment from a specification.
use super::{HybridBody, HybridError, HybridSpec, body::Built};
use crate::{
    contact::{ContactModel, MostCarriers, SkinAtRest, SkinFollows, moduli},
    mesh::Surface,
    settings::Integrator,
    tick::{
        Environment, EnvironmentSpec, Frequencies, Steps, damping_growth, free_inverse_mass, progress as building,
        stiffening,
    },
};
use glam::{DVec2, DVec3};

impl HybridBody {
    /// Checks the specification, lays the lattice out, and chooses the substeps. `progress` is told the fraction done.
    ///
    /// # Errors
    /// Returns a [`HybridError`] for the first fault found; nothing is repaired silently.
    pub(crate) fn build(
        spec: HybridSpec,
        mut around: EnvironmentSpec,
        progress: &mut dyn FnMut(f64),
    ) -> Result<(Self, Environment), HybridError> {
        let HybridSpec { coarse, particles } = spec;
        let boundary = Surface::of(&coarse.mesh)?;
        let skin = &particles.skin;
        let surface = Surface::alone(skin.positions_m().len(), skin.triangles().to_vec());
        coarse.check()?;
        around.check(&surface, skin.positions_m(), coarse.mesh.positions_m().len())?;
        demand(&around)?;
        let materials = coarse.materials();
        let Built { body: mut hybrid, prescribed } =
            Self::lay_out(&coarse, &boundary, particles, &around.prescribed, &mut building::laying(progress))?;
        around.prescribed = prescribed;
        let mass_kg = &hybrid.masses().node_kg;
        let mut inverse_mass_per_kg = free_inverse_mass(mass_kg, &around.prescribed)?;
        for (inverse, mass) in inverse_mass_per_kg.iter_mut().zip(mass_kg) {
            // A node that nothing follows stays where it is.
            *inverse = if *mass > 0.0 { *inverse } else { DVec3::ZERO };
        }
        hybrid.inverse_mass_per_kg = inverse_mass_per_kg;
        let omega = hybrid.frequency_rad_per_s(&[], &mut building::untouched(progress));
        hybrid.max_natural_frequency_rad_per_s = omega;
        let vertices = hybrid.skin_rest_m().len() as u32;
        let moduli_pa: Vec<DVec2> = (0..vertices).map(|v| moduli::moduli_pa(hybrid.material_at(v))).collect();
        let moduli = moduli::mean_over_corners(&moduli_pa, &surface);
        let mass_kg = hybrid.vertex_masses_kg(&surface.triangles);
        let bearing_kg = hybrid.bearing_masses_kg(&surface.nodes);
        let skin = SkinAtRest {
            positions_m: hybrid.skin_rest_m(),
            surface: &surface,
            moduli: &moduli,
            mass_kg: &mass_kg,
            bearing_kg: &bearing_kg,
            max_natural_frequency_rad_per_s: omega,
            follows: if hybrid.particles().smooth_skin {
                SkinFollows::Means { apart_m: hybrid.particles().spacing_m }
            } else {
                SkinFollows::StiffElements
            },
            carriers: MostCarriers {
                nodes: hybrid.node_count(),
                active: hybrid.particles().most_active,
                of_clusters: 0,
            },
        };
        let walls = hybrid.walls(&skin, &moduli_pa, &around);
        let mut contact = ContactModel::build(&skin, &around.tools).with_walls(walls);
        hybrid.cluster(contact.triangles());
        if let Some(walls) = contact.walls() {
            let followed = hybrid.cluster_walls(walls.triangles());
            contact = contact.with_walls_following(followed);
        }
        let stretch_sq = stiffening(&around.settings, &materials);
        let touched = if contact.nodal_stiffness_n_per_m.is_empty() {
            omega
        } else {
            let springs = hybrid.particle_springs_n_per_m(&contact.nodal_stiffness_n_per_m);
            // λ_max(s K + C) = s λ_max(K + C/s)
            let springs: Vec<f64> = springs.iter().map(|k| k / stretch_sq).collect();
            hybrid.frequency_rad_per_s(&springs, &mut building::touched(progress))
        };
        let omega_sq = stretch_sq * touched.max(omega).powi(2) + contact.tool_frequency_sq;
        let alone = stretch_sq.sqrt() * omega;
        let damping_per_s = damping_growth(&around.settings) * hybrid.damping_per_s(&mut building::damped(progress));
        let steps = Steps::choose(&around.settings, Frequencies { alone, touched: omega_sq.sqrt(), damping_per_s })?;
        let coarse_omega = stretch_sq.sqrt() * hybrid.coarse_frequency_rad_per_s();
        let coarse_damping_per_s = damping_growth(&around.settings) * hybrid.coarse_damping_per_s();
        let steps = steps.with_fine_level().with_long_steps(&around.settings, coarse_omega, coarse_damping_per_s);
        Ok((hybrid, Environment::new(around, surface, contact, steps)))
    }
}

/// Refuses settings that a body with particles cannot have.
fn demand(around: &EnvironmentSpec) -> Result<(), HybridError> {
    let refused = |what, instead| Err(HybridError::NotForParticles { what, instead });
    if around.settings.integrator != Integrator::Leapfrog {
        return refused("this integrator", "take leapfrog");
    }
    Ok(())
}
