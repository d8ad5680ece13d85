//! What the rest state of a body of tetrahedra fixes.
use super::{TetBodyError, TetElements, TetSpec};
use crate::{
    contact::{ContactModel, MostCarriers, SkinAtRest, SkinFollows, SurfaceModuli, moduli},
    elements::{
        free_axes::FreeAxes,
        integration_points::IntegrationPoints,
        linear_tet::RestTet,
        mass,
        rest_stiffness::{RestStiffness, max_natural_frequency_with},
        rigid_motion::{FreePart, HeldNodes, first_free_part},
        solid::Solid,
    },
    kernels::ForceKernel,
    material::Material,
    mesh::{Surface, TetMesh},
    settings::Integrator,
    tick::{
        Environment, EnvironmentSpec, Frequencies, NodeMasses, PrescribedNodes, Steps, damping_growth,
        free_inverse_mass, lumped::LumpedMass, progress as building, stiffening,
    },
};
use glam::{BVec3, DVec2, DVec3};

/// A body of tetrahedra. Constant after load.
#[derive(Debug, Clone)]
pub struct TetBody {
    solid: Solid,
    elements: TetElements,
    materials: Vec<Material>,
    rest_tets: Vec<RestTet>,
    points: IntegrationPoints,
    mass_kg: Vec<f64>,
    inverse_mass_per_kg: Vec<DVec3>,
    kernel: ForceKernel,
    max_natural_frequency_rad_per_s: f64,
}

impl TetBody {
    /// Checks, precomputes, and chooses the substeps; `progress` is told the part done.
    ///
    /// # Errors
    /// [`TetBodyError`]; nothing is repaired silently.
    pub(crate) fn build(
        TetSpec { solid, elements }: TetSpec,
        spec: EnvironmentSpec,
        progress: &mut dyn FnMut(f64),
    ) -> Result<(Self, Environment), TetBodyError> {
        let surface = Surface::of(&solid.mesh)?;
        solid.check()?;
        let nodes = solid.mesh.positions_m().len();
        spec.check(&surface, solid.mesh.positions_m(), nodes)?;
        let settings = &spec.settings;
        let (materials, rest_tets) = (solid.materials(), solid.rest_tets());
        let mass_kg = mass::lumped_kg(&solid.mesh, |tet| solid.region_of(tet).density_kg_per_m3);
        let inverse_mass_per_kg = free_inverse_mass(&mass_kg, &spec.prescribed)?;
        let (mesh, of_tet) = (&solid.mesh, &solid.tet_region);
        let points = match elements {
            TetElements::Linear => IntegrationPoints::of_linear_tets(mesh, &rest_tets, of_tet, &materials),
            TetElements::Smoothed => IntegrationPoints::of_smoothed_tets(mesh, &rest_tets, of_tet, &materials),
        };
        let kernel = ForceKernel::build(mesh, &points, settings.precision);
        let kernel = if settings.skips.viscous_terms { kernel } else { kernel.with_every_viscosity() };
        let mut body = Self {
            solid,
            elements,
            materials,
            rest_tets,
            points,
            mass_kg,
            inverse_mass_per_kg,
            kernel,
            max_natural_frequency_rad_per_s: 0.0,
        };
        let at_rest = body.rest_stiffness();
        let omega = max_natural_frequency_with(&at_rest, &body.inverse_mass_per_kg, &mut building::untouched(progress));
        let moduli = body.moduli_of_triangles(&surface);
        let skin = SkinAtRest {
            positions_m: body.rest_positions_m(),
            surface: &surface,
            moduli: &moduli,
            mass_kg: &body.mass_kg,
            bearing_kg: &body.mass_kg,
            max_natural_frequency_rad_per_s: omega,
            follows: match elements {
                TetElements::Linear => SkinFollows::StiffElements,
                TetElements::Smoothed => SkinFollows::TrueElements,
            },
            carriers: MostCarriers::default(),
        };
        let contact = ContactModel::build(&skin, &spec.tools).with_walls(spec.walls_of(&skin));
        let stretch_sq = stiffening(settings, &body.materials);
        // λ_max(s K + C) = s λ_max(K + C/s)
        let springs: Vec<f64> = contact.nodal_stiffness_n_per_m.iter().map(|k| k / stretch_sq).collect();
        let touched = if springs.is_empty() {
            omega
        } else {
            let touched = RestStiffness { springs_n_per_m: &springs, ..at_rest };
            max_natural_frequency_with(&touched, &body.inverse_mass_per_kg, &mut building::touched(progress))
        };
        let explicit_sq = match settings.integrator {
            // The body and its contact are implicit; tools on couplings are not.
            Integrator::BackwardEuler => 0.0,
            _ => stretch_sq * touched.max(omega).powi(2),
        };
        let damping_per_s = match settings.integrator {
            Integrator::BackwardEuler => 0.0,
            _ => damping_growth(settings) * body.damping_per_s(&mut building::damped(progress)),
        };
        let omega_sq = explicit_sq + contact.tool_frequency_sq;
        let alone = stretch_sq.sqrt() * omega;
        let steps = Steps::choose(settings, Frequencies { alone, touched: omega_sq.sqrt(), damping_per_s })?;
        body.max_natural_frequency_rad_per_s = omega;
        let environment = Environment::new(spec, surface, contact, steps).with_inner_nodes(nodes);
        Ok((body, environment))
    }

    /// Mesh, materials and densities.
    pub fn solid(&self) -> &Solid {
        &self.solid
    }

    /// What its energy is taken of.
    pub fn elements(&self) -> TetElements {
        self.elements
    }

    /// Its integration points.
    pub fn points(&self) -> &IntegrationPoints {
        &self.points
    }

    /// Mesh at rest.
    pub fn mesh(&self) -> &TetMesh {
        &self.solid.mesh
    }

    /// Rest positions (m) of the nodes.
    pub fn rest_positions_m(&self) -> &[DVec3] {
        self.solid.mesh.positions_m()
    }

    /// Rest data of every tet.
    pub fn rest_tets(&self) -> &[RestTet] {
        &self.rest_tets
    }

    /// Material of a tet.
    pub fn material_of(&self, tet: usize) -> &Material {
        &self.materials[self.solid.tet_region[tet] as usize]
    }

    /// Materials, one per region.
    pub fn materials(&self) -> &[Material] {
        &self.materials
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

    /// Largest natural frequency (rad/s) at rest.
    pub fn max_natural_frequency_rad_per_s(&self) -> f64 {
        self.max_natural_frequency_rad_per_s
    }

    /// `K` at rest.
    pub(crate) fn rest_stiffness(&self) -> RestStiffness<'_> {
        RestStiffness { points: &self.points, springs_n_per_m: &[] }
    }

    /// Numbers of its free axes.
    pub(crate) fn free_axes(&self) -> FreeAxes {
        FreeAxes::numbered(self.free())
    }

    /// Axes along which nodes may move.
    pub(crate) fn free(&self) -> impl Iterator<Item = BVec3> + '_ {
        self.inverse_mass_per_kg.iter().map(|inverse_mass| inverse_mass.cmpne(DVec3::ZERO))
    }

    /// The first part of it that is not held.
    pub(crate) fn first_free_part(&self) -> Option<FreePart> {
        let nodes = HeldNodes {
            rest_m: self.rest_positions_m(),
            mass_kg: &self.mass_kg,
            inverse_mass_per_kg: &self.inverse_mass_per_kg,
        };
        first_free_part(&nodes, self.mesh().tets().iter().map(|tet| &tet[..]))
    }

    /// Masses for the bound by which it sleeps.
    pub(super) fn node_masses(&self) -> NodeMasses<'_> {
        NodeMasses { mass_kg: &self.mass_kg, inverse_mass_per_kg: &self.inverse_mass_per_kg }
    }

    /// Masses for kicks.
    pub(crate) fn lumped_mass<'a>(&'a self, environment: &'a Environment) -> LumpedMass<'a> {
        LumpedMass {
            mass_kg: &self.mass_kg,
            inverse_mass_per_kg: &self.inverse_mass_per_kg,
            prescribed: &environment.prescribed,
        }
    }

    /// What prescribed sets need.
    pub(crate) fn prescribed_nodes(&self) -> PrescribedNodes<'_> {
        PrescribedNodes { rest_m: self.rest_positions_m(), mass_kg: &self.mass_kg }
    }

    /// `Σ V Ψ(F)` (J) at positions `x` (m).
    pub(crate) fn elastic_energy_j(&self, x: &[DVec3]) -> f64 {
        self.points.energy_j(x)
    }

    /// Mean over a triangle's corners of the stiffest tet at each.
    fn moduli_of_triangles(&self, surface: &Surface) -> Vec<SurfaceModuli> {
        let mut of_node = vec![DVec2::ZERO; self.rest_positions_m().len()];
        for (tet, nodes) in self.mesh().tets().iter().enumerate() {
            let moduli = moduli::moduli_pa(self.material_of(tet));
            for &node in nodes {
                of_node[node as usize] = of_node[node as usize].max(moduli);
            }
        }
        moduli::mean_over_corners(&of_node, surface)
    }
}
