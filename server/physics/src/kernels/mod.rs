//! The force kernel: internal forces of all tets, in blocks of lanes, beside its scalar oracle.
//!
//! Forces are computed in f32 (16 lanes) or f64 (8 lanes) and summed per node in f64; positions and velocities are f64
//! always. Displacements `u = x − X` and their differences along the edges of a tet are taken in f64, and only the
//! differences are rounded to the kernel's precision: what a body's rigid motion and size would cost in digits is not
//! lost. Same inputs, same bits, on every instruction set.
// A vector type is only fast where it is inlined into a function compiled for its instruction set.
#![allow(clippy::inline_always)]
mod forces;
mod layout;
mod oracle;
mod products;
mod tets;

use crate::{
    elements::linear_tet::RestTet,
    lanes::{
        Available, InstructionSet, LANES_F32, LANES_F64,
        grid::DisplacementGrid,
        nodes::{Node, Sum, node},
        real::Scalar,
    },
    material::Material,
    mesh::TetMesh,
    settings::Precision,
};
use glam::DVec3;
pub use oracle::Oracle;
use tets::{Forces, Products, Run, TetBlocks};

/// Internal forces of a body: rest data laid out for the kernel of the chosen precision.
#[derive(Debug, Clone)]
pub struct ForceKernel {
    layout: Layout,
    grid: DisplacementGrid,
    nodes: usize,
    /// Whether some material is viscous.
    is_viscous: bool,
    /// Off switch of the skip of viscous terms where a material has none.
    every_viscosity: bool,
    instruction_set: Available,
}

#[derive(Debug, Clone)]
enum Layout {
    Single(TetBlocks<f32, LANES_F32>, Vec<Run<f32>>),
    Double(TetBlocks<f64, LANES_F64>, Vec<Run<f64>>),
}

/// Buffers of the kernel.
#[derive(Debug, Clone)]
pub struct KernelScratch {
    displacements: Vec<Node>,
    velocities: Vec<Node>,
    /// Empty unless made for products.
    directions: Vec<Node>,
    sums: Vec<Sum>,
}

impl ForceKernel {
    /// Lays out the rest data. `tet_material[t]` indexes `materials`.
    pub fn build(
        mesh: &TetMesh,
        rest_tets: &[RestTet],
        tet_material: &[u16],
        materials: &[Material],
        precision: Precision,
    ) -> Self {
        let layout = match precision {
            Precision::Single => {
                let (blocks, runs) = layout::blocks(mesh, rest_tets, tet_material, materials);
                Layout::Single(blocks, runs)
            }
            Precision::Double => {
                let (blocks, runs) = layout::blocks(mesh, rest_tets, tet_material, materials);
                Layout::Double(blocks, runs)
            }
        };
        let largest_m3 = rest_tets.iter().map(|rest| rest.volume_m3).fold(0.0, f64::max);
        Self {
            layout,
            grid: DisplacementGrid::of_tets(precision, largest_m3),
            nodes: mesh.positions_m().len(),
            is_viscous: materials.iter().any(|m| !m.viscosity.is_zero()),
            every_viscosity: false,
            instruction_set: Available::best(),
        }
    }

    /// The same kernel, computing viscous terms also where φ = ψ = 0: the same forces, only slower.
    #[must_use]
    pub fn with_every_viscosity(self) -> Self {
        Self { every_viscosity: true, ..self }
    }

    /// The same kernel, held to an instruction set or the best below it that there is (for tests and benchmarks).
    #[must_use]
    pub fn with_instruction_set(self, instruction_set: InstructionSet) -> Self {
        Self { instruction_set: Available::at_most(instruction_set), ..self }
    }

    /// Whether any material is viscous.
    pub fn is_viscous(&self) -> bool {
        self.is_viscous
    }

    /// Buffers for [`Self::forces_n`].
    pub fn scratch(&self) -> KernelScratch {
        // One spare node more, for the lanes of padding.
        let count = self.nodes + 1;
        let rates = if self.is_viscous || self.every_viscosity { count } else { 0 };
        KernelScratch {
            displacements: vec![Node::default(); count],
            velocities: vec![Node::default(); rates],
            directions: Vec::new(),
            sums: vec![Sum::default(); count],
        }
    }

    /// Overwrites `forces_n` (N) with elastic and viscous forces at positions `x` (m) and velocities `v` (m/s), and
    /// returns the power (W) that viscous stress takes. `v` is not read when no material is viscous.
    pub fn forces_n(
        &self,
        rest_positions_m: &[DVec3],
        x: &[DVec3],
        v: &[DVec3],
        forces_n: &mut [DVec3],
        scratch: &mut KernelScratch,
    ) -> f64 {
        self.linearise_at(rest_positions_m, x, scratch);
        for (rate, v) in scratch.velocities.iter_mut().zip(v) {
            *rate = node(*v);
        }
        // The spare node of the padding, past the end of `v`, stays zero.
        scratch.sums.fill(Sum::default());
        let power_w = match &self.layout {
            Layout::Single(blocks, runs) => self.add_forces(blocks, runs, scratch),
            Layout::Double(blocks, runs) => self.add_forces(blocks, runs, scratch),
        };
        for (force, Sum([fx, fy, fz, _])) in forces_n.iter_mut().zip(&scratch.sums) {
            *force = DVec3::new(*fx, *fy, *fz);
        }
        power_w
    }

    /// Buffers for [`Self::products_n`] too.
    pub fn scratch_for_products(&self) -> KernelScratch {
        KernelScratch { directions: vec![Node::default(); self.nodes + 1], ..self.scratch() }
    }

    /// Takes the positions `x` (m) about which [`Self::products_n`] linearises.
    pub fn linearise_at(&self, rest_positions_m: &[DVec3], x: &[DVec3], scratch: &mut KernelScratch) {
        for ((u, x), rest) in scratch.displacements.iter_mut().zip(x).zip(rest_positions_m) {
            *u = node(self.grid.rounded(*x - *rest));
        }
    }

    /// Overwrites `products_n` (N) with `−(α K + β C) a`: the tangent stiffness `K = −∂f/∂x` (N/m) of elastic stress
    /// and the matrix `C = −∂f/∂v` (N s/m) of viscous stress, at the positions of the last [`Self::linearise_at`] with
    /// this scratch.
    pub fn products_n(&self, factors: [f64; 2], a: &[DVec3], products_n: &mut [DVec3], scratch: &mut KernelScratch) {
        for (direction, a) in scratch.directions.iter_mut().zip(a) {
            *direction = node(*a);
        }
        scratch.sums.fill(Sum::default());
        match &self.layout {
            Layout::Single(blocks, runs) => self.add_products(factors, blocks, runs, scratch),
            Layout::Double(blocks, runs) => self.add_products(factors, blocks, runs, scratch),
        }
        for (product, Sum([x, y, z, _])) in products_n.iter_mut().zip(&scratch.sums) {
            *product = DVec3::new(*x, *y, *z);
        }
    }

    fn add_products<T: Scalar, const N: usize>(
        &self,
        factors: [f64; 2],
        blocks: &TetBlocks<T, N>,
        runs: &[Run<T>],
        scratch: &mut KernelScratch,
    ) {
        let KernelScratch { displacements, directions, sums, .. } = scratch;
        for run in runs {
            let mut pass = Products { blocks, run, displacements, directions, factors, sums };
            run.material.run(self.instruction_set, self.every_viscosity, &mut pass);
        }
    }

    fn add_forces<T: Scalar, const N: usize>(
        &self,
        blocks: &TetBlocks<T, N>,
        runs: &[Run<T>],
        scratch: &mut KernelScratch,
    ) -> f64 {
        let KernelScratch { displacements, velocities, sums, .. } = scratch;
        let mut power_w = 0.0;
        for run in runs {
            let mut pass = Forces { blocks, run, displacements, velocities, sums };
            power_w += run.material.run(self.instruction_set, self.every_viscosity, &mut pass);
        }
        power_w
    }
}
