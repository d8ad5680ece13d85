//! Elastic energies as compliant constraints.
//!
//! Stable neo-Hookean (Macklin & Müller 2021, for the law without the logarithm, `λ̂ = λ + µ`): with
//! ```text
//! C_D = |F|,  α_D = 1/(µV)        C_H = J − 1 − µ/λ̂,  α_H = 1/(λ̂V)
//! C_D²/(2α_D) + C_H²/(2α_H) = V Ψ(F) + V (3µ/2 + µ²/(2λ̂))
//! ```
//! With `u_i = F b_i` and `c_i = cof F b_i`: `∂C_D/∂x_i = u_i/|F|`, `∂C_H/∂x_i = c_i`. Neither vanishes at rest, where they balance; solved
//! one after the other they leave a motion behind. So both are solved at once, which leaves a resting element where it is:
//! ```text
//! | Σ w u·u + α̃_D |F|²   Σ w u·c       | |p|     | |F|² |                              α̃ = α/h²
//! | Σ w u·c              Σ w c·c + α̃_H | |q| = − | C_H  |        Δx_i = w_i (u_i p + c_i q)
//! ```
//! Any other law: one constraint, `C = √(2VΨ)` with `α = 1`, so `C²/(2α) = VΨ`, and `∂C/∂x_i = −f_i/C`:
//! `Δx_i = w_i f_i/(Σ w f·f/(2VΨ) + 1/h²)`.
use crate::methods::tet_body;
use glam::{DMat3, DVec3};
use palpate_physics::{
    Model,
    elements::linear_tet::RestTet,
    linalg::tensor::{cofactor, outer},
    material::{Law, Material},
};

/// A node: position (m) and inverse mass (1/kg), zero on held axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Node {
    pub(super) x: DVec3,
    pub(super) w: DVec3,
}

/// The body's constraints, in the order of its elements.
pub(super) enum Elements {
    StableNeoHookean(Vec<NeoHookean>),
    AnyLaw(Vec<AnyLaw>),
}

/// Both constraints of an element.
pub(super) struct NeoHookean {
    nodes: [u32; 4],
    /// `b_1, b_2, b_3` (1/m).
    b: [DVec3; 3],
    /// `α_D/h²` and `α_H/h²` (kg), `α` in 1/J.
    compliance: [f64; 2],
    /// `1 + µ/λ̂`.
    rest_j: f64,
}

/// The energy of an element.
pub(super) struct AnyLaw {
    nodes: [u32; 4],
    rest: RestTet,
    material: Material,
    /// `1/h²`.
    compliance: f64,
}

impl Elements {
    /// For substeps `h_s` (s).
    pub(super) fn of(model: &Model, h_s: f64) -> Self {
        let tets = tet_body(model).mesh().tets().iter().enumerate();
        if (0..tet_body(model).mesh().tets().len())
            .all(|tet| tet_body(model).material_of(tet).law == Law::StableNeoHookean)
        {
            let element = |(tet, nodes): (usize, &[u32; 4])| {
                NeoHookean::new(*nodes, &tet_body(model).rest_tets()[tet], tet_body(model).material_of(tet), h_s)
            };
            return Self::StableNeoHookean(tets.map(element).collect());
        }
        let element = |(tet, nodes): (usize, &[u32; 4])| AnyLaw {
            nodes: *nodes,
            rest: tet_body(model).rest_tets()[tet],
            material: *tet_body(model).material_of(tet),
            compliance: 1.0 / (h_s * h_s),
        };
        Self::AnyLaw(tets.map(element).collect())
    }

    /// One sweep of Gauss and Seidel.
    pub(super) fn project(&self, nodes: &mut [Node]) {
        match self {
            Self::StableNeoHookean(elements) => elements.iter().for_each(|element| element.project(nodes)),
            Self::AnyLaw(elements) => elements.iter().for_each(|element| element.project(nodes)),
        }
    }
}

impl NeoHookean {
    fn new(nodes: [u32; 4], rest: &RestTet, material: &Material, h_s: f64) -> Self {
        let (mu, lambda_hat) = (material.lame.mu_pa, material.lame.lambda_pa + material.lame.mu_pa);
        let [_, b1, b2, b3] = rest.gradients_per_m;
        let compliance = [mu, lambda_hat].map(|modulus| 1.0 / (modulus * rest.volume_m3 * h_s * h_s));
        Self { nodes, b: [b1, b2, b3], compliance, rest_j: 1.0 + mu / lambda_hat }
    }

    fn project(&self, nodes: &mut [Node]) {
        let n = self.nodes.map(|n| n as usize);
        let corner = n.map(|n| nodes[n]);
        let f = self.gradient(&corner.map(|c| c.x));
        let [u, c] = self.slopes(&f);
        let square = f.x_axis.length_squared() + f.y_axis.length_squared() + f.z_axis.length_squared();
        let excess = f.x_axis.dot(f.y_axis.cross(f.z_axis)) - self.rest_j;
        let (mut uu, mut uc, mut cc) = (DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        for i in 0..4 {
            let (wu, wc) = (corner[i].w * u[i], corner[i].w * c[i]);
            uu += wu * u[i];
            uc += wu * c[i];
            cc += wc * c[i];
        }
        let (a, b, d) =
            (uu.element_sum() + self.compliance[0] * square, uc.element_sum(), cc.element_sum() + self.compliance[1]);
        // Positive: both diagonal entries exceed those of a Gram matrix.
        let inverse = 1.0 / (a * d - b * b);
        let (p, q) = ((b * excess - d * square) * inverse, (b * square - a * excess) * inverse);
        for i in 0..4 {
            nodes[n[i]].x = corner[i].x + corner[i].w * (u[i] * p + c[i] * q);
        }
    }

    /// `F` of corner positions.
    fn gradient(&self, x: &[DVec3; 4]) -> DMat3 {
        let [b1, b2, b3] = self.b;
        outer(x[1] - x[0], b1) + outer(x[2] - x[0], b2) + outer(x[3] - x[0], b3)
    }

    /// `u_i` and `c_i` (1/m) of the corners.
    fn slopes(&self, f: &DMat3) -> [[DVec3; 4]; 2] {
        let cof = cofactor(f);
        [f, &cof].map(|m| {
            let [m1, m2, m3] = self.b.map(|b| *m * b);
            [-(m1 + m2 + m3), m1, m2, m3]
        })
    }
}

impl AnyLaw {
    fn project(&self, nodes: &mut [Node]) {
        let n = self.nodes.map(|n| n as usize);
        let corner = n.map(|n| nodes[n]);
        let f = self.rest.gradient_of(&corner.map(|c| c.x));
        let energy_j = self.rest.volume_m3 * self.material.energy_density(&f);
        if energy_j <= 0.0 {
            return;
        }
        let forces = self.rest.corner_forces_n(&self.material.piola(&f));
        let mut ff = DVec3::ZERO;
        for (corner, force) in corner.iter().zip(&forces) {
            ff += corner.w * *force * *force;
        }
        let factor = 1.0 / (ff.element_sum() / (2.0 * energy_j) + self.compliance);
        for i in 0..4 {
            nodes[n[i]].x = corner[i].x + corner[i].w * forces[i] * factor;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_physics::material::Lame;

    const CORNERS: [DVec3; 4] = [
        DVec3::new(0.0, 0.001, 0.0),
        DVec3::new(0.011, 0.0, 0.002),
        DVec3::new(0.001, 0.009, 0.0),
        DVec3::new(0.002, 0.003, 0.012),
    ];

    fn rest() -> RestTet {
        let [a, b, c, d] = CORNERS;
        RestTet::new(&DMat3::from_cols(b - a, c - a, d - a))
    }

    fn material(law: Law) -> Material {
        let lame = Lame::from_young_poisson(10e3, 0.45).unwrap();
        Material { law, lame, viscosity: palpate_physics::material::Viscosity::default(), crushing_pa: 0.0 }
    }

    /// Deformed, turned and, the last, inverted.
    fn shapes() -> [[DVec3; 4]; 3] {
        let bent =
            CORNERS.map(|x| x + DVec3::new((300.0 * x.y).sin(), (200.0 * x.z).cos(), (250.0 * x.x).sin()) * 2e-3);
        let turned = bent.map(|x| DMat3::from_rotation_x(0.8) * x * 1.2);
        let mirrored = bent.map(|x| x * DVec3::new(1.0, 1.0, -0.4));
        [bent, turned, mirrored]
    }

    fn neo_hookean(h_s: f64) -> NeoHookean {
        NeoHookean::new([0, 1, 2, 3], &rest(), &material(Law::StableNeoHookean), h_s)
    }

    /// `[C_D, C_H]`.
    fn constraints(element: &NeoHookean, x: &[DVec3; 4]) -> [f64; 2] {
        let f = element.gradient(x);
        let square: f64 = f.to_cols_array().iter().map(|a| a * a).sum();
        [square.sqrt(), f.determinant() - element.rest_j]
    }

    #[test]
    fn both_constraints_hold_the_laws_energy() {
        let (element, material, rest) = (neo_hookean(1.0), material(Law::StableNeoHookean), rest());
        let energy = |x: &[DVec3; 4]| {
            let [d, h] = constraints(&element, x);
            0.5 * (d * d / element.compliance[0] + h * h / element.compliance[1])
        };
        for x in shapes() {
            let expected = rest.energy_j(&material, &x);
            assert!(
                (energy(&x) - energy(&CORNERS) - expected).abs() < 1e-12 * (expected + energy(&CORNERS)),
                "{expected}"
            );
        }
    }

    #[test]
    fn slopes_are_those_of_the_constraints() {
        let element = neo_hookean(1e-4);
        for x in shapes() {
            let [u, c] = element.slopes(&element.gradient(&x));
            let [d, _] = constraints(&element, &x);
            for (corner, axis) in (0..4).flat_map(|corner| (0..3).map(move |axis| (corner, axis))) {
                let at = |step: f64| {
                    let mut x = x;
                    x[corner][axis] += step;
                    constraints(&element, &x)
                };
                let (up, down) = (at(1e-8), at(-1e-8));
                for (constraint, slope) in [u[corner][axis] / d, c[corner][axis]].into_iter().enumerate() {
                    let difference = (up[constraint] - down[constraint]) / 2e-8;
                    assert!((difference - slope).abs() < 1e-4, "{constraint}: {difference} {slope}");
                }
            }
        }
    }

    /// In the limit of small steps every law's constraints move a node by `h² f/m`.
    #[test]
    fn short_steps_follow_the_force() {
        let (h, w) = (1e-6, DVec3::new(1e3, 2e3, 0.0));
        for law in [Law::StableNeoHookean, Law::StVenantKirchhoff, Law::FixedCorotated] {
            for x in shapes() {
                let (rest, material) = (rest(), material(law));
                let elements = if law == Law::StableNeoHookean {
                    Elements::StableNeoHookean(vec![neo_hookean(h)])
                } else {
                    Elements::AnyLaw(vec![AnyLaw { nodes: [0, 1, 2, 3], rest, material, compliance: 1.0 / (h * h) }])
                };
                let mut nodes = x.map(|x| Node { x, w });
                elements.project(&mut nodes);
                let forces = rest.forces_n(&material, &x, &[DVec3::ZERO; 4]);
                let scale = forces.iter().map(|f| f.length()).fold(0.0, f64::max);
                for (corner, force) in forces.iter().enumerate() {
                    let found = (nodes[corner].x - x[corner]) / (h * h);
                    assert!((found - w * *force).length() < 1e-3 * w.x * scale, "{law:?}: {found} {}", w * *force);
                }
            }
        }
    }

    /// Although neither constraint vanishes there.
    #[test]
    fn an_element_at_rest_stays() {
        let mut nodes = CORNERS.map(|x| Node { x, w: DVec3::splat(1e3) });
        neo_hookean(1e-4).project(&mut nodes);
        for (node, x) in nodes.iter().zip(CORNERS) {
            assert!(node.x.distance(x) < 1e-15, "{} {x}", node.x);
        }
    }
}
