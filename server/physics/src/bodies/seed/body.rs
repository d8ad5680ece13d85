//! The papers' hybrid as a body of the loop.
use super::{
    LayerSpec, SeedBodyState, SeedError, SeedModel, SeedParameters, SeedSpec, core::outer_part, layer::enclosed_m3,
};
use crate::{
    contact::{ContactModel, MostCarriers, SkinAtRest, SkinFollows, SurfaceModuli},
    elements::{
        integration_points::IntegrationPoints,
        rest_stiffness::{RestStiffness, max_natural_frequency_rad_per_s},
        solid::Solid,
    },
    material::{Law, Material},
    mesh::{Surface, TetMesh},
    settings::{Integrator, MAX_SUBSTEPS, Substeps},
    tick::{Energies, Environment, EnvironmentError, EnvironmentSpec, MechanicalState, Steps, free_inverse_mass},
};
use glam::DVec3;

/// Part of the longest stable step of contact and couplings that the body's step may be.
const STEP_SAFETY: f64 = 0.9;

/// What a seed body is made from.
#[derive(Debug, Clone, PartialEq)]
pub struct SeedBodySpec {
    /// The core, whose one St. Venant-Kirchhoff material is that of the parameters. Prescribed nodes are held.
    pub core: Solid,
    /// The particles around the core; without them the core's boundary is touched.
    pub layer: Option<LayerSpec>,
    /// Constants. `dt_s` is the longest step: a tick is taken in equal steps that are no longer than this.
    pub parameters: SeedParameters,
}

impl SeedBodySpec {
    /// Returns the volume (m³) of core and layer, given the core's boundary.
    pub fn volume_m3(&self, boundary: &Surface) -> f64 {
        let core = &self.core.mesh;
        let core_m3 = core.total_volume_m3();
        let Some(layer) = &self.layer else { return core_m3 };
        let triangles: Vec<[u32; 3]> = (0..boundary.triangles.len()).map(|t| boundary.triangle_nodes(t)).collect();
        let outer = outer_part(core.positions_m(), &triangles);
        core_m3 + enclosed_m3(&layer.skin_m, &layer.skin_triangles) - enclosed_m3(core.positions_m(), &outer)
    }
}

/// A seed body in the loop. It does not change after it is loaded.
#[derive(Debug, Clone)]
pub struct SeedBody {
    model: SeedModel,
    core: Solid,
    layer: Option<LayerSpec>,
    /// Rest positions (m) of core and skin.
    rest_m: Vec<DVec3>,
    mass_kg: Vec<f64>,
    /// Inverse mass `1/m` (1/kg) per node and axis, zero where the node is held.
    inverse_mass_per_kg: Vec<DVec3>,
    max_natural_frequency_rad_per_s: f64,
}

impl SeedBody {
    /// Checks the specification and builds the body in its environment. A tick is taken in the smallest number of equal
    /// steps that are no longer than the parameters' `dt_s`.
    ///
    /// # Errors
    /// [`SeedError`]; nothing is repaired silently.
    pub(crate) fn build(spec: SeedBodySpec, around: EnvironmentSpec) -> Result<(Self, Environment), SeedError> {
        Surface::of(&spec.core.mesh)?;
        let SeedBodySpec { core, layer, parameters } = spec;
        demand(&around, &core, &parameters)?;
        let tick_period_s = around.settings.tick_period_s;
        let substeps = steps_per_tick(tick_period_s, parameters.dt_s)?;
        let model = SeedModel::build(SeedSpec {
            core: core.mesh.clone(),
            held_nodes: around.prescribed.iter().flat_map(|set| set.nodes.iter().copied()).collect(),
            layer: layer.clone(),
            parameters: SeedParameters { dt_s: tick_period_s / f64::from(substeps), ..parameters },
        })?;
        let (surface, rest_m, mass_kg) = (model.node_surface(), model.node_rest_m(), model.node_mass_kg());
        core.check()?;
        around.check(&surface, &rest_m, core.mesh.positions_m().len())?;
        around.demand_spheres("a body of the papers' hybrid, which is touched at one triangle")?;
        let inverse_mass_per_kg = free_inverse_mass(&mass_kg, &around.prescribed)?;
        let materials = [*model.core().material()];
        let points =
            IntegrationPoints::of_linear_tets(&core.mesh, model.core().rest_tets(), &core.tet_region, &materials);
        let of_core = RestStiffness { points: &points, springs_n_per_m: &[] };
        let core_nodes = core.mesh.positions_m().len();
        let omega = max_natural_frequency_rad_per_s(&of_core, &inverse_mass_per_kg[..core_nodes]);
        // Contact is made so that its natural frequency hardly exceeds this: the explicit step bears (ω dt)² ≤ 4, and
        // this is a quarter of it.
        let contact_rad_per_s = model.parameters().dt_s.recip();
        let bearing_kg = model.contact_mass_kg();
        let skin = SkinAtRest {
            positions_m: &rest_m,
            surface: &surface,
            moduli: &moduli(&model),
            mass_kg: &bearing_kg,
            bearing_kg: &bearing_kg,
            max_natural_frequency_rad_per_s: contact_rad_per_s,
            follows: SkinFollows::StiffElements,
            carriers: MostCarriers::default(),
        };
        let contact = ContactModel::build(&skin, &around.tools);
        demand_soft_couplings(&contact, &model)?;
        let enough = f64::from(substeps);
        let steps = Steps {
            substeps,
            substeps_per_long_step: 1,
            enough,
            grows_with_contact: 0.0,
            frequency_sq: 0.0,
            for_viscosity: 1.0,
        };
        let body =
            Self { model, core, layer, rest_m, mass_kg, inverse_mass_per_kg, max_natural_frequency_rad_per_s: omega };
        Ok((body, Environment::new(around, surface, contact, steps)))
    }

    /// Returns the papers' model.
    pub fn model(&self) -> &SeedModel {
        &self.model
    }

    /// Returns the core's mesh.
    pub fn mesh(&self) -> &TetMesh {
        &self.core.mesh
    }

    /// Returns the core with its material.
    pub fn core(&self) -> &Solid {
        &self.core
    }

    /// Returns what the body was built from.
    pub(crate) fn spec(&self) -> (&Solid, &Option<LayerSpec>, &SeedParameters) {
        (&self.core, &self.layer, self.model.parameters())
    }

    /// Returns the rest positions (m) of the core's nodes, then of the skin's vertices.
    pub fn rest_positions_m(&self) -> &[DVec3] {
        &self.rest_m
    }

    /// Returns the mass (kg) of every node.
    pub fn mass_kg(&self) -> &[f64] {
        &self.mass_kg
    }

    /// Returns the inverse mass `1/m` (1/kg) per node and axis, which is zero where the node is held.
    pub fn inverse_mass_per_kg(&self) -> &[DVec3] {
        &self.inverse_mass_per_kg
    }

    /// Returns the largest natural frequency (rad/s) of the core at rest.
    pub fn max_natural_frequency_rad_per_s(&self) -> f64 {
        self.max_natural_frequency_rad_per_s
    }

    /// Returns the kinetic energy, the core's elastic energy, and the external work. The elastic energy of particles
    /// and links is not known, and so neither is the dissipation, which is left at zero.
    pub(crate) fn energies(&self, own: &SeedBodyState, state: &MechanicalState) -> Energies {
        Energies {
            kinetic_j: self.model.kinetic_energy_j(&own.now),
            elastic_j: self.elastic_energy_j(&state.x),
            external_work_j: state.ledger.external_work_j,
            ..Energies::default()
        }
    }

    /// Returns the elastic energy `Σ V Ψ(F)` (J) of the core at the positions `x` (m).
    pub(crate) fn elastic_energy_j(&self, x: &[DVec3]) -> f64 {
        let core = self.model.core();
        let of_tet = |(nodes, rest): (&[u32; 4], &crate::elements::linear_tet::RestTet)| {
            rest.energy_j(core.material(), &nodes.map(|n| x[n as usize]))
        };
        self.mesh().tets().iter().zip(core.rest_tets()).map(of_tet).sum()
    }
}

/// Returns the smallest number of equal steps per tick that are no longer than `dt_s`.
fn steps_per_tick(tick_period_s: f64, dt_s: f64) -> Result<u32, EnvironmentError> {
    // A tick of a whole number of steps must not get one more because of its last digit.
    const ROUNDING: f64 = 1e-9;
    let steps = (tick_period_s / dt_s * (1.0 - ROUNDING)).ceil().max(1.0);
    if steps <= f64::from(MAX_SUBSTEPS) {
        return Ok(steps as u32);
    }
    Err(EnvironmentError::Setting { name: "dt_s", value: dt_s, rule: "must leave 100000 steps or fewer to a tick" })
}

/// Refuses settings and constraints that a seed body cannot have.
fn demand(around: &EnvironmentSpec, core: &Solid, parameters: &SeedParameters) -> Result<(), SeedError> {
    let SeedParameters { lame, viscosity, convention, density_kg_per_m3, .. } = *parameters;
    let material = Material::new(Law::StVenantKirchhoff, lame, viscosity, convention);
    let is_its = core.regions.len() == 1
        && core.regions.iter().all(|r| r.material == material && r.density_kg_per_m3 == density_kg_per_m3);
    let settings = &around.settings;
    let demands = [
        (is_its, "other materials than the one of its parameters", "give it one St. Venant-Kirchhoff material"),
        (around.gravity_m_per_s2 == DVec3::ZERO, "gravity", "its particles have none; leave it out"),
        (around.prescribed.iter().all(|set| set.axes == [true; 3]), "nodes held along some axes", "hold all three"),
        (
            settings.integrator == Integrator::Leapfrog,
            "another integrator",
            "it has its own two; leave this at leapfrog",
        ),
        (settings.substeps == Substeps::Measured, "a number of substeps", "give its step dt_s"),
        (settings.mass_damping_per_s == 0.0, "mass damping", "its viscosities damp it; leave it at 0"),
        (settings.sleep_tolerance_m == 0.0, "sleep of the whole body", "leave sleep_tolerance_m at 0"),
    ];
    match demands.into_iter().find(|(kept, ..)| !kept) {
        Some((_, what, instead)) => Err(SeedError::NotForSeeds { what, instead }),
        None => Ok(()),
    }
}

/// Returns the moduli behind every triangle of the surface: those of the layer, where there is one, and else those of
/// the core.
fn moduli(seed: &SeedModel) -> Vec<SurfaceModuli> {
    let lame = seed.core().material().lame;
    let factor = if seed.layer().is_some() { seed.parameters().layer_factor() } else { 1.0 };
    let moduli = SurfaceModuli {
        p_wave_pa: factor * lame.p_wave_modulus_pa(),
        indentation_pa: factor * lame.young_modulus_pa() / (1.0 - lame.poisson_ratio().powi(2)),
    };
    vec![moduli; seed.surface_triangles().len()]
}

/// Refuses couplings that are too stiff for the body's step, in which the tools on them are stepped, too.
fn demand_soft_couplings(contact: &ContactModel, seed: &SeedModel) -> Result<(), SeedError> {
    let dt_s = seed.parameters().dt_s;
    let longest_s = STEP_SAFETY * 2.0 / contact.tool_frequency_sq.sqrt();
    if dt_s <= longest_s { Ok(()) } else { Err(SeedError::CouplingTooStiff { dt_s, longest_s }) }
}
