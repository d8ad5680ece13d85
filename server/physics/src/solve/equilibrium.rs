//! What equilibrium balances: forces at a fraction of the goal, and the change of potential along a line.
use super::{SolveError, follower, stiffness::FreeAxes};
use crate::{
    contact::{RestingContact, ToolTarget},
    fem::{element::RestTet, loads},
    world::{LoadSpec, Model},
};
use glam::DVec3;

/// Loads, displacements and tools to be reached.
#[derive(Debug, Clone, Copy)]
pub(super) struct Goal<'a> {
    pub(super) load_factors: &'a [f64],
    pub(super) prescribed_displacements_m: &'a [DVec3],
    pub(super) tools: &'a [ToolTarget],
}

/// The goal scaled to a fraction of the way.
#[derive(Debug, Clone)]
pub(super) struct Stage {
    pub(super) fraction: f64,
    pub(super) load_factors: Vec<f64>,
    /// Gravity and dead loads (N): the same at every position.
    dead_n: Vec<DVec3>,
    pub(super) contact: RestingContact,
}

impl Stage {
    /// The stage entered with the body at `x` and contact as it was `before`.
    pub(super) fn new(
        model: &Model,
        goal: &Goal<'_>,
        fraction: f64,
        x: &[DVec3],
        before: Option<&RestingContact>,
    ) -> Self {
        let load_factors: Vec<f64> = goal.load_factors.iter().map(|factor| factor * fraction).collect();
        let gravity = model.gravity_m_per_s2() * fraction;
        let mut dead_n: Vec<DVec3> = model.mass_kg().iter().map(|mass| gravity * *mass).collect();
        for (load, &factor) in model.spec().loads.iter().zip(&load_factors) {
            let follows = matches!(load, LoadSpec::Pressure { follower: true, .. });
            if factor != 0.0 && !follows {
                let rest = model.rest_positions_m();
                loads::add_load_n(load, factor, model.surface(), (rest, rest), &mut dead_n);
            }
        }
        let start = model.spec().tools.iter().map(|tool| tool.start_position_m);
        let centres = start.zip(goal.tools).map(|(start, tool)| start.lerp(tool.position_m, fraction)).collect();
        let contact = RestingContact::arrive(model.contact(), centres, x, before);
        Self { fraction, load_factors, dead_n, contact }
    }

    /// Where prescribed axes are to be, the rest as in `x`.
    pub(super) fn prescribed(&self, model: &Model, goal: &Goal<'_>, x: &[DVec3]) -> Vec<DVec3> {
        let mut wanted = x.to_vec();
        for (set, displacement) in model.spec().prescribed.iter().zip(goal.prescribed_displacements_m) {
            for node in set.nodes.iter().map(|&n| n as usize) {
                let rest = model.rest_positions_m()[node];
                for axis in (0..3).filter(|&axis| set.axes[axis]) {
                    wanted[node][axis] = rest[axis] + displacement[axis] * self.fraction;
                }
            }
        }
        wanted
    }
}

/// Nodal forces (N) at a position.
#[derive(Debug, Clone)]
pub(super) struct Forces {
    /// Elastic.
    pub(super) internal_n: Vec<DVec3>,
    /// Gravity, loads, contact.
    pub(super) external_n: Vec<DVec3>,
    /// Of the body on the tools (N).
    pub(super) on_tools: Vec<DVec3>,
}

impl Forces {
    pub(super) fn at(model: &Model, stage: &Stage, x: &[DVec3]) -> Self {
        let mut external_n = stage.dead_n.clone();
        for (triangles, pressure_pa) in follower::active(model, &stage.load_factors) {
            loads::add_pressure_n(model.surface(), triangles, pressure_pa, x, &mut external_n);
        }
        let on_tools = stage.contact.add_forces_n(model.contact(), x, &mut external_n);
        Self { internal_n: elastic_n(model, x), external_n, on_tools }
    }

    /// Total force on the free axes.
    pub(super) fn free(&self, axes: &FreeAxes) -> Vec<f64> {
        let mut free = vec![0.0; axes.count];
        axes.gather(&self.total_n(), &mut free);
        free
    }

    pub(super) fn total_n(&self) -> Vec<DVec3> {
        self.internal_n.iter().zip(&self.external_n).map(|(a, b)| *a + *b).collect()
    }

    /// `max(‖f_internal‖₂, ‖f_external‖₂)` (N), prescribed axes included.
    pub(super) fn reference_n(&self) -> f64 {
        norm(&self.internal_n).max(norm(&self.external_n))
    }

    pub(super) fn check_finite(&self, stage: &Stage) -> Result<(), SolveError> {
        match self.total_n().iter().position(|f| !f.is_finite()) {
            Some(node) => Err(SolveError::NonFinite { node: node as u32, load_fraction: stage.fraction }),
            None => Ok(()),
        }
    }
}

fn norm(nodal: &[DVec3]) -> f64 {
    nodal.iter().map(|v| v.length_squared()).sum::<f64>().sqrt()
}

/// Elastic nodal forces (N), element by element in f64.
fn elastic_n(model: &Model, x: &[DVec3]) -> Vec<DVec3> {
    let mut forces = vec![DVec3::ZERO; x.len()];
    for (tet, nodes) in model.mesh().tets().iter().enumerate() {
        let rest = &model.rest_tets()[tet];
        let f = rest.gradient_of(&nodes.map(|n| x[n as usize]));
        let corner = rest.corner_forces_n(&model.material_of(tet).piola(&f));
        for (node, force) in nodes.iter().zip(corner) {
            forces[*node as usize] += force;
        }
    }
    forces
}

/// Elastic energy (J) of every tet.
fn elastic_j(model: &Model, x: &[DVec3]) -> Vec<f64> {
    (0..model.rest_tets().len())
        .map(|tet| {
            let corners = model.mesh().tets()[tet].map(|n| x[n as usize]);
            model.rest_tets()[tet].energy_j(model.material_of(tet), &corners)
        })
        .collect()
}

/// The line `x + αd`, and the potential along it.
pub(super) struct Line<'a> {
    model: &'a Model,
    stage: &'a Stage,
    x: &'a [DVec3],
    d: &'a [DVec3],
    elastic_j: Vec<f64>,
    contact_j: f64,
    /// `Σ V (λ + 2µ)` (J): the terms that cancel in `Ψ` are of this size, however small the strain.
    cancelling_j: f64,
    dead_slope_w: f64,
}

impl<'a> Line<'a> {
    pub(super) fn new(model: &'a Model, stage: &'a Stage, x: &'a [DVec3], d: &'a [DVec3]) -> Self {
        let elastic_j = elastic_j(model, x);
        let modulus = |(tet, rest): (usize, &RestTet)| rest.volume_m3 * model.material_of(tet).lame.p_wave_modulus_pa();
        let cancelling_j = model.rest_tets().iter().enumerate().map(modulus).sum();
        let contact_j = stage.contact.potential_j(model.contact(), x);
        Self { model, stage, x, d, elastic_j, contact_j, cancelling_j, dead_slope_w: dot(&stage.dead_n, d) }
    }

    pub(super) fn at(&self, alpha: f64) -> Vec<DVec3> {
        self.x.iter().zip(self.d).map(|(x, d)| *x + *d * alpha).collect()
    }

    /// Change of potential (J) from 0 to `alpha`, and the size of the rounding in it:
    /// `ΔΠ = Σ V ΔΨ + ΔΦ_contact − α (m g + f_dead)·d − ∫₀^α f_follower(x + td)·d dt`.
    ///
    /// A follower pressure need not have a potential, but its work along a straight line is a number: the integrand is
    /// quadratic in `t`, so Simpson's rule gives it exactly, and `dΔΠ/dα = −f·d` holds for all loads.
    pub(super) fn potential_change_j(&self, alpha: f64) -> (f64, f64) {
        let x = self.at(alpha);
        let after = elastic_j(self.model, &x);
        let contact = self.stage.contact.potential_j(self.model.contact(), &x) - self.contact_j;
        let elastic: f64 = after.iter().zip(&self.elastic_j).map(|(b, a)| b - a).sum();
        let size: f64 = after.iter().zip(&self.elastic_j).map(|(b, a)| b.abs() + a.abs()).sum();
        let follower_work = if follower::active(self.model, &self.stage.load_factors).next().is_some() {
            let power = |t: f64| self.follower_power(t);
            alpha / 6.0 * (power(0.0) + 4.0 * power(0.5 * alpha) + power(alpha))
        } else {
            0.0
        };
        let dead_work = alpha * self.dead_slope_w;
        let terms = self.cancelling_j + size + self.contact_j + dead_work.abs() + follower_work.abs();
        (elastic + contact - dead_work - follower_work, f64::EPSILON * terms)
    }

    fn follower_power(&self, t: f64) -> f64 {
        let mut forces = vec![DVec3::ZERO; self.x.len()];
        let x = self.at(t);
        for (triangles, pressure_pa) in follower::active(self.model, &self.stage.load_factors) {
            loads::add_pressure_n(self.model.surface(), triangles, pressure_pa, &x, &mut forces);
        }
        dot(&forces, self.d)
    }
}

pub(super) fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}
