//! Newton's method for a hybrid body at one stage, its linear systems by preconditioned conjugate gradients.
//!
//! `K d = f` is solved until conjugate gradients find a direction in which `K` is not positive, or to a thousandth;
//! either is a descent of the potential, along which a step is sought as for bodies of tets (`statics::newton`).
use super::{
    awakened::Awakened,
    stage::{Forces, Line, Outer, Stage},
};
use crate::{
    linalg::pcg::{self, PcgScratch, Stop as EnoughOf},
    statics::{
        Progress, SolveError, StaticSettings,
        equilibrium::{Goal, dot},
        newton::{Failure, Stop, search},
    },
};
use glam::{BVec3, DMat3, DVec3};
use std::ops::ControlFlow;

/// Largest number of products in a linear system.
const MOST_PRODUCTS: u32 = 20_000;
/// Residual, over the right side, to which each linear system is solved.
const LINEAR_TOLERANCE: f64 = 1e-3;
/// Residual to which a right side of random numbers is solved before a tangent counts as positive definite.
const STABLE_TOLERANCE: f64 = 1e-6;

pub(super) struct Solver<'a> {
    pub(super) settings: &'a StaticSettings,
    pub(super) history: Vec<Progress>,
    pub(super) linear_systems: u32,
    pub(super) progress: &'a mut dyn FnMut(&Progress) -> ControlFlow<()>,
}

/// `ε ‖diag K‖₂ max|q|` (N), nodes and particles at rest: an entry known to `ε|q|` has a force known to `ε |q| K_ii`.
/// (A node that nearly nothing holds may be found anywhere; what it has to do with forces is as little.)
pub(super) fn rounding_n(awakened: &Awakened<'_>, unknowns: &[DVec3]) -> f64 {
    let environment = awakened.environment;
    let springs = (0..environment.tools.len()).filter_map(|tool| environment.contact.spring(tool));
    let springs_sq: f64 = springs.map(|spring| 3.0 * spring.stiffness_n_per_m.powi(2)).sum();
    let along = |(block, free): (&DMat3, &BVec3)| {
        DVec3::select(*free, DVec3::new(block.x_axis.x, block.y_axis.y, block.z_axis.z), DVec3::ZERO).length_squared()
    };
    let of_body: f64 = awakened.diagonal_n_per_m.iter().zip(&awakened.free).map(along).sum();
    let places = awakened.rest_m.iter().chain(&unknowns[awakened.entries()..]);
    f64::EPSILON * (of_body + springs_sq).sqrt() * places.map(|x| x.length()).fold(0.0, f64::max)
}

impl Solver<'_> {
    /// Finds the equilibrium of a stage by Newton's method, from the given unknowns.
    pub(super) fn equilibrate(
        &mut self,
        awakened: &Awakened<'_>,
        goal: &Goal<'_>,
        stage: &Stage,
        mut unknowns: Vec<DVec3>,
    ) -> Result<Vec<DVec3>, Stop> {
        self.move_prescribed(awakened, goal, stage, &mut unknowns);
        for iteration in 0..=self.settings.max_iterations {
            let forces = stage.forces(awakened, &unknowns);
            let (residual, residual_n, relative_residual) = forces.residual(awakened);
            if !(residual_n.is_finite() && relative_residual.is_finite()) {
                return Err(Stop::Step(Failure::NotFinite { node: worst_entry(&forces) }));
            }
            let progress = Progress { load_fraction: stage.fraction, iteration, residual_n, relative_residual };
            self.history.push(progress);
            if (self.progress)(&progress).is_break() {
                return Err(Stop::Final(SolveError::Cancelled { load_fraction: stage.fraction }));
            }
            if relative_residual <= self.settings.relative_residual || residual_n <= rounding_n(awakened, &unknowns) {
                return Ok(unknowns);
            }
            if iteration == self.settings.max_iterations {
                return Err(Stop::Step(Failure::Iterations { relative_residual }));
            }
            let outer = stage.outer(awakened, &unknowns);
            let d = self.direction(awakened, &outer, &unknowns, &residual);
            let Some(next) = descend(awakened, stage, &unknowns, &d, &residual) else {
                return Err(Stop::Step(Failure::LineSearch { relative_residual }));
            };
            unknowns = next;
        }
        Ok(unknowns)
    }

    /// Solves `K d = f`.
    fn direction(&mut self, awakened: &Awakened<'_>, outer: &Outer, unknowns: &[DVec3], f: &[DVec3]) -> Vec<DVec3> {
        let stop = EnoughOf { iterations: MOST_PRODUCTS, tolerance: LINEAR_TOLERANCE };
        self.linear_systems += 1;
        linear(awakened, outer, unknowns, f, stop).0
    }

    /// Moves prescribed axes to where they are prescribed, by `δ`, and free ones along by one linear system:
    /// `K d = f + (∂f/∂x) δ`.
    fn move_prescribed(&mut self, awakened: &Awakened<'_>, goal: &Goal<'_>, stage: &Stage, unknowns: &mut [DVec3]) {
        let environment = awakened.environment;
        let mut moves = vec![DVec3::ZERO; unknowns.len()];
        for (set, displacement) in environment.prescribed.iter().zip(goal.prescribed_displacements_m) {
            for node in set.nodes.iter().map(|&n| n as usize) {
                for axis in (0..3).filter(|&axis| set.axes[axis]) {
                    let wanted_m = awakened.body.rest_positions_m()[node][axis] + displacement[axis] * stage.fraction;
                    moves[node][axis] = wanted_m - unknowns[node][axis];
                }
            }
        }
        if moves.iter().all(|d| *d == DVec3::ZERO) {
            return;
        }
        let carried = awakened.elastic_change_n(unknowns, &moves);
        let total = stage.forces(awakened, unknowns).total_n();
        let total = total.iter().zip(&carried).zip(&awakened.free);
        let f: Vec<DVec3> = total.map(|((a, b), free)| DVec3::select(*free, *a + *b, DVec3::ZERO)).collect();
        let d = self.direction(awakened, &stage.outer(awakened, unknowns), unknowns, &f);
        let part = longest_step(awakened, &d);
        for ((x, moved), d) in unknowns.iter_mut().zip(&moves).zip(d) {
            *x += *moved + d * part;
        }
    }

    /// Returns whether the tangent is positive definite.
    ///
    /// As long as conjugate gradients have met no direction of curvature below zero, the polynomial of their residual
    /// has positive roots and is one at zero, hence at least one below: a residual never gets smaller than what the
    /// right side had of an eigenvector with a negative eigenvalue. So a residual of `1e-6`, of a right side that has
    /// some of every eigenvector, tells that there is none.
    pub(super) fn is_stable(awakened: &Awakened<'_>, stage: &Stage, unknowns: &[DVec3]) -> bool {
        let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
        let mut random = || {
            // xorshift64 (Marsaglia 2003)
            seed ^= seed << 13;
            seed ^= seed >> 7;
            seed ^= seed << 17;
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let mut component = |free: &BVec3| DVec3::select(*free, DVec3::new(random(), random(), random()), DVec3::ZERO);
        let f: Vec<DVec3> = awakened.free.iter().map(&mut component).collect();
        let stop = EnoughOf { iterations: MOST_PRODUCTS, tolerance: STABLE_TOLERANCE };
        let (_, products, found_negative) = linear(awakened, &stage.outer(awakened, unknowns), unknowns, &f, stop);
        products < MOST_PRODUCTS && !found_negative
    }
}

/// Solves with the tangent; returns the solution, how many products it took, and whether one had no positive
/// curvature.
fn linear(
    awakened: &Awakened<'_>,
    outer: &Outer,
    unknowns: &[DVec3],
    f: &[DVec3],
    stop: EnoughOf,
) -> (Vec<DVec3>, u32, bool) {
    let mut blocks = awakened.diagonal_n_per_m.clone();
    blocks.resize(unknowns.len(), DMat3::ZERO);
    let elastic = blocks.clone();
    outer.add_diagonal_n_per_m(&mut blocks);
    let of = |((block, elastic), free): ((&DMat3, &DMat3), &BVec3)| inverse_of(block, elastic, *free);
    let inverse: Vec<DMat3> = blocks.iter().zip(&elastic).zip(&awakened.free).map(of).collect();
    let mut scratch = PcgScratch::new(unknowns.len());
    scratch.residual.copy_from_slice(f);
    let mut found_negative = false;
    let apply = |a: &[DVec3], out: &mut [DVec3]| {
        for (out, change) in out.iter_mut().zip(awakened.elastic_change_n(unknowns, a)) {
            *out = -change;
        }
        outer.add_products_n(a, out);
        for (out, free) in out.iter_mut().zip(&awakened.free) {
            *out = DVec3::select(*free, *out, DVec3::ZERO);
        }
        found_negative |= dot(a, out) <= 0.0;
    };
    let products = pcg::solve(apply, &inverse, stop, &mut scratch);
    (scratch.solution, products, found_negative)
}

/// Returns the inverse of a diagonal block over the free axes, that of the body alone where contact leaves it not
/// positive, the identity where there is none.
fn inverse_of(block: &DMat3, elastic: &DMat3, free: BVec3) -> DMat3 {
    let kept = DMat3::from_diagonal(DVec3::select(free, DVec3::ONE, DVec3::ZERO));
    let of_free = |a: &DMat3| kept * *a * kept + (DMat3::IDENTITY - kept);
    let is_positive = |a: &DMat3| {
        let minor = a.x_axis.x * a.y_axis.y - a.x_axis.y * a.y_axis.x;
        a.x_axis.x > 0.0 && minor > 0.0 && a.determinant() > 0.0
    };
    let mut usable = [block, elastic].into_iter().map(of_free).filter(is_positive);
    usable.next().map_or(DMat3::IDENTITY, |a| a.inverse())
}

/// Takes one step along a direction; returns `None` when no length of it is acceptable.
fn descend(
    awakened: &Awakened<'_>,
    stage: &Stage,
    unknowns: &[DVec3],
    d: &[DVec3],
    residual: &[DVec3],
) -> Option<Vec<DVec3>> {
    let slope = -dot(d, residual);
    // Written so that a NaN fails.
    if !(slope < 0.0 && slope.is_finite()) {
        return None;
    }
    let line = Line::new(awakened, stage, unknowns, d);
    let change = |alpha: f64| line.potential_change_j(alpha);
    let slope_at = |alpha: f64| -dot(&stage.forces(awakened, &line.at(alpha)).total_n(), d);
    search(longest_step(awakened, d), slope, change, slope_at).map(|alpha| line.at(alpha))
}

/// Returns the fraction of a motion in which no coupled tool moves further than a quarter of its radius: contact is not
/// known further ahead.
fn longest_step(awakened: &Awakened<'_>, d: &[DVec3]) -> f64 {
    let tools = awakened.environment.tools.iter().zip(&d[awakened.entries()..]);
    tools.map(|(tool, d)| 0.25 * tool.radius_m / d.length().max(f64::MIN_POSITIVE)).fold(1.0, f64::min)
}

fn worst_entry(forces: &Forces) -> u32 {
    let total = forces.total_n();
    let by_size = |a: &usize, b: &usize| total[*a].abs().max_element().total_cmp(&total[*b].abs().max_element());
    (0..total.len()).max_by(by_size).unwrap_or(0) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bodies::{
            BodySpec,
            hybrid::{
                HybridSpec, ParticleSpec, Skin, Waking,
                sites::CORNERS,
                testing::{slab, tissue},
            },
        },
        contact::RestingContact,
        elements::solid::{Region, Solid},
        material::{Lame, Material},
        settings::{PrescribedSpec, Settings},
        world::{Model, ModelSpec},
    };

    /// StVK pressed evenly to a stretch s bears `½ E (s³ − s)`, less the more it is pressed beyond s = 1/√3: one half
    /// of a block then gives way to the other.
    #[test]
    fn a_tangent_that_is_not_positive_is_told() {
        let mesh = slab();
        let corners = CORNERS.map(|corner| corner * DVec3::new(0.08, 0.08, 0.04)).to_vec();
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let held = |name: &str, z: f64| {
            let nodes = (0..mesh.positions_m().len() as u32).filter(|&n| mesh.positions_m()[n as usize].z == z);
            PrescribedSpec { name: name.into(), nodes: nodes.collect(), axes: [true; 3], is_fixed: false }
        };
        let lame = Lame::from_young_poisson(10e3, 0.0).unwrap();
        let mut spec = ModelSpec {
            prescribed: vec![held("below", 0.0), held("above", 0.04)],
            body: BodySpec::Hybrid(HybridSpec {
                coarse: Solid {
                    tet_region: vec![0; mesh.tets().len()],
                    regions: vec![Region {
                        name: "all".into(),
                        material: Material { lame, ..tissue()[0] },
                        density_kg_per_m3: 1000.0,
                    }],
                    mesh: slab(),
                },
                particles: ParticleSpec {
                    skin: Skin::new(corners, triangles).unwrap(),
                    spacing_m: 5e-3,
                    fine_depth_m: None,
                    smooth_skin: false,
                    lattice_through_m: DVec3::ZERO,
                    most_active: 300,
                    waking: Waking::ByHand,
                },
            }),
            loads: Vec::new(),
            gravity_m_per_s2: DVec3::ZERO,
            tools: Vec::new(),
            settings: Settings::for_particles(),
        };
        spec.settings.long_coarse_steps = false;
        let model = Model::build(spec).unwrap();
        let body = model.body().as_hybrid().unwrap();
        let mut awake = Vec::new();
        body.partition().particles_within(DVec3::new(0.04, 0.04, 0.02), 0.015, |particle, _| awake.push(particle));
        awake.sort_unstable();
        for ids in [vec![], awake] {
            let awakened = Awakened::new(model.environment(), body, &ids);
            let goal = Goal::default();
            let contact = RestingContact::appear(model.contact(), &awakened.configuration(&awakened.at_rest()));
            for (stretch, stable) in [(1.0, true), (0.8, true), (0.5, false)] {
                let unknowns: Vec<DVec3> =
                    awakened.at_rest().iter().map(|x| *x * DVec3::new(1.0, 1.0, stretch)).collect();
                let (stage, unknowns) = Stage::enter(&awakened, &goal, 1.0, &unknowns, &contact);
                assert_eq!(Solver::is_stable(&awakened, &stage, &unknowns), stable, "{} awake, {stretch}", ids.len());
            }
        }
    }
}
