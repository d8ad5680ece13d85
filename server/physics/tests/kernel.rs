//! The force kernel against its scalar oracle, and its own promises: same bits on every instruction set, balanced forces.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use crate::support;
use glam::DVec3;
use palpate_physics::{
    Precision, TetMesh,
    elements::{integration_points::IntegrationPoints, linear_tet::RestTet},
    kernels::ForceKernel,
    lanes::InstructionSet,
    material::{Convention, Lame, Law, Material, Viscosity},
};
use support::{Random, block, largest, largest_difference};

fn material(law: Law, nu: f64, viscous: bool) -> Material {
    let viscosity = if viscous { Viscosity::new(3.0, 5.0).unwrap() } else { Viscosity::default() };
    Material::new(law, Lame::from_young_poisson(10e3, nu).unwrap(), viscosity, Convention::Consistent)
}

struct Case {
    mesh: TetMesh,
    rest: Vec<RestTet>,
    tet_material: Vec<u16>,
    materials: Vec<Material>,
    /// Whether strain is averaged around edges and nodes.
    is_smoothed: bool,
    x: Vec<DVec3>,
    v: Vec<DVec3>,
}

impl Case {
    /// A jittered block of `materials` in random tets, turned by any angle, sheared and stretched by `strain`, with noise of
    /// `noise` of the cell, far from where it rests, moving.
    fn random(materials: Vec<Material>, strain: f64, noise: f64, random: &mut Random) -> Self {
        let h = 4e-3;
        let mesh = block([5, 4, 3], h, 0.15, random);
        let rest: Vec<RestTet> = (0..mesh.tets().len()).map(|t| RestTet::new(&mesh.edge_matrix_m(t))).collect();
        let tet_material = rest.iter().map(|_| (random.unit() * materials.len() as f64) as u16).collect();
        let turn = if strain + noise > 1e-3 { random.rotation() } else { glam::DMat3::IDENTITY };
        let gradient = turn + random.matrix() * strain;
        let rate = random.matrix() * 3.0;
        let move_m = DVec3::new(0.3, -0.1, 0.2);
        let x: Vec<DVec3> =
            mesh.positions_m().iter().map(|p| gradient * *p + move_m + random.vector() * (noise * h)).collect();
        let v = x.iter().map(|x| rate * *x + DVec3::new(0.5, 1.0, -1.0) + random.vector() * 1e-2).collect();
        Self { mesh, rest, tet_material, materials, is_smoothed: false, x, v }
    }

    fn kernel(&self, precision: Precision) -> ForceKernel {
        ForceKernel::build(&self.mesh, &self.points(), precision)
    }

    fn points(&self) -> IntegrationPoints {
        let Self { mesh, rest, tet_material, materials, .. } = self;
        let of_tets =
            if self.is_smoothed { IntegrationPoints::of_smoothed_tets } else { IntegrationPoints::of_linear_tets };
        of_tets(mesh, rest, tet_material, materials)
    }

    fn run(&self, kernel: &ForceKernel) -> (Vec<DVec3>, f64) {
        let mut forces = vec![DVec3::NAN; self.x.len()];
        let mut scratch = kernel.scratch();
        let power = kernel.forces_n(self.mesh.positions_m(), &self.x, &self.v, &mut forces, &mut scratch);
        let mut again = vec![DVec3::NAN; self.x.len()];
        let power_again = kernel.forces_n(self.mesh.positions_m(), &self.x, &self.v, &mut again, &mut scratch);
        assert_eq!(power.to_bits(), power_again.to_bits());
        assert!(forces.iter().zip(&again).all(|(a, b)| bits(*a) == bits(*b)), "a second run gave other bits");
        (forces, power)
    }

    fn oracle(&self) -> (Vec<DVec3>, f64) {
        let mut forces = vec![DVec3::NAN; self.x.len()];
        let power = self.points().forces_n(&self.x, &self.v, &mut forces);
        (forces, power)
    }

    /// Largest force (N) of a single tet on a corner: what rounding is relative to (nodal sums nearly cancel).
    fn largest_tet_force(&self) -> f64 {
        (0..self.rest.len())
            .map(|tet| {
                let nodes = self.mesh.tets()[tet];
                let material = &self.materials[self.tet_material[tet] as usize];
                let (x, v) = (nodes.map(|n| self.x[n as usize]), nodes.map(|n| self.v[n as usize]));
                largest(&self.rest[tet].forces_n(material, &x, &v))
            })
            .fold(0.0, f64::max)
    }

    /// Force (N) of a strain as small as rounding makes it, `(λ + 2µ) V |b| (ε |H| + ε₆₄ d |b|)`: the displacement gradient `H`,
    /// which is large in a turned body, is rounded by ε of the kernel, and positions at a distance d from the origin by ε₆₄.
    fn force_of_rounding(&self, precision: Precision) -> f64 {
        let epsilon = if precision == Precision::Single { f64::from(f32::EPSILON) } else { f64::EPSILON };
        let of_tet = |tet: usize| {
            let (rest, nodes) = (&self.rest[tet], self.mesh.tets()[tet]);
            let h = rest.gradient_of(&nodes.map(|n| self.x[n as usize])) - glam::DMat3::IDENTITY;
            let h_norm = h.to_cols_array().iter().map(|c| c * c).sum::<f64>().sqrt();
            let b = largest(&rest.gradients_per_m);
            let modulus = self.materials[self.tet_material[tet] as usize].lame.p_wave_modulus_pa();
            modulus * rest.volume_m3 * b * (epsilon * h_norm + f64::EPSILON * largest(&self.x) * b)
        };
        let of_tets = (0..self.rest.len()).map(of_tet).fold(0.0, f64::max);
        // Where tets of several materials meet, twice as many points meet at a node as tets do.
        if self.is_smoothed { 2.0 * of_tets.max(self.force_of_rounding_at_points(epsilon)) } else { of_tets }
    }

    /// Does the same for points with many nodes, `(λ + 2µ) V |b| Σ_i |b_i| (ε |u_i − u_0| + ε₆₄ d)`: each node's difference is
    /// rounded by itself.
    fn force_of_rounding_at_points(&self, epsilon: f64) -> f64 {
        let u: Vec<DVec3> = self.x.iter().zip(self.mesh.positions_m()).map(|(x, rest)| *x - *rest).collect();
        let far = largest(&self.x);
        let points = self.points();
        let of_points = points.iter().map(|point| {
            let first = u[point.nodes[0] as usize];
            let of_node = |(&node, b): (&u32, &DVec3)| {
                b.length() * (epsilon * (u[node as usize] - first).length() + f64::EPSILON * far)
            };
            let strain: f64 = point.nodes.iter().zip(point.gradients_per_m).map(of_node).sum();
            point.material.lame.p_wave_modulus_pa() * point.volume_m3 * largest(point.gradients_per_m) * strain
        });
        of_points.fold(0.0, f64::max)
    }
}

fn bits(a: DVec3) -> [u64; 3] {
    a.to_array().map(f64::to_bits)
}

/// Every law alone and all together, elastic and viscous, from tiny strain to crushed and inverted tets.
fn cases() -> Vec<(String, Case)> {
    let mut random = Random(3);
    let of_linear_tets = cases_of_linear_tets(&mut random);
    let smoothed = cases_of_linear_tets(&mut random).into_iter();
    let smoothed = smoothed.map(|(name, case)| (name + " smoothed", Case { is_smoothed: true, ..case }));
    of_linear_tets.into_iter().chain(smoothed).collect()
}

fn cases_of_linear_tets(random: &mut Random) -> Vec<(String, Case)> {
    let mut cases = Vec::new();
    for viscous in [false, true] {
        for nu in [0.0, 0.45, 0.49] {
            let mut sets: Vec<Vec<Material>> = Law::ALL.map(|law| vec![material(law, nu, viscous)]).to_vec();
            sets.push(Law::ALL.map(|law| material(law, nu, viscous)).to_vec());
            for set in sets {
                for (strain, noise) in [(1e-6, 0.0), (0.02, 0.01), (0.2, 0.1), (0.3, 0.6)] {
                    let name = format!("{set:?} strain {strain} noise {noise}");
                    cases.push((name, Case::random(set.clone(), strain, noise, random)));
                }
            }
        }
    }
    cases
}

/// Errors stay below 1e-5 (f32) and 1e-13 (f64) of the largest force of a tet, and four times what rounding makes.
#[test]
fn kernels_agree_with_the_oracle() {
    for (precision, tolerance) in [(Precision::Single, 1e-5), (Precision::Double, 1e-13)] {
        let (mut worst, mut worst_of_force) = (0.0_f64, 0.0_f64);
        for (name, case) in cases() {
            let (expected, expected_power) = case.oracle();
            let (forces, power) = case.run(&case.kernel(precision));
            let error = largest_difference(&forces, &expected);
            let allowed = tolerance * case.largest_tet_force() + 4.0 * case.force_of_rounding(precision);
            worst = worst.max(error / allowed);
            // At tiny strain the force itself is of the size of rounding.
            if !name.contains("strain 0.000001") {
                worst_of_force = worst_of_force.max(error / case.largest_tet_force());
            }
            println!("{:8.1e} {precision:?} {name}", error / allowed);
            assert!(error < allowed, "{precision:?} {name}: {error:e} of {allowed:e}");
            let close = (power - expected_power).abs() <= 10.0 * tolerance * expected_power;
            assert!(close, "{precision:?} {name}: {power} {expected_power}");
        }
        println!(
            "worst {precision:?} error {worst:.2} of what is allowed, {worst_of_force:.1e} of the largest force of a tet"
        );
    }
}

#[test]
fn every_instruction_set_gives_the_same_bits() {
    for (name, case) in cases() {
        for precision in [Precision::Single, Precision::Double] {
            let kernel = case.kernel(precision);
            let runs =
                InstructionSet::available().into_iter().map(|set| case.run(&kernel.clone().with_instruction_set(set)));
            let runs: Vec<_> = runs.collect();
            for other in &runs[1..] {
                assert_eq!(runs[0].1.to_bits(), other.1.to_bits(), "{name}");
                assert!(runs[0].0.iter().zip(&other.0).all(|(a, b)| bits(*a) == bits(*b)), "{precision:?} {name}");
            }
        }
    }
}

#[test]
fn forces_of_a_body_sum_to_nothing() {
    for (name, case) in cases() {
        let scale = case.largest_tet_force();
        for precision in [Precision::Single, Precision::Double] {
            let (forces, _) = case.run(&case.kernel(precision));
            let total = forces.iter().sum::<DVec3>().length();
            assert!(total < 1e-12 * scale, "{precision:?} {name}: {total:e} of {scale:e}");
        }
    }
}

/// Where everything is exactly at rest nothing pushes, not even rounding: a body at rest stays there, bit for bit.
#[test]
fn at_rest_the_force_is_exactly_zero() {
    let mut random = Random(5);
    for law in Law::ALL {
        let mut case = Case::random(vec![material(law, 0.45, true)], 0.0, 0.0, &mut random);
        case.x = case.mesh.positions_m().to_vec();
        case.v.fill(DVec3::ZERO);
        for is_smoothed in [false, true] {
            case.is_smoothed = is_smoothed;
            for precision in [Precision::Single, Precision::Double] {
                let (forces, power) = case.run(&case.kernel(precision));
                assert_eq!(largest(&forces), 0.0, "{law:?}");
                assert_eq!(power, 0.0);
            }
        }
    }
}

/// A node that is not finite spoils its own points and nothing else: the lanes beside them, and those of padding, are clean.
#[test]
fn a_bad_node_does_not_leak() {
    let mut random = Random(9);
    for (law, is_smoothed) in Law::ALL.into_iter().flat_map(|law| [(law, false), (law, true)]) {
        let random = Case::random(vec![material(law, 0.3, false)], 0.1, 0.05, &mut random);
        let mut case = Case { is_smoothed, ..random };
        let bad = case.x.len() - 1;
        let (good, _) = case.run(&case.kernel(Precision::Single));
        case.x[bad] = DVec3::splat(f64::NAN);
        let mut neighbour = vec![false; case.x.len()];
        for point in case.points().iter().filter(|point| point.nodes.contains(&(bad as u32))) {
            for &n in point.nodes {
                neighbour[n as usize] = true;
            }
        }
        let kernel = case.kernel(Precision::Single);
        let mut forces = vec![DVec3::ZERO; case.x.len()];
        kernel.forces_n(case.mesh.positions_m(), &case.x, &case.v, &mut forces, &mut kernel.scratch());
        for node in 0..forces.len() {
            if neighbour[node] {
                assert!(!forces[node].is_finite(), "{law:?}: NaN at node {bad} must show at {node}");
            } else {
                assert_eq!(bits(forces[node]), bits(good[node]), "{law:?} node {node}");
            }
        }
    }
}

/// Products with the tangent against the oracle's differentials: every law, both precisions, small and large strain and tets
/// turned inside out, with and without viscosity; and the same bits on every instruction set.
#[test]
fn products_agree_with_the_oracle() {
    let mut random = Random(31);
    for (law, is_smoothed) in Law::ALL.into_iter().flat_map(|law| [(law, false), (law, true)]) {
        for (strain, noise) in [(0.0, 1e-3), (0.2, 0.1), (0.3, 0.6)] {
            let materials = vec![material(law, 0.3, true), material(law, 0.45, false)];
            let case = Case { is_smoothed, ..Case::random(materials, strain, noise, &mut random) };
            let a: Vec<DVec3> = case.x.iter().map(|_| random.vector()).collect();
            let oracle = case.points();
            for factors in [[1.0, 0.0], [-2.0, 0.7]] {
                let mut expected = vec![DVec3::ZERO; a.len()];
                oracle.products_n(factors, &case.x, &a, &mut expected);
                for (precision, bound) in [(Precision::Double, 1e-11), (Precision::Single, 2e-5)] {
                    let products = |kernel: &ForceKernel| {
                        let mut scratch = kernel.scratch_for_products();
                        let mut found = vec![DVec3::NAN; a.len()];
                        kernel.linearise_at(case.mesh.positions_m(), &case.x, &mut scratch);
                        kernel.products_n(factors, &a, &mut found, &mut scratch);
                        found
                    };
                    let found = products(&case.kernel(precision));
                    let error = largest_difference(&found, &expected) / largest(&expected);
                    assert!(error < bound, "{law:?} {precision:?} strain {strain} noise {noise}: {error:e}");
                    for set in InstructionSet::available() {
                        let again = products(&case.kernel(precision).with_instruction_set(set));
                        assert!(found.iter().zip(&again).all(|(a, b)| bits(*a) == bits(*b)), "{law:?} {set:?}");
                    }
                }
            }
        }
    }
}
