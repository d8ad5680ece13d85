//! [`Model`] (constant after load), [`State`] (what a tick changes) and [`Scratch`] (buffers, no meaning between ticks).
use crate::{
    contact::{ContactModel, ContactScratch, ContactState, SurfaceModuli, ToolSpec, ToolState, ToolTarget},
    fem::{element::RestTet, mass},
    health::{LastGood, Ledger, Quarantine, ViscousPower},
    integrate::spectrum,
    material::Material,
    mesh::{MeshError, Surface, TetMesh},
    simd::{ForceKernel, KernelScratch},
};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A material and density shared by some tets.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// Name for messages.
    pub name: String,
    /// Constitutive law and constants.
    pub material: Material,
    /// Density (kg/m³).
    pub density_kg_per_m3: f64,
}

/// A load at factor 1; every tick scales it ([`TickInput::load_factors`]).
#[derive(Debug, Clone, PartialEq)]
pub enum LoadSpec {
    /// Forces on nodes (N, world).
    NodalForces(Vec<(u32, DVec3)>),
    /// Dead traction on surface triangles (Pa, world), per rest area.
    Traction {
        /// Surface triangle indices.
        triangles: Vec<u32>,
        /// Traction (Pa).
        traction_pa: DVec3,
    },
    /// Pressure on surface triangles (Pa, positive pushes inwards).
    Pressure {
        /// Surface triangle indices.
        triangles: Vec<u32>,
        /// Pressure (Pa).
        pressure_pa: f64,
        /// Follows the deformed surface, or acts as at rest (dead).
        follower: bool,
    },
}

/// Nodes whose displacement is prescribed along some axes ([`TickInput::prescribed_displacements_m`]); fixed ones are prescribed zero.
#[derive(Debug, Clone, PartialEq)]
pub struct PrescribedSpec {
    /// Name for reactions.
    pub name: String,
    /// Nodes.
    pub nodes: Vec<u32>,
    /// Which of x, y, z are prescribed.
    pub axes: [bool; 3],
}

/// Precision of the force kernel. State and time integration are f64 always.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// f32 forces, f64 state: the default of haptic scenes.
    #[default]
    Single,
    /// f64 throughout.
    Double,
}

/// How many substeps a tick takes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Substeps {
    /// From the measured ω_max (see [`Model::substeps`]).
    #[default]
    Measured,
    /// As given, stable or not.
    Fixed(u32),
}

/// Numerical settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Tick period T (s).
    pub tick_period_s: f64,
    /// Substeps per tick.
    pub substeps: Substeps,
    /// Fraction of the stable step used, in (0, 1].
    pub step_safety: f64,
    /// Largest principal stretch the step must stay stable at (≥ 1).
    pub stretch_allowance: f64,
    /// Precision of the force kernel.
    pub precision: Precision,
    /// Mass-proportional damping c (1/s): `v̇ = … − c v`.
    pub mass_damping_per_s: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            tick_period_s: 1e-3,
            substeps: Substeps::Measured,
            step_safety: 0.9,
            stretch_allowance: 1.2,
            precision: Precision::Single,
            mass_damping_per_s: 0.0,
        }
    }
}

/// Everything a [`Model`] is built from.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelSpec {
    /// Rest mesh.
    pub mesh: TetMesh,
    /// Materials.
    pub regions: Vec<Region>,
    /// Region of each tet.
    pub tet_region: Vec<u16>,
    /// Prescribed displacements; a node's axis may be prescribed once.
    pub prescribed: Vec<PrescribedSpec>,
    /// Loads.
    pub loads: Vec<LoadSpec>,
    /// Gravity (m/s²).
    pub gravity_m_per_s2: DVec3,
    /// Tools.
    pub tools: Vec<ToolSpec>,
    /// Numerical settings.
    pub settings: Settings,
}

/// Why a model cannot be built.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ModelError {
    /// The mesh's boundary is bad.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// An index points nowhere.
    #[error("{what} {index} is out of range: there are {count}")]
    OutOfRange {
        /// What is indexed.
        what: &'static str,
        /// The index.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// Lengths that must agree do not.
    #[error("tet_region has {found} entries for {expected} tets")]
    RegionCount {
        /// Entries given.
        found: usize,
        /// Tets in the mesh.
        expected: usize,
    },
    /// A setting outside its range.
    #[error("{name} = {value}: {rule}")]
    Setting {
        /// Name.
        name: &'static str,
        /// Value.
        value: f64,
        /// What it must satisfy.
        rule: &'static str,
    },
    /// Two prescriptions for one degree of freedom.
    #[error("node {node} is prescribed along axis {axis} by both \"{first}\" and \"{second}\"")]
    PrescribedTwice {
        /// Node.
        node: u32,
        /// `x`, `y` or `z`.
        axis: char,
        /// First set.
        first: String,
        /// Second set.
        second: String,
    },
    /// More substeps than any tick can bear.
    #[error(
        "the body needs {substeps} substeps per tick (largest natural frequency {omega_rad_per_s:.3e} rad/s); \
         coarsen or improve the mesh, soften the material, or lengthen the tick (limit {limit})"
    )]
    TooStiff {
        /// Substeps needed.
        substeps: u64,
        /// ω_max (rad/s).
        omega_rad_per_s: f64,
        /// Largest number allowed.
        limit: u32,
    },
}

/// More substeps than this are refused at load.
pub const MAX_SUBSTEPS: u32 = 100_000;

/// A body with its loads, constraints and tools. Constant after [`Model::build`].
#[derive(Debug, Clone)]
pub struct Model {
    spec: ModelSpec,
    surface: Surface,
    materials: Vec<Material>,
    rest_tets: Vec<RestTet>,
    mass_kg: Vec<f64>,
    inverse_mass_per_kg: Vec<DVec3>,
    kernel: ForceKernel,
    contact: ContactModel,
    max_natural_frequency_rad_per_s: f64,
    substeps: u32,
}

impl Model {
    /// Checks the specification, precomputes all that the rest state fixes, and chooses the substeps.
    ///
    /// # Errors
    /// [`ModelError`], naming what is wrong; nothing is repaired silently.
    pub fn build(spec: ModelSpec) -> Result<Self, ModelError> {
        let surface = Surface::of(&spec.mesh)?;
        check::spec(&spec, &surface)?;
        let rest_tets: Vec<RestTet> =
            (0..spec.mesh.tets().len()).map(|tet| RestTet::new(&spec.mesh.edge_matrix_m(tet))).collect();
        let materials: Vec<Material> = spec.regions.iter().map(|region| region.material).collect();
        let density = |tet: usize| spec.regions[spec.tet_region[tet] as usize].density_kg_per_m3;
        let mass_kg = mass::lumped_kg(&spec.mesh, density);
        let inverse_mass_per_kg = free_inverse_mass(&mass_kg, &spec.prescribed)?;
        let kernel = ForceKernel::build(&spec.mesh, &rest_tets, &spec.tet_region, &materials, spec.settings.precision);
        let omega = spectrum::max_natural_frequency_rad_per_s(
            &spec.mesh,
            &rest_tets,
            &spec.tet_region,
            &materials,
            &inverse_mass_per_kg,
        );
        let contact = ContactModel::build(
            &spec.mesh,
            &surface,
            &moduli_of_triangles(&spec, &surface),
            &mass_kg,
            omega,
            &spec.tools,
        );
        let stretch_sq = stiffening(&spec.settings, &materials);
        // λ_max(s K + C) = s λ_max(K + C/s)
        let springs: Vec<f64> = contact.nodal_stiffness_n_per_m.iter().map(|k| k / stretch_sq).collect();
        let touched = if springs.is_empty() {
            omega
        } else {
            let (tets, regions) = (&rest_tets, &spec.tet_region);
            let inverse = &inverse_mass_per_kg;
            spectrum::max_frequency_on_springs_rad_per_s(&spec.mesh, tets, regions, &materials, inverse, &springs)
        };
        let omega_sq = stretch_sq * touched.max(omega).powi(2) + contact.tool_frequency_sq;
        let substeps = choose_substeps(&spec, &materials, omega_sq.sqrt())?;
        Ok(Self {
            surface,
            materials,
            rest_tets,
            mass_kg,
            inverse_mass_per_kg,
            kernel,
            contact,
            max_natural_frequency_rad_per_s: omega,
            substeps,
            spec,
        })
    }

    /// What it was built from.
    pub fn spec(&self) -> &ModelSpec {
        &self.spec
    }
    /// Rest mesh.
    pub fn mesh(&self) -> &TetMesh {
        &self.spec.mesh
    }
    /// Boundary surface.
    pub fn surface(&self) -> &Surface {
        &self.surface
    }
    /// Rest positions (m) per node.
    pub fn rest_positions_m(&self) -> &[DVec3] {
        self.spec.mesh.positions_m()
    }
    /// Rest data of every tet.
    pub fn rest_tets(&self) -> &[RestTet] {
        &self.rest_tets
    }
    /// Material of a tet.
    pub fn material_of(&self, tet: usize) -> &Material {
        &self.materials[self.spec.tet_region[tet] as usize]
    }
    /// Lumped mass (kg) per node.
    pub fn mass_kg(&self) -> &[f64] {
        &self.mass_kg
    }
    /// `1/m` (1/kg) per node and axis, zero where prescribed.
    pub fn inverse_mass_per_kg(&self) -> &[DVec3] {
        &self.inverse_mass_per_kg
    }
    /// The force kernel.
    pub fn kernel(&self) -> &ForceKernel {
        &self.kernel
    }
    /// Contact.
    pub fn contact(&self) -> &ContactModel {
        &self.contact
    }
    /// Gravity (m/s²).
    pub fn gravity_m_per_s2(&self) -> DVec3 {
        self.spec.gravity_m_per_s2
    }
    /// Largest natural frequency (rad/s) at rest.
    pub fn max_natural_frequency_rad_per_s(&self) -> f64 {
        self.max_natural_frequency_rad_per_s
    }
    fn tools_at_start(&self) -> Vec<ToolState> {
        self.spec.tools.iter().map(ToolState::at_start).collect()
    }
    /// Substeps per tick.
    pub fn substeps(&self) -> u32 {
        self.substeps
    }
}

/// What a tick changes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Ticks done since reset.
    pub tick: u64,
    /// Positions (m), one per node.
    pub x: Vec<DVec3>,
    /// Velocities (m/s), one per node, at the same time as `x`.
    pub v: Vec<DVec3>,
    /// Total force (N) at `x`: what the next half kick uses.
    pub force_n: Vec<DVec3>,
    /// The part of it that loads, tools and injected forces make (N).
    pub external_n: Vec<DVec3>,
    /// False: `force_n` must be computed anew before it is used.
    pub force_is_current: bool,
    /// Tools, one per [`ModelSpec::tools`].
    pub tools: Vec<ToolState>,
    /// What contact remembers: samples touched, friction springs, and geometry that follows from `x`.
    pub contact: ContactState,
    /// Factor of every load at the end of the last tick.
    pub load_factors: Vec<f64>,
    /// Work and dissipation since reset.
    pub ledger: Ledger,
    /// Power of viscous stress at the last two substeps.
    pub viscous: ViscousPower,
    /// Set when a tick's result was not finite.
    pub quarantine: Option<Quarantine>,
}

impl State {
    /// At rest, at tick 0.
    pub fn at_rest(model: &Model) -> Self {
        let nodes = model.rest_positions_m().len();
        Self {
            tick: 0,
            x: model.rest_positions_m().to_vec(),
            v: vec![DVec3::ZERO; nodes],
            force_n: vec![DVec3::ZERO; nodes],
            external_n: vec![DVec3::ZERO; nodes],
            force_is_current: false,
            tools: model.tools_at_start(),
            contact: model.contact.state(),
            load_factors: vec![0.0; model.spec.loads.len()],
            ledger: Ledger::default(),
            viscous: ViscousPower::default(),
            quarantine: None,
        }
    }

    /// Copies another state of the same model into the buffers it has: allocates nothing.
    pub fn copy_from(&mut self, other: &Self) {
        self.tick = other.tick;
        self.x.copy_from_slice(&other.x);
        self.v.copy_from_slice(&other.v);
        self.force_n.copy_from_slice(&other.force_n);
        self.external_n.copy_from_slice(&other.external_n);
        self.force_is_current = other.force_is_current;
        self.tools.clone_from_slice(&other.tools);
        self.contact.copy_from(&other.contact);
        self.load_factors.copy_from_slice(&other.load_factors);
        self.ledger = other.ledger;
        self.viscous = other.viscous;
        self.quarantine = other.quarantine;
    }

    /// Back to rest at tick 0, as [`Self::at_rest`], in the buffers it has: allocates nothing.
    pub fn reset(&mut self, model: &Model) {
        self.tick = 0;
        self.x.copy_from_slice(model.rest_positions_m());
        for buffer in [&mut self.v, &mut self.force_n, &mut self.external_n] {
            buffer.fill(DVec3::ZERO);
        }
        self.force_is_current = false;
        for (tool, spec) in self.tools.iter_mut().zip(&model.spec.tools) {
            *tool = ToolState::at_start(spec);
        }
        self.contact.clear();
        self.load_factors.fill(0.0);
        self.ledger = Ledger::default();
        self.viscous = ViscousPower::default();
        self.quarantine = None;
    }

    /// Puts a tool and its device at rest at `position_m` (m, world), as if it had always been there: it neither sweeps what
    /// lies between nor keeps its contact. A position that is not finite, or a tool that is not there, changes nothing.
    /// Allocates nothing.
    pub fn place_tool(&mut self, tool: usize, position_m: DVec3) {
        let Some(state) = self.tools.get_mut(tool).filter(|_| position_m.is_finite()) else { return };
        state.target = ToolTarget { position_m, velocity_m_per_s: DVec3::ZERO };
        state.let_go();
        state.centre_m = position_m;
        self.contact.clear_tool(tool);
        self.force_is_current = false;
    }

    /// Simulated time (s) since reset.
    pub fn time_s(&self, model: &Model) -> f64 {
        self.tick as f64 * model.spec.settings.tick_period_s
    }
}

/// Buffers of [`crate::step`], sized once.
#[derive(Debug, Clone)]
pub struct Scratch {
    /// Reaction forces (N) of constrained axes at the end of the tick.
    pub(crate) reaction_n: Vec<DVec3>,
    pub(crate) last_good: LastGood,
    pub(crate) kernel: KernelScratch,
    pub(crate) contact: ContactScratch,
}

impl Scratch {
    /// Buffers for a model.
    pub fn new(model: &Model) -> Self {
        let nodes = model.rest_positions_m().len();
        Self {
            reaction_n: vec![DVec3::ZERO; nodes],
            last_good: LastGood::new(nodes, model.tools_at_start(), model.spec.loads.len()),
            kernel: model.kernel.scratch(),
            contact: model.contact.scratch(),
        }
    }

    /// Off switch of contact's broad phase ([`ContactScratch::set_exhaustive`]): same bits, only slower.
    pub fn set_exhaustive_contact(&mut self, on: bool) {
        self.contact.set_exhaustive(on);
    }

    /// Force (N) that holds each prescribed degree of freedom, at the end of the last tick; zero on free ones.
    pub fn reactions_n(&self) -> &[DVec3] {
        &self.reaction_n
    }

    /// Takes the reactions of another scratch of the same model, without allocating: with a copy of the state, all that
    /// probes need.
    pub fn copy_reactions_from(&mut self, other: &Self) {
        self.reaction_n.clone_from(&other.reaction_n);
    }
}

/// A force injected on a node for one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointForce {
    /// Node.
    pub node: u32,
    /// Force (N, world).
    pub force_n: DVec3,
}

/// What acts during a tick; values are those at its end, and are reached linearly from the previous tick's.
#[derive(Debug, Clone, Copy)]
pub struct TickInput<'a> {
    /// One per tool.
    pub tools: &'a [ToolTarget],
    /// One per load.
    pub load_factors: &'a [f64],
    /// One per prescribed set: displacement from rest (m).
    pub prescribed_displacements_m: &'a [DVec3],
    /// Forces held constant during the tick.
    pub point_forces: &'a [PointForce],
}

/// What a tick did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepReport {
    /// Substeps taken; 0 while quarantined.
    pub substeps: u32,
    /// Inputs that were not finite or of the wrong length, and so were replaced by the previous tick's.
    pub inputs_rejected: u32,
    /// Set when this tick's result was refused.
    pub quarantined: Option<Quarantine>,
}

/// Mean over a triangle's corners of the stiffest tet at each.
fn moduli_of_triangles(spec: &ModelSpec, surface: &Surface) -> Vec<SurfaceModuli> {
    let mut of_node = vec![DVec2::ZERO; spec.mesh.positions_m().len()];
    for (tet, nodes) in spec.mesh.tets().iter().enumerate() {
        let lame = spec.regions[spec.tet_region[tet] as usize].material.lame;
        let indentation = lame.young_modulus_pa() / (1.0 - lame.poisson_ratio().powi(2));
        for &node in nodes {
            of_node[node as usize] = of_node[node as usize].max(DVec2::new(lame.p_wave_modulus_pa(), indentation));
        }
    }
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
                if let Some(first) = slot.replace(set).filter(|&first| first != set) {
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

/// How much the square of a frequency grows at the allowed stretch: the worst of the laws ([`Material::stiffening`]).
fn stiffening(settings: &Settings, materials: &[Material]) -> f64 {
    materials.iter().map(|material| material.stiffening(settings.stretch_allowance)).fold(1.0, f64::max)
}

/// Substeps for a stable leapfrog: `dt = safety · (2/ω)(√(1 + ξ²) − ξ)`.
///
/// ω is the largest frequency of the body stretched by s and touched everywhere, `ω² = λ_max(M^{-½} (χK + K_contact) M^{-½})` with
/// the laws' stiffening χ. ξ is the damping ratio at ω: viscous stress grows with s⁴ (`P_v = F S_v`, `Ė = sym(Ḟᵀ F)`), so
/// `ξ = ½ ω τ s⁴/χ`, with τ the largest ratio of viscosity to stiffness over P-waves, shear and bulk:
/// `(φ + 2ψ)/(λ + 2µ)`, `ψ/µ`, `(φ + ⅔ψ)/(λ + ⅔µ)`.
fn choose_substeps(spec: &ModelSpec, materials: &[Material], omega: f64) -> Result<u32, ModelError> {
    let settings = &spec.settings;
    if let Substeps::Fixed(substeps) = settings.substeps {
        return Ok(substeps);
    }
    let viscous_growth = settings.stretch_allowance.powi(4) / stiffening(settings, materials);
    let xi = 0.5 * omega * viscous_growth * materials.iter().map(relaxation_time_s).fold(0.0, f64::max);
    let dt_s = settings.step_safety * 2.0 / omega * ((1.0 + xi * xi).sqrt() - xi);
    let substeps = (settings.tick_period_s / dt_s).ceil().max(1.0);
    if substeps <= f64::from(MAX_SUBSTEPS) {
        Ok(substeps as u32)
    } else {
        Err(ModelError::TooStiff { substeps: substeps as u64, omega_rad_per_s: omega, limit: MAX_SUBSTEPS })
    }
}

/// Largest ratio of viscosity to stiffness (s) over P-waves, shear and bulk.
fn relaxation_time_s(material: &Material) -> f64 {
    let (lame, viscosity) = (material.lame, material.viscosity);
    let ratio = |lambdas: f64, mus: f64| {
        (lambdas * viscosity.phi_pa_s + mus * viscosity.psi_pa_s) / (lambdas * lame.lambda_pa + mus * lame.mu_pa)
    };
    ratio(1.0, 2.0).max(ratio(0.0, 1.0)).max(ratio(1.0, 2.0 / 3.0))
}

mod check {
    //! The specification's ranges.
    use super::{LoadSpec, ModelError, ModelSpec, Substeps, Surface};
    use crate::contact::{Coupling, ToolSpec};

    pub(super) fn spec(spec: &ModelSpec, surface: &Surface) -> Result<(), ModelError> {
        regions(spec)?;
        let nodes = spec.mesh.positions_m().len();
        for set in &spec.prescribed {
            indices("node", set.nodes.iter().map(|&n| n as usize), nodes)?;
        }
        for load in &spec.loads {
            match load {
                LoadSpec::NodalForces(forces) => indices("node", forces.iter().map(|f| f.0 as usize), nodes)?,
                LoadSpec::Traction { triangles, .. } | LoadSpec::Pressure { triangles, .. } => {
                    let count = surface.triangles.len();
                    indices("surface triangle", triangles.iter().map(|&t| t as usize), count)?;
                }
            }
        }
        spec.tools.iter().try_for_each(tool)?;
        settings(spec)
    }

    fn tool(tool: &ToolSpec) -> Result<(), ModelError> {
        let positive = |name, value: f64| {
            setting(name, value, value > 0.0 && value.is_finite(), "must be finite and larger than 0")
        };
        let not_negative = |name, value: f64| {
            setting(name, value, value >= 0.0 && value.is_finite(), "must be finite and not negative")
        };
        positive("tool radius_m", tool.radius_m)?;
        not_negative("friction_coefficient", tool.friction_coefficient)?;
        if let Coupling::Spring { stiffness_n_per_m, damping_n_s_per_m, mass_kg } = tool.coupling {
            positive("coupling_stiffness_n_per_m", stiffness_n_per_m)?;
            not_negative("coupling_damping_n_s_per_m", damping_n_s_per_m)?;
            positive("tool mass_kg", mass_kg)?;
        }
        let start = tool.start_position_m.length();
        setting("tool start_position_m", start, start.is_finite(), "must be finite")
    }

    fn regions(spec: &ModelSpec) -> Result<(), ModelError> {
        let (found, expected) = (spec.tet_region.len(), spec.mesh.tets().len());
        if found != expected {
            return Err(ModelError::RegionCount { found, expected });
        }
        indices("region", spec.tet_region.iter().map(|&r| r as usize), spec.regions.len())?;
        for region in &spec.regions {
            let density = region.density_kg_per_m3;
            let ok = density > 0.0 && density.is_finite();
            setting("density_kg_per_m3", density, ok, "must be finite and larger than 0")?;
        }
        Ok(())
    }

    fn settings(spec: &ModelSpec) -> Result<(), ModelError> {
        let s = &spec.settings;
        let period = s.tick_period_s;
        setting("tick_period_s", period, period > 0.0 && period.is_finite(), "must be finite and larger than 0")?;
        let safety = s.step_safety;
        setting("step_safety", safety, safety > 0.0 && safety <= 1.0, "must be in (0, 1]")?;
        let stretch = s.stretch_allowance;
        setting("stretch_allowance", stretch, stretch >= 1.0 && stretch.is_finite(), "must be 1 or larger")?;
        let damping = s.mass_damping_per_s;
        setting("mass_damping_per_s", damping, damping >= 0.0 && damping.is_finite(), "must not be negative")?;
        if let Substeps::Fixed(n) = s.substeps {
            setting("substeps", f64::from(n), (1..=super::MAX_SUBSTEPS).contains(&n), "must be 1 to 100000")?;
        }
        let gravity = spec.gravity_m_per_s2.length();
        setting("gravity_m_per_s2", gravity, gravity.is_finite(), "must be finite")
    }

    fn setting(name: &'static str, value: f64, ok: bool, rule: &'static str) -> Result<(), ModelError> {
        if ok { Ok(()) } else { Err(ModelError::Setting { name, value, rule }) }
    }

    fn indices(what: &'static str, mut indices: impl Iterator<Item = usize>, count: usize) -> Result<(), ModelError> {
        match indices.find(|&index| index >= count) {
            Some(index) => Err(ModelError::OutOfRange { what, index, count }),
            None => Ok(()),
        }
    }
}
