//! Static equilibrium of what is awake and the coarse tets around it: Newton's method, its linear systems by conjugate gradients.
//!
//! The server has a solver of its own (`palpate_physics::statics`), of bodies with tools and materials that awake particles follow; this one knows any fine level.
use super::level::FineLevel;
use glam::{BVec3, DMat3, DVec3};
use palpate_physics::{
    bodies::hybrid::{
        partition::Partition,
        patch::{Field, Materials},
    },
    linalg::pcg::{self, PcgScratch, Stop},
};
use thiserror::Error;

/// Most steps of Newton's method.
const MOST_STEPS: u32 = 30;
/// Most products in one.
const MOST_PRODUCTS: u32 = 5_000;
/// Each linear system is solved to this.
const LINEAR_TOLERANCE: f64 = 1e-3;
/// Halvings of a step that makes the residual larger.
const MOST_HALVINGS: u32 = 10;

/// No equilibrium was found.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("no equilibrium: relative residual {relative_residual:.2e} after {steps} steps of Newton's method")]
pub(super) struct NoEquilibrium {
    /// What is left of the load.
    relative_residual: f64,
    /// Steps taken.
    steps: u32,
}

/// From the body at rest to where its forces balance dead `loads_n` (N) to `tolerance` of them; `free` tells along which axes coarse nodes
/// may move.
///
/// # Errors
/// Where Newton's method does not get there.
pub(super) fn equilibrium(
    partition: &Partition,
    level: &dyn FineLevel,
    materials: &Materials<'_>,
    free: &[BVec3],
    loads_n: &Field,
    tolerance: f64,
) -> Result<Field, NoEquilibrium> {
    let mut at = level.at_rest(partition);
    let count = at.nodes.len();
    let held = |list: &mut [DVec3]| {
        for (value, free) in list.iter_mut().zip(free) {
            *value = DVec3::select(*free, *value, DVec3::ZERO);
        }
    };
    let residual = |at: &Field| {
        let internal = level.elastic_forces_n(materials, at);
        let pairs = internal.nodes.iter().zip(&loads_n.nodes).chain(internal.particles.iter().zip(&loads_n.particles));
        let mut residual: Vec<DVec3> = pairs.map(|(f, load)| *f + *load).collect();
        held(&mut residual);
        residual
    };
    let size = |list: &[DVec3]| list.iter().map(|f| f.length_squared()).sum::<f64>().sqrt();
    let inverse_blocks: Vec<DMat3> = level.diagonal_n_per_m(materials, count).iter().map(DMat3::inverse).collect();
    let mut scratch = PcgScratch::new(count + at.particles.len());
    let mut left = residual(&at);
    let load = size(&left);
    for _ in 0..MOST_STEPS {
        if size(&left) <= tolerance * load {
            return Ok(at);
        }
        scratch.residual.copy_from_slice(&left);
        let stop = Stop { iterations: MOST_PRODUCTS, tolerance: LINEAR_TOLERANCE };
        let apply = |a: &[DVec3], out: &mut [DVec3]| {
            let direction = Field { nodes: a[..count].to_vec(), particles: a[count..].to_vec() };
            let product = level.products_n(materials, &at, &direction);
            for (out, product) in out.iter_mut().zip(product.nodes.iter().chain(&product.particles)) {
                *out = -*product;
            }
            held(out);
        };
        pcg::solve(apply, &inverse_blocks, stop, &mut scratch);
        let moved = |scale: f64| {
            let mut next = at.clone();
            for (x, step) in next.nodes.iter_mut().chain(&mut next.particles).zip(&scratch.solution) {
                *x += *step * scale;
            }
            next
        };
        let (mut scale, mut next) = (1.0, moved(1.0));
        let mut then = residual(&next);
        for _ in 0..MOST_HALVINGS {
            if size(&then) < size(&left) {
                break;
            }
            scale *= 0.5;
            next = moved(scale);
            then = residual(&next);
        }
        (at, left) = (next, then);
    }
    Err(NoEquilibrium { relative_residual: size(&left) / load, steps: MOST_STEPS })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        fine_levels::{level::still, places},
        methods::{nearest, particles},
        problems::{self, load},
    };
    use palpate_physics::{
        BodySpec, LoadSpec, Model, ModelSpec, Region, Settings, Solid,
        bodies::hybrid::{HybridSpec, patch::Patch, trilinear_point::TrilinearPoint},
        statics::{Goal, StaticSettings, solve_static},
    };
    use std::{collections::BTreeSet, ops::ControlFlow};

    /// The block under the small patch with 140 particles awake: a patch and its loads by themselves, and the body as the server has it.
    #[test]
    fn a_patch_and_its_loads_rest_where_the_server_has_the_body() {
        let problem = problems::all().into_iter().find(|p| p.name == "block-patch-small-nu0.45").unwrap();
        let (coarse, fine) = (problem.body.tets(4).unwrap(), problem.body.tets(16).unwrap());
        let vertex = |node: u32| fine.surface.vertex_of_node[node as usize];
        let load = load::on_tets(problem.action, &fine).unwrap();
        let forces: Vec<(u32, DVec3)> = load.forces_n.iter().map(|&(node, force_n)| (vertex(node), force_n)).collect();
        let model = Model::build(ModelSpec {
            body: BodySpec::Hybrid(HybridSpec {
                particles: particles(problem.body, &fine, 5e-3, 140).unwrap(),
                coarse: Solid {
                    regions: vec![Region {
                        name: "body".into(),
                        material: problem.material().unwrap(),
                        density_kg_per_m3: 1000.0,
                    }],
                    tet_region: vec![0; coarse.mesh.tets().len()],
                    mesh: coarse.mesh,
                },
            }),
            prescribed: coarse.prescribed,
            loads: vec![LoadSpec::NodalForces(forces.clone())],
            gravity_m_per_s2: DVec3::ZERO,
            tools: vec![],
            settings: Settings::for_particles(),
        })
        .unwrap();
        let awake = nearest(&model, fine.touch_m, 140);
        let settings = StaticSettings { relative_residual: 1e-12, ..StaticSettings::default() };
        let held = vec![DVec3::ZERO; model.prescribed().len()];
        let goal =
            Goal { load_factors: &[1.0], prescribed_displacements_m: &held, awake: Some(&awake), ..Goal::default() };
        let of_server = solve_static(&model, &goal, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
        let mut expected = Vec::new();
        model.surface_positions_m(&of_server.state(&model, &[1.0]), &mut expected);

        let body = model.body().as_hybrid().unwrap();
        let (partition, active) = (body.partition(), awake.into_iter().collect::<BTreeSet<u32>>());
        assert!(of_server.awake.ids.iter().eq(&active));
        let patch = Patch::new(partition, &active);
        let rest = model.surface_rest_positions_m();
        let place = |vertex: usize| TrilinearPoint::new(partition, rest[vertex]);
        let mut loads_n = still(&FineLevel::at_rest(&patch, partition));
        for &(vertex, force_n) in &forces {
            places::push(&place(vertex as usize), partition, patch.active(), force_n, &mut loads_n);
        }
        let found = equilibrium(partition, &patch, &body.materials(), body.free(), &loads_n, 1e-10).unwrap();
        let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
        for (vertex, expected) in expected.iter().enumerate() {
            let at = places::value(&place(vertex), partition, patch.active(), &found);
            worst = worst.max(at.distance(*expected));
            largest = largest.max(expected.distance(rest[vertex]));
        }
        assert!(largest > 2e-4 && worst < 1e-8 * largest, "{worst:e} of {largest:e}");
    }
}
