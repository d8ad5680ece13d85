//! One constructor for each kind of body.
use super::Model;
use crate::{
    bodies::{
        hybrid::{Hybrid, ParticleSpec, body::Built},
        mass_spring::{SpringBody, SpringBodySpec},
        seed::SeedBodySpec,
    },
    contact::{ContactModel, SurfaceModuli},
    elements::{
        linear_tet::RestTet,
        mass,
        rest_stiffness::{RestStiffness, max_natural_frequency_rad_per_s, max_natural_frequency_with},
    },
    integrate::{Body, RestBound, Scheme},
    kernels::ForceKernel,
    material::Material,
    mesh::Surface,
};
use crate::{
    settings::{Integrator, PrescribedSpec},
    world::{ModelError, ModelSpec, building, check, seed_body, springs_body, substeps},
};
use glam::{DVec2, DVec3};

impl Model {
    pub(super) fn of_tets(
        spec: ModelSpec,
        surface: Surface,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Self, ModelError> {
        check::spec(&spec, &surface, spec.mesh.positions_m())?;
        let rest_tets: Vec<RestTet> =
            (0..spec.mesh.tets().len()).map(|tet| RestTet::new(&spec.mesh.edge_matrix_m(tet))).collect();
        let materials: Vec<Material> = spec.regions.iter().map(|region| region.material).collect();
        let density = |tet: usize| spec.regions[spec.tet_region[tet] as usize].density_kg_per_m3;
        let mass_kg = mass::lumped_kg(&spec.mesh, density);
        let inverse_mass_per_kg = free_inverse_mass(&mass_kg, &spec.prescribed)?;
        let kernel = ForceKernel::build(&spec.mesh, &rest_tets, &spec.tet_region, &materials, spec.settings.precision);
        let kernel = if spec.settings.skips.viscous_terms { kernel } else { kernel.with_every_viscosity() };
        let at_rest = RestStiffness {
            mesh: &spec.mesh,
            rest_tets: &rest_tets,
            tet_material: &spec.tet_region,
            materials: &materials,
            springs_n_per_m: &[],
        };
        let omega = max_natural_frequency_with(&at_rest, &inverse_mass_per_kg, &mut building::untouched(progress));
        let contact = ContactModel::build(
            spec.mesh.positions_m(),
            &surface,
            &moduli_of_triangles(&spec, &surface),
            &mass_kg,
            omega,
            &spec.tools,
        );
        let stretch_sq = substeps::stiffening(&spec.settings, &materials);
        // λ_max(s K + C) = s λ_max(K + C/s)
        let springs: Vec<f64> = contact.nodal_stiffness_n_per_m.iter().map(|k| k / stretch_sq).collect();
        let touched = if springs.is_empty() {
            omega
        } else {
            let touched = RestStiffness { springs_n_per_m: &springs, ..at_rest };
            max_natural_frequency_with(&touched, &inverse_mass_per_kg, &mut building::touched(progress))
        };
        let explicit_sq = match spec.settings.integrator {
            // The body and its contact are implicit; tools on couplings are not.
            Integrator::BackwardEuler => 0.0,
            _ => stretch_sq * touched.max(omega).powi(2),
        };
        let omega_sq = explicit_sq + contact.tool_frequency_sq;
        let substeps = substeps::choose(&spec, &materials, omega_sq.sqrt())?;
        let dt_s = spec.settings.tick_period_s / f64::from(substeps);
        let body = Body { at_rest, mass_kg: &mass_kg, inverse_mass_per_kg: &inverse_mass_per_kg, dt_s };
        let scheme = Scheme::build(spec.settings.integrator, &body);
        let mut model = Self {
            surface,
            materials,
            rest_tets,
            mass_kg,
            inverse_mass_per_kg,
            kernel,
            contact,
            max_natural_frequency_rad_per_s: omega,
            substeps,
            substeps_per_long_step: 1,
            scheme,
            rest_bound: None,
            hybrid: None,
            seed: None,
            seed_rest_m: Vec::new(),
            springs: None,
            spec,
        };
        model.rest_bound = RestBound::new(&model).map_err(|source| ModelError::Sleep { source: Box::new(source) })?;
        Ok(model)
    }

    pub(super) fn of_springs(spec: ModelSpec, mut wanted: SpringBodySpec) -> Result<Self, ModelError> {
        springs_body::demand(&spec)?;
        wanted.springs.held = springs_body::held(&spec, wanted.springs.surface.positions_m().len())?;
        let mut body = SpringBody::build(wanted, &spec.tools)?;
        springs_body::demand_all_awake(&spec, &body)?;
        let (surface, rest_m) = (body.skin(), body.model().rest_m());
        check::spec(&spec, &surface, rest_m)?;
        let omega = body.model().frequency_rad_per_s();
        let contact =
            ContactModel::build(rest_m, &surface, &body.moduli(), &body.contact_mass_kg(), omega, &spec.tools);
        body.cluster(contact.triangles());
        let omega_sq = body.model().touched_frequency_sq(&contact.nodal_stiffness_n_per_m) + contact.tool_frequency_sq;
        let substeps = substeps::choose(&spec, &[], omega_sq.sqrt())?;
        let mass_kg = body.model().spec().mass_kg.clone();
        let inverse_mass_per_kg = free_inverse_mass(&mass_kg, &spec.prescribed)?;
        Ok(Self {
            kernel: ForceKernel::build(&spec.mesh, &[], &[], &[], spec.settings.precision),
            rest_tets: Vec::new(),
            surface,
            materials: Vec::new(),
            mass_kg,
            inverse_mass_per_kg,
            contact,
            max_natural_frequency_rad_per_s: omega,
            substeps,
            substeps_per_long_step: 1,
            scheme: Scheme::Leapfrog,
            rest_bound: None,
            hybrid: None,
            seed: None,
            seed_rest_m: Vec::new(),
            springs: Some(Box::new(body)),
            spec,
        })
    }

    pub(super) fn of_seed(spec: ModelSpec, wanted: SeedBodySpec) -> Result<Self, ModelError> {
        let (seed, substeps) = seed_body::build(&spec, wanted)?;
        let (surface, seed_rest_m, mass_kg) = (seed.node_surface(), seed.node_rest_m(), seed.node_mass_kg());
        check::spec(&spec, &surface, &seed_rest_m)?;
        let materials = vec![*seed.core().material()];
        let inverse_mass_per_kg = free_inverse_mass(&mass_kg, &spec.prescribed)?;
        let of_core = RestStiffness {
            mesh: &spec.mesh,
            rest_tets: seed.core().rest_tets(),
            tet_material: &spec.tet_region,
            materials: &materials,
            springs_n_per_m: &[],
        };
        let core_nodes = spec.mesh.positions_m().len();
        let omega = max_natural_frequency_rad_per_s(&of_core, &inverse_mass_per_kg[..core_nodes]);
        let contact = ContactModel::build(
            &seed_rest_m,
            &surface,
            &seed_body::moduli(&seed),
            &seed.contact_mass_kg(),
            seed_body::contact_frequency_rad_per_s(&seed),
            &spec.tools,
        );
        seed_body::demand_soft_couplings(&contact, &seed)?;
        Ok(Self {
            kernel: ForceKernel::build(&spec.mesh, &[], &[], &materials, spec.settings.precision),
            rest_tets: seed.core().rest_tets().to_vec(),
            surface,
            materials,
            mass_kg,
            inverse_mass_per_kg,
            contact,
            max_natural_frequency_rad_per_s: omega,
            substeps,
            substeps_per_long_step: 1,
            scheme: Scheme::Seed,
            rest_bound: None,
            hybrid: None,
            seed: Some(Box::new(seed)),
            seed_rest_m,
            springs: None,
            spec,
        })
    }

    pub(super) fn of_particles(
        spec: ModelSpec,
        boundary: &Surface,
        particles: &ParticleSpec,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Self, ModelError> {
        let skin = &particles.skin;
        let surface = Surface::alone(skin.positions_m().len(), skin.triangles().to_vec());
        check::spec(&spec, &surface, skin.positions_m())?;
        check::particles(&spec)?;
        let materials: Vec<Material> = spec.regions.iter().map(|region| region.material).collect();
        let densities: Vec<f64> = spec.regions.iter().map(|region| region.density_kg_per_m3).collect();
        let of = (&spec.mesh, boundary);
        let built = {
            let (tell, made_of) = (&mut building::laying(progress), (&materials[..], &densities[..]));
            Hybrid::build(particles, of, &spec.prescribed, made_of, &spec.tet_region, tell)?
        };
        let Built { mut hybrid, mesh, prescribed } = built;
        let spec = ModelSpec { mesh, prescribed, ..spec };
        let mass_kg = hybrid.masses().node_kg.clone();
        let mut inverse_mass_per_kg = free_inverse_mass(&mass_kg, &spec.prescribed)?;
        for (inverse, mass) in inverse_mass_per_kg.iter_mut().zip(&mass_kg) {
            // A node that nothing follows stays where it is.
            *inverse = if *mass > 0.0 { *inverse } else { DVec3::ZERO };
        }
        let omega = hybrid.frequency_rad_per_s(&[], &mut building::untouched(progress));
        let moduli: Vec<DVec2> = (0..skin.positions_m().len() as u32).map(|v| moduli(hybrid.material_at(v))).collect();
        let vertex_masses_kg = hybrid.vertex_masses_kg(skin);
        let moduli = mean_of_triangles(&moduli, &surface);
        let contact = ContactModel::build(skin.positions_m(), &surface, &moduli, &vertex_masses_kg, omega, &spec.tools);
        hybrid.cluster(skin, contact.triangles());
        let stretch_sq = substeps::stiffening(&spec.settings, &materials);
        let touched = if contact.nodal_stiffness_n_per_m.is_empty() {
            omega
        } else {
            let springs = hybrid.particle_springs_n_per_m(&contact.nodal_stiffness_n_per_m);
            // λ_max(s K + C) = s λ_max(K + C/s)
            let springs: Vec<f64> = springs.iter().map(|k| k / stretch_sq).collect();
            hybrid.frequency_rad_per_s(&springs, &mut building::touched(progress))
        };
        let omega_sq = stretch_sq * touched.max(omega).powi(2) + contact.tool_frequency_sq;
        let substeps = substeps::choose(&spec, &materials, omega_sq.sqrt())?;
        let coarse_omega = stretch_sq.sqrt() * hybrid.coarse_frequency_rad_per_s();
        let (substeps, substeps_per_long_step) = substeps::long_steps(&spec, &materials, coarse_omega, substeps);
        Ok(Self {
            kernel: ForceKernel::build(&spec.mesh, &[], &[], &materials, spec.settings.precision),
            rest_tets: Vec::new(),
            surface,
            materials,
            mass_kg,
            inverse_mass_per_kg,
            contact,
            max_natural_frequency_rad_per_s: omega,
            substeps,
            substeps_per_long_step,
            scheme: Scheme::Leapfrog,
            rest_bound: None,
            hybrid: Some(Box::new(hybrid)),
            seed: None,
            seed_rest_m: Vec::new(),
            springs: None,
            spec,
        })
    }
}

/// `λ + 2µ` and `E/(1 − ν²)` (Pa).
fn moduli(material: &Material) -> DVec2 {
    let lame = material.lame;
    DVec2::new(lame.p_wave_modulus_pa(), lame.young_modulus_pa() / (1.0 - lame.poisson_ratio().powi(2)))
}

/// Mean over a triangle's corners of the stiffest tet at each.
fn moduli_of_triangles(spec: &ModelSpec, surface: &Surface) -> Vec<SurfaceModuli> {
    let mut of_node = vec![DVec2::ZERO; spec.mesh.positions_m().len()];
    for (tet, nodes) in spec.mesh.tets().iter().enumerate() {
        let moduli = moduli(&spec.regions[spec.tet_region[tet] as usize].material);
        for &node in nodes {
            of_node[node as usize] = of_node[node as usize].max(moduli);
        }
    }
    mean_of_triangles(&of_node, surface)
}

fn mean_of_triangles(of_node: &[DVec2], surface: &Surface) -> Vec<SurfaceModuli> {
    let mean = |triangle| surface.triangle_nodes(triangle).iter().map(|&n| of_node[n as usize]).sum::<DVec2>() / 3.0;
    (0..surface.triangles.len())
        .map(|triangle| SurfaceModuli { p_wave_pa: mean(triangle).x, indentation_pa: mean(triangle).y })
        .collect()
}

fn free_inverse_mass(mass_kg: &[f64], prescribed: &[PrescribedSpec]) -> Result<Vec<DVec3>, ModelError> {
    let mut inverse: Vec<DVec3> = mass_kg.iter().map(|m| DVec3::splat(1.0 / m)).collect();
    let mut owner: Vec<[Option<usize>; 3]> = vec![[None; 3]; mass_kg.len()];
    for (set, spec) in prescribed.iter().enumerate() {
        for &node in &spec.nodes {
            for axis in (0..3).filter(|&axis| spec.axes[axis]) {
                let slot = &mut owner[node as usize][axis];
                if let Some(first) = slot.replace(set) {
                    return Err(ModelError::PrescribedTwice {
                        node,
                        axis: ['x', 'y', 'z'][axis],
                        first: prescribed[first].name.clone(),
                        second: spec.name.clone(),
                    });
                }
                inverse[node as usize][axis] = 0.0;
            }
        }
    }
    Ok(inverse)
}
