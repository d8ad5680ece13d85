//! The integration points of a body of tetrahedra, as plain f64 code: the oracle of the vector kernels, and what the static
//! solver assembles.
//!
//! ```text
//! U = Σ_q V_q Ψ_q(F_q)        F_q = Σ_i x_i b_qiᵀ        f_i = −∂U/∂x_i = −Σ_q V_q P_q b_qi
//! ```
//! with gradients `b_qi` (1/m) that the rest state fixes, `Σ_i b_qi = 0`. Linear tetrahedra have a point each, over four
//! nodes; smoothed ones ([`super::smoothing`]) have points over more.
use super::linear_tet::RestTet;
use crate::{
    linalg::tensor::outer,
    material::{Material, viscous},
    mesh::TetMesh,
};
use glam::{DMat3, DVec3};
use std::ops::Range;

/// The integration points of a body.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct IntegrationPoints {
    /// Where the entries of every point start in the lists of nodes and gradients, and where the last one's end.
    starts: Vec<u32>,
    nodes: Vec<u32>,
    gradients_per_m: Vec<DVec3>,
    volume_m3: Vec<f64>,
    material_of: Vec<u32>,
    materials: Vec<Material>,
    /// Ranges of points that each fill the body once.
    layers: Vec<Range<usize>>,
}

/// One integration point.
#[derive(Debug, Clone, Copy)]
pub struct IntegrationPoint<'a> {
    /// The nodes that strain it.
    pub nodes: &'a [u32],
    /// Gradients `b_i` (1/m), one for every node; they sum to zero.
    pub gradients_per_m: &'a [DVec3],
    /// Rest volume `V` (m³).
    pub volume_m3: f64,
    /// Its material.
    pub material: &'a Material,
}

impl IntegrationPoints {
    /// Returns those of linear tetrahedra; `tet_material[t]` indexes `materials`.
    pub fn of_linear_tets(mesh: &TetMesh, rest_tets: &[RestTet], tet_material: &[u16], materials: &[Material]) -> Self {
        let mut points = Self::over(materials.to_vec());
        for ((nodes, rest), &material) in mesh.tets().iter().zip(rest_tets).zip(tet_material) {
            points.push(nodes, &rest.gradients_per_m, rest.volume_m3, u32::from(material));
        }
        points.end_layer();
        points
    }

    /// Returns none yet, over some materials.
    fn over(materials: Vec<Material>) -> Self {
        Self { starts: vec![0], materials, ..Self::default() }
    }

    /// Adds materials for points to come; returns the number of the first.
    pub(super) fn add_materials(&mut self, materials: impl Iterator<Item = Material>) -> u32 {
        let first = self.materials.len() as u32;
        self.materials.extend(materials);
        first
    }

    /// Adds a point.
    pub(super) fn push(&mut self, nodes: &[u32], gradients_per_m: &[DVec3], volume_m3: f64, material: u32) {
        debug_assert_eq!(nodes.len(), gradients_per_m.len());
        self.nodes.extend_from_slice(nodes);
        self.gradients_per_m.extend_from_slice(gradients_per_m);
        self.volume_m3.push(volume_m3);
        self.material_of.push(material);
        self.starts.push(self.nodes.len() as u32);
    }

    /// Says that the points that were added since the last layer fill the body once.
    pub(super) fn end_layer(&mut self) {
        let first = self.layers.last().map_or(0, |layer| layer.end);
        if self.len() > first {
            self.layers.push(first..self.len());
        }
    }

    /// Returns the same points of other materials.
    #[must_use]
    pub(crate) fn with_materials(&self, change: impl Fn(&Material) -> Material) -> Self {
        Self { materials: self.materials.iter().map(change).collect(), ..self.clone() }
    }

    /// Returns how many there are.
    pub fn len(&self) -> usize {
        self.volume_m3.len()
    }

    /// Returns whether there are none.
    pub fn is_empty(&self) -> bool {
        self.volume_m3.is_empty()
    }

    /// Returns the point of a number.
    pub fn point(&self, number: usize) -> IntegrationPoint<'_> {
        let entries = self.starts[number] as usize..self.starts[number + 1] as usize;
        IntegrationPoint {
            nodes: &self.nodes[entries.clone()],
            gradients_per_m: &self.gradients_per_m[entries],
            volume_m3: self.volume_m3[number],
            material: &self.materials[self.material_of[number] as usize],
        }
    }

    /// Returns all of them, in order.
    pub fn iter(&self) -> impl Iterator<Item = IntegrationPoint<'_>> {
        self.within(0..self.len())
    }

    fn within(&self, range: Range<usize>) -> impl Iterator<Item = IntegrationPoint<'_>> {
        range.map(|number| self.point(number))
    }

    /// Returns layers of points of which each fills the body once: the tets, then, where they are smoothed, the nodes.
    pub(crate) fn layers(&self) -> impl Iterator<Item = impl Iterator<Item = IntegrationPoint<'_>> + Clone> {
        self.layers.iter().map(|layer| layer.clone().map(|number| self.point(number)))
    }

    /// Returns those of tets, in their order.
    pub(crate) fn of_tets(&self) -> impl Iterator<Item = IntegrationPoint<'_>> {
        self.within(self.layers.first().cloned().unwrap_or(0..0))
    }

    /// Returns the numbers of those that are not of tets.
    pub(crate) fn beside_tets(&self) -> Range<usize> {
        self.layers.first().map_or(0, |tets| tets.end)..self.len()
    }

    /// Returns the number of each point's material, and the materials.
    pub(crate) fn materials(&self) -> (&[u32], &[Material]) {
        (&self.material_of, &self.materials)
    }

    /// Returns the elastic energy `Σ_q V_q Ψ_q` (J) at positions `x` (m).
    pub fn energy_j(&self, x: &[DVec3]) -> f64 {
        self.iter().map(|point| point.energy_j(x)).sum()
    }

    /// Overwrites `forces_n` (N) with elastic and viscous forces at positions `x` (m) and velocities `v` (m/s); returns the
    /// power (W) that viscous stress takes.
    pub fn forces_n(&self, x: &[DVec3], v: &[DVec3], forces_n: &mut [DVec3]) -> f64 {
        forces_n.fill(DVec3::ZERO);
        let mut viscous_power_w = 0.0;
        for point in self.iter() {
            let f = point.gradient_of(x);
            let mut p = point.material.piola(&f);
            if !point.material.viscosity.is_zero() {
                let rate = point.gradient_of(v);
                p += viscous::piola(point.material.viscosity, &f, &rate);
                viscous_power_w += point.volume_m3 * viscous::power_density(point.material.viscosity, &f, &rate);
            }
            point.add_forces_n(&p, forces_n);
        }
        viscous_power_w
    }

    /// Overwrites `products_n` with `−(α K + β C) a` at positions `x`: `K = −∂f/∂x` (N/m) of elastic stress, `C = −∂f/∂v`
    /// (N s/m) of viscous stress.
    pub fn products_n(&self, [elastic, viscosity]: [f64; 2], x: &[DVec3], a: &[DVec3], products_n: &mut [DVec3]) {
        products_n.fill(DVec3::ZERO);
        for point in self.iter() {
            let (f, df) = (point.gradient_of(x), point.gradient_of(a));
            let p = point.material.piola_differential(&f, &df) * elastic
                + viscous::piola(point.material.viscosity, &f, &df) * viscosity;
            point.add_forces_n(&p, products_n);
        }
    }
}

impl IntegrationPoint<'_> {
    /// Returns `Σ_i a_i b_iᵀ`: the deformation gradient of positions, or its rate of velocities. It is written with
    /// differences to the first node, so that a translation drops out exactly.
    pub fn gradient_of(&self, a: &[DVec3]) -> DMat3 {
        let Some((&first, others)) = self.nodes.split_first() else { return DMat3::ZERO };
        let first = a[first as usize];
        others
            .iter()
            .zip(&self.gradients_per_m[1..])
            .map(|(&node, b)| outer(a[node as usize] - first, *b))
            .reduce(|sum, term| sum + term)
            .unwrap_or(DMat3::ZERO)
    }

    /// Returns the elastic energy `V Ψ(F)` (J).
    pub fn energy_j(&self, x: &[DVec3]) -> f64 {
        self.volume_m3 * self.material.energy_density(&self.gradient_of(x))
    }

    /// Adds `f_i = −V P b_i` (N); what is added sums to zero.
    pub fn add_forces_n(&self, p: &DMat3, forces_n: &mut [DVec3]) {
        let Some((&first, others)) = self.nodes.split_first() else { return };
        let of_others = || self.gradients_per_m[1..].iter().map(|b| *p * *b * -self.volume_m3);
        let sum = of_others().reduce(|sum, force| sum + force).unwrap_or(DVec3::ZERO);
        forces_n[first as usize] += -sum;
        for (&node, force) in others.iter().zip(of_others()) {
            forces_n[node as usize] += force;
        }
    }

    /// Returns the stiffness block `∂f_i/∂x_j` (N/m), negative semi-definite at rest, of its `i`-th and `j`-th node: column
    /// `c` is `−V δP b_i` for `δF = e_c b_jᵀ`.
    pub fn stiffness_block(&self, f: &DMat3, i: usize, j: usize) -> DMat3 {
        let column = |axis: DVec3| {
            let dp = self.material.piola_differential(f, &outer(axis, self.gradients_per_m[j]));
            dp * self.gradients_per_m[i] * -self.volume_m3
        };
        DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))
    }
}
