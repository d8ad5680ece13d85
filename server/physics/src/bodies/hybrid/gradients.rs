//! The deformation gradients of a hybrid body, by what a running patch has ready: for a look every few ticks. The oracle is
//! [`super::patch::Patch::each_gradient`].
use super::{body::HybridBody, running::RunningPatch, scratch::HybridScratch, state::HybridState};
use crate::{linalg::tensor::outer, material::Law};
use glam::{DMat3, DVec3};

impl HybridScratch {
    /// Returns whether the patch is that of the state's active particles.
    pub(crate) fn is_of(&self, own: &HybridState) -> bool {
        self.patch.active() == own.ids()
    }

    /// Tells the deformation gradients of awake cells and the means of coarse tets at positions `x` (m). Allocates nothing.
    pub(crate) fn each_gradient(&mut self, body: &HybridBody, x: &[DVec3], each: &mut dyn FnMut(&DMat3, Law, usize)) {
        let materials = body.materials();
        self.patch.displace(body, x);
        for &cell in self.patch.cells() {
            let tet = body.partition.cells()[cell as usize].tet as usize;
            each(&self.patch.gradient(body, cell), materials.of(tet).law, tet);
        }
        for tet in 0..body.coarse().tets().len() {
            let mean = self.patch.residual_element(tet as u32).mean_gradient(&x[..body.node_count()]);
            each(&mean, materials.of(tet).law, tet);
        }
    }
}

impl RunningPatch {
    /// Returns `F = I + Σ_p u_p b_pᵀ` of an awake cell after [`Self::displace`].
    fn gradient(&self, body: &HybridBody, cell: u32) -> DMat3 {
        let moments = body.partition.moments(cell as usize);
        let particles = body.partition.corners(cell as usize);
        let displacement_m = |particle: u32| self.displacements_m()[self.point_of(particle) as usize];
        let first_m = displacement_m(particles[0]);
        let pairs = particles.into_iter().zip(moments.gradients_m2).skip(1);
        let sum = pairs.fold(DMat3::ZERO, |sum, (p, b_m2)| sum + outer(displacement_m(p) - first_m, b_m2));
        DMat3::IDENTITY + sum * (1.0 / moments.volume_m3)
    }
}
