//! What a seed model is built from, and the constants that the papers print.
use super::SeedError;
use crate::{
    material::{Convention, Lame, Viscosity},
    mesh::TetMesh,
};
use glam::DVec3;

/// One of the papers' models, which the paper of 2005 calls ED0, HM2 and HM1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PaperModel {
    /// "Ellipsoids Model": a shell of 188 tets, no particles.
    Ellipsoids,
    /// "Full FEM Model": a ventricle of 1352 tets, no particles.
    FullFem,
    /// "Hybrid Model": the 188 tets and 27 988 particles around them.
    Hybrid,
}

/// Number of tets of the shell inside (table 1 of 2006).
pub const SHELL_TETS: u32 = 188;
/// Number of tets of the full FEM ventricle.
pub const VENTRICLE_TETS: u32 = 1352;
/// Number of particles in all of the hybrid's layer (section 7 of 2006).
pub const PARTICLES: u32 = 27_988;

/// The exchange between particles and core (2006, section 6.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Exchange {
    /// Repaired: particles of the interface beside the core are tied to their faces along the normal by impulses, which
    /// conserves linear momentum, to which the paper appeals.
    #[default]
    Impulses,
    /// As printed: the mean displacement of particles that cross a face goes to its nodes, and the normal displacement
    /// of a face to its particles.
    Displacements,
}

/// Which stress makes the force between two particles (`seed::sph`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PairStress {
    /// Repaired: the stress is `σ_i + σ_j`, which conserves linear momentum and, at small strain, energy.
    #[default]
    Both,
    /// As printed (eq. 29): the stress is the neighbour's, `σ_j`. The layer flutters until it bursts.
    Neighbour,
}

/// The force that keeps particles within their region (`seed::region`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum InterfaceForce {
    /// Repaired: particles of the interface are drawn back to their own voxels.
    #[default]
    OwnVoxel,
    /// As printed: these particles, and particles beyond the interface, are drawn by the gradient field to the nearest
    /// interface voxel. This pumps energy.
    NearestVoxel,
}

/// Constants. [`SeedParameters::paper_2005`] and [`SeedParameters::paper_2006`] return those of the papers' models.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeedParameters {
    /// The paper whose factors apply.
    pub convention: Convention,
    /// Lamé's constants λ, µ (Pa), which are printed without unit.
    pub lame: Lame,
    /// Viscosities φ, ψ (Pa s), which are printed without unit.
    pub viscosity: Viscosity,
    /// Step Δt (s), which is printed without unit, and in 2005 only.
    pub dt_s: f64,
    /// Density ρ (kg/m³), which is not printed.
    pub density_kg_per_m3: f64,
    /// Smoothing length h over the particles' spacing, which is not printed.
    pub smoothing_ratio: f64,
    /// Whether nv(ps) reaches to the first-connected vertices ("eventually, … depending on the mesh size").
    pub first_neighbours: bool,
    /// Interface force per distance, over `(λ + 2µ) · spacing`, which is not printed.
    pub interface_stiffness_ratio: f64,
    /// Stiffness of the surface's links, over that of the column of layer between their ends, which is not printed.
    pub link_stiffness_ratio: f64,
    /// Damping ratio of the links, which is not printed.
    pub link_damping_ratio: f64,
    /// Exchange between particles and core.
    pub exchange: Exchange,
    /// Which stress makes the force between two particles.
    pub pair_stress: PairStress,
    /// Force that keeps particles within their region.
    pub interface_force: InterfaceForce,
}

/// The layer of particles and the surface outside it.
#[derive(Debug, Clone, PartialEq)]
pub struct LayerSpec {
    /// Vertices (m) of the outer surface.
    pub skin_m: Vec<DVec3>,
    /// Triangles of the outer surface, counter-clockwise seen from outside.
    pub skin_triangles: Vec<[u32; 3]>,
    /// Approximate number of particles that fill the layer.
    pub particles: u32,
}

/// Everything a seed model is built from.
#[derive(Debug, Clone, PartialEq)]
pub struct SeedSpec {
    /// The tetrahedra Ω_e.
    pub core: TetMesh,
    /// Nodes of the core that stay where they are. The papers do not say what holds their bodies.
    pub held_nodes: Vec<u32>,
    /// The particles Ω_p; without them the core's own boundary is touched.
    pub layer: Option<LayerSpec>,
    /// Constants.
    pub parameters: SeedParameters,
}

impl SeedParameters {
    /// Returns table 1 of 2005, with that paper's factors.
    pub fn paper_2005(model: PaperModel) -> Self {
        Self::printed(model, Convention::Paper2005)
    }

    /// Returns table 1 of 2006, with that paper's factors, and the Δt of 2005, which the paper of 2006 does not print.
    pub fn paper_2006(model: PaperModel) -> Self {
        Self::printed(model, Convention::Paper2006)
    }

    fn printed(model: PaperModel, convention: Convention) -> Self {
        let (lambda_pa, mu_pa, viscosity_pa_s, dt_s) = match model {
            PaperModel::Ellipsoids => (5.5, 2.5, 9.0e-5, 7.0e-3),
            PaperModel::FullFem => (0.04, 1.6e-3, 1.0e-4, 7.5e-3),
            PaperModel::Hybrid => (5.0, 2.0, 9.0e-5, 7.0e-3),
        };
        Self {
            convention,
            lame: Lame { lambda_pa, mu_pa },
            viscosity: Viscosity { phi_pa_s: viscosity_pa_s, psi_pa_s: viscosity_pa_s },
            dt_s,
            density_kg_per_m3: 1000.0,
            smoothing_ratio: 1.2,
            first_neighbours: true,
            interface_stiffness_ratio: 1.0,
            link_stiffness_ratio: 1.0,
            link_damping_ratio: 1.0,
            exchange: Exchange::default(),
            pair_stress: PairStress::default(),
            interface_force: InterfaceForce::default(),
        }
    }

    /// Returns the same parameters without the repairs that can be left out. A body with them bursts within seconds.
    #[must_use]
    pub fn as_printed(self) -> Self {
        Self {
            exchange: Exchange::Displacements,
            pair_stress: PairStress::Neighbour,
            interface_force: InterfaceForce::NearestVoxel,
            ..self
        }
    }

    /// Returns the factor on elastic and viscous stress in the layer, over the core's.
    ///
    /// Eq. 22 (2005: 6) halves the core's force, while eq. 29 (13) halves nothing. So in either paper the same λ and µ
    /// make the layer twice as stiff as the core, and φ and ψ make it twice as viscous.
    pub fn layer_factor(&self) -> f64 {
        match self.convention {
            Convention::Consistent => 1.0,
            Convention::Paper2005 | Convention::Paper2006 => 2.0,
        }
    }

    /// Returns the longest step (s) that eq. 14 of 2005 allows for neighbours `h_m` (m) apart, as printed:
    /// `h √(ρ/(2λ + µ))`.
    pub fn courant_as_printed_s(&self, h_m: f64) -> f64 {
        h_m * (self.density_kg_per_m3 / (2.0 * self.lame.lambda_pa + self.lame.mu_pa)).sqrt()
    }

    /// Returns the same step with the speed of pressure waves, `h √(ρ/(λ + 2µ))`: eq. 14 swaps λ and µ.
    pub fn courant_s(&self, h_m: f64) -> f64 {
        h_m * (self.density_kg_per_m3 / self.lame.p_wave_modulus_pa()).sqrt()
    }

    pub(super) fn check(&self) -> Result<(), SeedError> {
        let Self { lame, viscosity, .. } = self;
        let refuse = |name, value, rule| Err(SeedError::Parameter { name, value, rule });
        if Lame::new(lame.lambda_pa, lame.mu_pa).is_err() {
            return refuse(
                "lambda_pa",
                lame.lambda_pa,
                "with mu_pa > 0 it must be larger than -2/3 mu_pa, both finite",
            );
        }
        if Viscosity::new(viscosity.phi_pa_s, viscosity.psi_pa_s).is_err() {
            return refuse("phi_pa_s", viscosity.phi_pa_s, "neither it nor psi_pa_s may be negative or infinite");
        }
        let positive = [
            ("dt_s", self.dt_s),
            ("density_kg_per_m3", self.density_kg_per_m3),
            ("link_stiffness_ratio", self.link_stiffness_ratio),
        ];
        for (name, value) in positive {
            if !(value > 0.0 && value.is_finite()) {
                return refuse(name, value, "must be finite and larger than 0");
            }
        }
        let not_negative = [
            ("interface_stiffness_ratio", self.interface_stiffness_ratio),
            ("link_damping_ratio", self.link_damping_ratio),
        ];
        for (name, value) in not_negative {
            if !(value >= 0.0 && value.is_finite()) {
                return refuse(name, value, "must be finite and not negative");
            }
        }
        if !(0.6..=4.0).contains(&self.smoothing_ratio) {
            return refuse("smoothing_ratio", self.smoothing_ratio, "must be 0.6 (nearest neighbours only) to 4");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_courant_step_as_printed_is_shorter_where_lambda_is_larger_than_mu() {
        let parameters = SeedParameters::paper_2005(PaperModel::Hybrid);
        // c = √(9/1000) m/s.
        assert!((parameters.courant_s(1e-3) - 1e-3 / 0.009_f64.sqrt()).abs() < 1e-15);
        assert!((parameters.courant_as_printed_s(1e-3) - 1e-3 / 0.012_f64.sqrt()).abs() < 1e-15);
    }

    #[test]
    fn impossible_constants_are_refused_by_name() {
        let good = SeedParameters::paper_2006(PaperModel::Hybrid);
        good.check().unwrap();
        let message = |parameters: SeedParameters| parameters.check().unwrap_err().to_string();
        assert!(message(SeedParameters { dt_s: f64::NAN, ..good }).contains("dt_s = NaN"));
        assert!(message(SeedParameters { smoothing_ratio: 9.0, ..good }).contains("smoothing_ratio = 9"));
        assert!(message(SeedParameters { interface_stiffness_ratio: -1.0, ..good }).contains("not negative"));
        let lame = Lame { lambda_pa: 5.0, mu_pa: 0.0 };
        assert!(message(SeedParameters { lame, ..good }).contains("mu_pa > 0"));
    }
}
