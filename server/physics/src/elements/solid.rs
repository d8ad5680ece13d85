//! A solid: a tetrahedral mesh with the material and the density of every tet.
use super::linear_tet::RestTet;
use crate::{
    material::{Lame, Material, ParameterError, Viscosity},
    mesh::{MeshError, TetMesh},
};
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

/// A tetrahedral mesh with the material and the density of every tet.
#[derive(Debug, Clone, PartialEq)]
pub struct Solid {
    /// Mesh at rest.
    pub mesh: TetMesh,
    /// Materials and densities.
    pub regions: Vec<Region>,
    /// Region of each tet.
    pub tet_region: Vec<u16>,
}

/// Why a solid cannot be computed.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SolidError {
    /// The mesh's boundary is bad.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// Lengths that must agree do not.
    #[error("tet_region has {found} entries for {expected} tets")]
    RegionCount {
        /// Entries given.
        found: usize,
        /// Tets in the mesh.
        expected: usize,
    },
    /// A tet names a region that there is not.
    #[error("region {index} is out of range: there are {count}")]
    RegionOutOfRange {
        /// The index.
        index: u16,
        /// How many there are.
        count: usize,
    },
    /// A material's constants are impossible.
    #[error("region \"{region}\": {source}")]
    Material {
        /// Name of the region.
        region: String,
        /// Which constant and why.
        source: ParameterError,
    },
    /// A density that is not one.
    #[error("density_kg_per_m3 = {density_kg_per_m3} of region \"{region}\": must be finite and larger than 0")]
    Density {
        /// Name of the region.
        region: String,
        /// The density (kg/m³).
        density_kg_per_m3: f64,
    },
}

impl Solid {
    /// Checks regions and constants.
    ///
    /// # Errors
    /// The first [`SolidError`] found.
    pub(crate) fn check(&self) -> Result<(), SolidError> {
        let (found, expected) = (self.tet_region.len(), self.mesh.tets().len());
        if found != expected {
            return Err(SolidError::RegionCount { found, expected });
        }
        let count = self.regions.len();
        if let Some(&index) = self.tet_region.iter().find(|&&region| region as usize >= count) {
            return Err(SolidError::RegionOutOfRange { index, count });
        }
        for Region { name, material, density_kg_per_m3 } in &self.regions {
            let Material { lame, viscosity, law: _, crushing_pa: _ } = *material;
            let constants =
                Lame::new(lame.lambda_pa, lame.mu_pa).and(Viscosity::new(viscosity.phi_pa_s, viscosity.psi_pa_s));
            constants.map_err(|source| SolidError::Material { region: name.clone(), source })?;
            if !(*density_kg_per_m3 > 0.0 && density_kg_per_m3.is_finite()) {
                return Err(SolidError::Density { region: name.clone(), density_kg_per_m3: *density_kg_per_m3 });
            }
        }
        Ok(())
    }

    /// The regions' materials.
    pub(crate) fn materials(&self) -> Vec<Material> {
        self.regions.iter().map(|region| region.material).collect()
    }

    /// The regions' densities (kg/m³).
    pub(crate) fn densities_kg_per_m3(&self) -> Vec<f64> {
        self.regions.iter().map(|region| region.density_kg_per_m3).collect()
    }

    /// The region of a tet.
    pub fn region_of(&self, tet: usize) -> &Region {
        &self.regions[self.tet_region[tet] as usize]
    }

    /// Mass (kg) of all tets.
    pub fn mass_kg(&self) -> f64 {
        (0..self.tet_region.len()).map(|tet| self.mesh.volume_m3(tet) * self.region_of(tet).density_kg_per_m3).sum()
    }

    /// Rest data of every tet.
    pub(crate) fn rest_tets(&self) -> Vec<RestTet> {
        (0..self.mesh.tets().len()).map(|tet| RestTet::new(&self.mesh.edge_matrix_m(tet))).collect()
    }
}
