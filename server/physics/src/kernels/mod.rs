//! The force kernel: internal forces of all tets, in blocks of lanes; [`IntegrationPoints`] is its scalar oracle.
//!
//! Forces are computed in f32 (16 lanes) or f64 (8 lanes) and summed per node in f64; positions and velocities are f64
//! always. Displacements `u = x − X` and their differences along the edges of a tet are taken in f64, and only the
//! differences are rounded to the kernel's precision: what a body's rigid motion and size would cost in digits is not
//! lost. Same inputs, same bits, on every instruction set.
// A vector type is only fast where it is inlined into a function compiled for its instruction set.
#![allow(clippy::inline_always)]
mod forces;
mod layout;
mod point_layout;
mod points;
mod products;
mod tets;

use crate::{
    elements::integration_points::IntegrationPoints,
    lanes::{
        Available, InstructionSet, LANES_F32, LANES_F64,
        grid::DisplacementGrid,
        nodes::{Node, Sum, node},
        real::Scalar,
    },
    mesh::TetMesh,
    settings::Precision,
};
use glam::DVec3;
use points::{PointForces, PointProducts, PointTables};
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
    Single(Tables<f32, LANES_F32>),
    Double(Tables<f64, LANES_F64>),
}

/// Tets, and points over more nodes, in lanes.
#[derive(Debug, Clone)]
struct Tables<T, const N: usize> {
    tets: TetBlocks<T, N>,
    runs: Vec<Run<T>>,
    points: PointTables<T, N>,
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
    /// Lays out the integration points of a mesh.
    pub fn build(mesh: &TetMesh, points: &IntegrationPoints, precision: Precision) -> Self {
        let layout = match precision {
            Precision::Single => Layout::Single(Tables::build(mesh, points)),
            Precision::Double => Layout::Double(Tables::build(mesh, points)),
        };
        let largest_m3 = points.of_tets().map(|point| point.volume_m3).fold(0.0, f64::max);
        Self {
            layout,
            grid: DisplacementGrid::of_tets(precision, largest_m3),
            nodes: mesh.positions_m().len(),
            is_viscous: points.materials().1.iter().any(|m| !m.viscosity.is_zero()),
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
            Layout::Single(tables) => self.add_forces(tables, scratch),
            Layout::Double(tables) => self.add_forces(tables, scratch),
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
            Layout::Single(tables) => self.add_products(factors, tables, scratch),
            Layout::Double(tables) => self.add_products(factors, tables, scratch),
        }
        for (product, Sum([x, y, z, _])) in products_n.iter_mut().zip(&scratch.sums) {
            *product = DVec3::new(*x, *y, *z);
        }
    }

    fn add_products<T: Scalar, const N: usize>(
        &self,
        factors: [f64; 2],
        tables: &Tables<T, N>,
        scratch: &mut KernelScratch,
    ) {
        let KernelScratch { displacements, directions, sums, .. } = scratch;
        let Tables { tets, runs, points } = tables;
        for run in runs {
            let mut pass = Products { blocks: tets, run, displacements, directions, factors, sums };
            run.material.run(self.instruction_set, self.every_viscosity, &mut pass);
        }
        for run in &points.runs {
            let mut pass = PointProducts { tables: points, run, displacements, directions, factors, sums };
            run.material.run(self.instruction_set, self.every_viscosity, &mut pass);
        }
    }

    fn add_forces<T: Scalar, const N: usize>(&self, tables: &Tables<T, N>, scratch: &mut KernelScratch) -> f64 {
        let KernelScratch { displacements, velocities, sums, .. } = scratch;
        let Tables { tets, runs, points } = tables;
        let mut power_w = 0.0;
        for run in runs {
            let mut pass = Forces { blocks: tets, run, displacements, velocities, sums };
            power_w += run.material.run(self.instruction_set, self.every_viscosity, &mut pass);
        }
        for run in &points.runs {
            let mut pass = PointForces { tables: points, run, displacements, velocities, sums };
            power_w += run.material.run(self.instruction_set, self.every_viscosity, &mut pass);
        }
        power_w
    }
}

impl<T: Scalar, const N: usize> Tables<T, N> {
    fn build(mesh: &TetMesh, points: &IntegrationPoints) -> Self {
        let (tets, runs) = layout::blocks(mesh, points);
        Self { tets, runs, points: point_layout::tables(points, mesh) }
    }
}
