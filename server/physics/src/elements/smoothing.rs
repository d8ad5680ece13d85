//! Smoothed linear tetrahedra: most of the strain that counts is averaged around nodes, so that neither bending nor Poisson's
//! ratio near ½ makes the body too stiff (docs/adr/smoothed-tets.md).
//!
//! ```text
//! U = Σ_n V_n Ψ(F_n; λ⁺ + (1 − γ) λ⁻, (1 − γ) µ) + Σ_t V_t Ψ(F_t; γ λ⁻, γ µ)
//! F_n = Σ_{t∋n} (V_t/4) F_t / V_n,  V_n = Σ_{t∋n} V_t/4            each of a tet's nodes has a quarter of it
//! λ⁺ = max(λ, 0), λ⁻ = min(λ, 0), γ = 0.3
//! ```
//! (every law's Ψ is linear in λ and µ). Around nodes alone some motions would cost nothing: the tets' own part γ holds them.
//! Volume is kept around nodes alone, or the tets would lock; but a tet that is pressed to less than half of its volume
//! resists ([`crate::material::crushing_limit`]), or tools that press deep would turn single tets inside out. Viscosity is
//! divided as µ is. Tets of different regions are not averaged: a node between two regions has a point of each. (Nodal
//! averages: Dohrmann et al. 2000, Bonet & Burton 1998; stabilised: Puso & Solberg 2006.)
use super::{integration_points::IntegrationPoints, linear_tet::RestTet};
use crate::{
    material::{Lame, Material, Viscosity},
    mesh::TetMesh,
};
use glam::DVec3;

/// γ, the part of the stiffness against shear that tets have of their own.
pub const OF_TETS: f64 = 0.3;

/// κ of what tets resist of being crushed is `λ⁺` and so many times µ.
const CRUSHING_SHEARS: f64 = 16.0;

impl IntegrationPoints {
    /// Returns those of smoothed tetrahedra: a layer of tets, then one of nodes. `tet_material[t]` indexes `materials`.
    pub fn of_smoothed_tets(
        mesh: &TetMesh,
        rest_tets: &[RestTet],
        tet_material: &[u16],
        materials: &[Material],
    ) -> Self {
        let mut points = Self::of_linear_tets(mesh, rest_tets, tet_material, &materials_of_tets(materials));
        let first_of_nodes = points.add_materials(materials.iter().map(of_nodes));
        let mut around_nodes: Vec<(u16, u32, u32)> = Vec::with_capacity(4 * rest_tets.len());
        for (tet, corners) in mesh.tets().iter().enumerate() {
            around_nodes.extend(corners.map(|node| (tet_material[tet], node, tet as u32)));
        }
        around_nodes.sort_unstable();
        let mut patch = Patch::default();
        for tets in around_nodes.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let (material, node, _) = tets[0];
            patch.fill(node, tets.iter().map(|(.., tet)| *tet as usize), mesh, rest_tets);
            points.push(&patch.nodes, &patch.gradients_per_m, patch.volume_m3, first_of_nodes + u32::from(material));
        }
        points.end_layer();
        points
    }
}

/// Returns the materials that tets have of their own, `γ (λ⁻, µ)`.
fn materials_of_tets(materials: &[Material]) -> Vec<Material> {
    let part = |material: &Material| {
        let Material { lame, viscosity, .. } = *material;
        Material {
            lame: Lame { lambda_pa: OF_TETS * lame.lambda_pa.min(0.0), mu_pa: OF_TETS * lame.mu_pa },
            viscosity: times(OF_TETS, viscosity),
            crushing_pa: lame.lambda_pa.max(0.0) + CRUSHING_SHEARS * lame.mu_pa,
            ..*material
        }
    };
    materials.iter().map(part).collect()
}

/// What is left of a material for its nodes.
fn of_nodes(material: &Material) -> Material {
    let Material { lame, viscosity, .. } = *material;
    let of_tets_pa = OF_TETS * lame.lambda_pa.min(0.0);
    Material {
        lame: Lame { lambda_pa: lame.lambda_pa - of_tets_pa, mu_pa: (1.0 - OF_TETS) * lame.mu_pa },
        viscosity: times(1.0 - OF_TETS, viscosity),
        ..*material
    }
}

fn times(part: f64, Viscosity { phi_pa_s, psi_pa_s }: Viscosity) -> Viscosity {
    Viscosity { phi_pa_s: part * phi_pa_s, psi_pa_s: part * psi_pa_s }
}

/// The tets around a node, and the mean of their gradients.
#[derive(Debug, Default)]
struct Patch {
    nodes: Vec<u32>,
    gradients_per_m: Vec<DVec3>,
    volume_m3: f64,
}

impl Patch {
    /// `V = Σ_t V_t/4` and `b_i = Σ_t (V_t/4V) b_ti`; the node comes first, the others follow as the tets have them.
    fn fill(&mut self, node: u32, tets: impl Iterator<Item = usize> + Clone, mesh: &TetMesh, rest_tets: &[RestTet]) {
        self.nodes.clear();
        self.nodes.push(node);
        self.gradients_per_m.clear();
        self.gradients_per_m.push(DVec3::ZERO);
        self.volume_m3 = tets.clone().map(|tet| 0.25 * rest_tets[tet].volume_m3).sum();
        for tet in tets {
            let weight = 0.25 * rest_tets[tet].volume_m3 / self.volume_m3;
            for (&node, gradient) in mesh.tets()[tet].iter().zip(rest_tets[tet].gradients_per_m) {
                let number = self.nodes.iter().position(|&own| own == node).unwrap_or_else(|| {
                    self.nodes.push(node);
                    self.gradients_per_m.push(DVec3::ZERO);
                    self.nodes.len() - 1
                });
                self.gradients_per_m[number] += gradient * weight;
            }
        }
    }
}
