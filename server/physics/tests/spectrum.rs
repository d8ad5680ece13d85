//! ω_max: against a dense eigen-solve, a formula, the element bound, and what the leapfrog does on either side of 2/ω_max.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use crate::support;
use faer::{Mat, Side};
use glam::DVec3;
use palpate_physics::{
    BodySpec, Model, ModelSpec, Precision, PrescribedSpec, Region, Scratch, Settings, Solid, State, Substeps, TetMesh,
    TickInput,
    elements::{
        integration_points::IntegrationPoints,
        linear_tet::RestTet,
        mass,
        rest_stiffness::{RestStiffness, element_bound_rad_per_s, max_natural_frequency_rad_per_s},
    },
    material::{Convention, Lame, Law, Material, Viscosity},
    step,
};
use support::{Random, block};

fn material(young_pa: f64, nu: f64, law: Law) -> Material {
    Material::new(law, Lame::from_young_poisson(young_pa, nu).unwrap(), Viscosity::default(), Convention::Consistent)
}

/// How integration points are made of tets.
type OfTets = fn(&TetMesh, &[RestTet], &[u16], &[Material]) -> IntegrationPoints;

const LINEAR: OfTets = IntegrationPoints::of_linear_tets;

struct Body {
    points: IntegrationPoints,
    inverse_mass: Vec<DVec3>,
}

impl Body {
    fn new(of_tets: OfTets, mesh: &TetMesh, materials: &[Material], fixed: impl Fn(usize) -> [bool; 3]) -> Self {
        let rest: Vec<RestTet> = (0..mesh.tets().len()).map(|t| RestTet::new(&mesh.edge_matrix_m(t))).collect();
        let tet_material: Vec<u16> = (0..rest.len()).map(|t| (t * materials.len() / rest.len()) as u16).collect();
        let inverse_mass = mass::lumped_kg(mesh, |_| 1000.0)
            .iter()
            .enumerate()
            .map(|(node, m)| DVec3::from_array(fixed(node).map(|f| if f { 0.0 } else { 1.0 / m })))
            .collect();
        Self { points: of_tets(mesh, &rest, &tet_material, materials), inverse_mass }
    }

    fn stiffness<'a>(&'a self, springs_n_per_m: &'a [f64]) -> RestStiffness<'a> {
        RestStiffness { points: &self.points, springs_n_per_m }
    }

    fn measured(&self) -> f64 {
        max_natural_frequency_rad_per_s(&self.stiffness(&[]), &self.inverse_mass)
    }

    fn element_bound(&self) -> f64 {
        element_bound_rad_per_s(&self.stiffness(&[]), &self.inverse_mass)
    }

    /// From the stiffness blocks at rest, assembled densely.
    fn dense(&self) -> f64 {
        let dofs = 3 * self.inverse_mass.len();
        let mut a = Mat::<f64>::zeros(dofs, dofs);
        for point in self.points.iter() {
            for i in 0..point.nodes.len() {
                for j in 0..point.nodes.len() {
                    let block = point.stiffness_block(&glam::DMat3::IDENTITY, i, j);
                    let (p, q) = (point.nodes[i] as usize, point.nodes[j] as usize);
                    for r in 0..3 {
                        for c in 0..3 {
                            let scale = (self.inverse_mass[p][r] * self.inverse_mass[q][c]).sqrt();
                            a[(3 * p + r, 3 * q + c)] -= scale * block.col(c)[r];
                        }
                    }
                }
            }
        }
        let values = a.self_adjoint_eigenvalues(Side::Lower).unwrap();
        values.into_iter().fold(0.0, f64::max).sqrt()
    }
}

/// Never below the exact value, and above it by 1e-4 at most: the documented margin.
fn assert_agrees(measured: f64, exact: f64) {
    let excess = measured / exact - 1.0;
    assert!((-1e-9..=1e-4).contains(&excess), "{measured} against {exact}: {excess:e}");
}

#[test]
fn lanczos_agrees_with_a_dense_solve_and_stays_below_the_element_bound() {
    let mut random = Random(7);
    for (cells, nu, law) in [
        ([3, 3, 2], 0.3, Law::StVenantKirchhoff),
        ([4, 2, 2], 0.49, Law::StableNeoHookean),
        ([2, 2, 5], 0.0, Law::FixedCorotated),
        ([1, 1, 1], 0.45, Law::StableNeoHookean),
    ] {
        let mesh = block(cells, 5e-3, 0.15, &mut random);
        let materials = vec![material(10e3, nu, law), material(80e3, nu, law)];
        for fixed in [[false; 3], [true; 3], [true, false, true]] {
            for of_tets in [LINEAR, IntegrationPoints::of_smoothed_tets] {
                let held = |node| if node < 5 { fixed } else { [false; 3] };
                let body = Body::new(of_tets, &mesh, &materials, held);
                let exact = body.dense();
                assert_agrees(body.measured(), exact);
                assert!(body.element_bound() >= exact, "{} < {exact}", body.element_bound());
            }
        }
    }
}

/// One free degree of freedom: `ω² = k/m` with `k = V(λ + 2µ)|b|²` along `b ∥ x`, `m = ρV/4`.
#[test]
fn one_free_axis_has_the_frequency_of_the_formula() {
    let h = 3e-3;
    let mesh = TetMesh::new(vec![DVec3::ZERO, DVec3::X * h, DVec3::Y * h, DVec3::Z * h], vec![[0, 1, 2, 3]]).unwrap();
    let m = material(20e3, 0.4, Law::StableNeoHookean);
    let modulus = m.lame.p_wave_modulus_pa();
    let body = Body::new(LINEAR, &mesh, &[m], |node| [node != 1, true, true]);
    let expected = (4.0 * modulus / 1000.0).sqrt() / h;
    assert!((body.measured() / expected - 1.0).abs() < 1e-12, "{} {expected}", body.measured());
}

/// Springs of `k_i = c m_i` on the nodes of a free body move every eigenvalue by `c`: `ω² → ω² + c`.
#[test]
fn springs_as_strong_as_the_masses_shift_the_whole_spectrum() {
    let mesh = block([3, 2, 2], 5e-3, 0.15, &mut Random(3));
    let body = Body::new(LINEAR, &mesh, &[material(10e3, 0.45, Law::StableNeoHookean)], |_| [false; 3]);
    let exact = body.dense();
    for c in [0.5 * exact * exact, 20.0 * exact * exact] {
        let springs: Vec<f64> = body.inverse_mass.iter().map(|inverse| c / inverse.x).collect();
        let measured = max_natural_frequency_rad_per_s(&body.stiffness(&springs), &body.inverse_mass);
        assert_agrees(measured, (exact * exact + c).sqrt());
    }
}

/// Uniform stretch `u_x = ±1` of a cube that moves along x alone has `U = ½V(λ + 2µ)(2/h)²` and `T = ½ρV ω²`: Rayleigh's
/// quotient of it is a lower bound, `ω_max ≥ 2c/h` with the wave speed c.
#[test]
fn a_cube_is_at_least_as_fast_as_its_uniform_stretch() {
    let h = 4e-3;
    let mesh = block([1, 1, 1], h, 0.0, &mut Random(1));
    let m = material(10e3, 0.0, Law::StVenantKirchhoff);
    let body = Body::new(LINEAR, &mesh, &[m], |_| [false, true, true]);
    assert!(body.measured() >= 2.0 / h * (m.lame.p_wave_modulus_pa() / 1000.0).sqrt());
}

#[test]
fn a_body_held_everywhere_has_no_frequency() {
    let mesh = block([1, 1, 1], 1e-3, 0.0, &mut Random(1));
    let body = Body::new(LINEAR, &mesh, &[material(10e3, 0.3, Law::StableNeoHookean)], |_| [true; 3]);
    assert_eq!(body.measured(), 0.0);
}

/// Total displacement energy after `ticks`, relative to the start, at `fraction` of the step limit 2/ω.
fn growth(fraction: f64, ticks: u32) -> f64 {
    let mut random = Random(11);
    let mesh = block([4, 3, 3], 5e-3, 0.15, &mut random);
    let spec = |tick_period_s: f64| ModelSpec {
        body: BodySpec::Tet(
            Solid {
                mesh: mesh.clone(),
                regions: vec![Region {
                    name: "body".into(),
                    material: material(10e3, 0.45, Law::StableNeoHookean),
                    density_kg_per_m3: 1000.0,
                }],
                tet_region: vec![0; mesh.tets().len()],
            }
            .into(),
        ),
        prescribed: vec![PrescribedSpec {
            name: "base".into(),
            nodes: (0..20).collect(),
            axes: [true; 3],
            is_fixed: false,
        }],
        loads: vec![],
        gravity_m_per_s2: DVec3::ZERO,
        tools: vec![],
        settings: Settings {
            tick_period_s,
            substeps: Substeps::Fixed(1),
            precision: Precision::Double,
            subcycle_unstable: false,
            ..Settings::default()
        },
    };
    let omega = Model::build(spec(1e-3)).unwrap().body().max_natural_frequency_rad_per_s();
    let model = Model::build(spec(fraction * 2.0 / omega)).unwrap();
    let mut state = State::at_rest(&model);
    for (x, inverse_mass) in state.mechanical.x.iter_mut().zip(model.body().as_tet().unwrap().inverse_mass_per_kg()) {
        if inverse_mass.x > 0.0 {
            *x += random.vector() * 1e-9;
        }
    }
    let mut scratch = Scratch::new(&model);
    let input =
        TickInput { tools: &[], load_factors: &[], prescribed_displacements_m: &[DVec3::ZERO], point_forces: &[] };
    for _ in 0..ticks {
        step(&model, &mut state, &mut scratch, &input);
        if state.quarantine.is_some() {
            return f64::INFINITY;
        }
    }
    let u: f64 = state.mechanical.x.iter().zip(model.rest_positions_m()).map(|(x, r)| (*x - *r).length_squared()).sum();
    (u / (state.mechanical.x.len() as f64 * 1e-18)).sqrt()
}

#[test]
fn leapfrog_is_bounded_below_the_limit_and_blows_up_above_it() {
    let below = growth(0.98, 20_000);
    assert!(below < 20.0, "grew {below} times at 0.98");
    let above = growth(1.05, 200);
    assert!(above > 1e6, "only {above} times at 1.05");
}
