//! What equilibrium balances: forces at a fraction of the goal, and the change of potential along a line.
use super::{ToolAtRest, follower, tet_model::TetModel};
use crate::{
    contact::{Pressing, RestingContact, SaturatingSpring, ToolTarget},
    elements::{free_axes::FreeAxes, integration_points::IntegrationPoint, loads},
    settings::LoadSpec,
};
use glam::{DMat3, DVec3};

/// Loads, displacements and tools to be reached.
#[derive(Debug, Clone, Copy, Default)]
pub struct Goal<'a> {
    /// One factor per load of the model.
    pub load_factors: &'a [f64],
    /// One displacement (m) per prescribed set of the model.
    pub prescribed_displacements_m: &'a [DVec3],
    /// Where the devices are, one per tool of the model.
    pub tools: &'a [ToolTarget],
    /// Of a hybrid body: these particles are awake and no others, those left out that may not wake. `None`: those are awake that tools
    /// would keep awake where they rest, and those as near to vertices that a load acts on. Other bodies do not look at it.
    pub awake: Option<&'a [u32]>,
}

/// The goal scaled to a fraction of the way.
///
/// What is sought is a *configuration*: the positions of all nodes, then the centres of all tools. A rigid tool's is given, as
/// a prescribed axis is; a coupled one rests where its spring balances its contact.
#[derive(Debug, Clone)]
pub(super) struct Stage {
    pub(super) fraction: f64,
    pub(super) load_factors: Vec<f64>,
    /// Gravity and dead loads (N): the same at every position.
    dead_n: Vec<DVec3>,
    /// Where the tools' devices are (m).
    devices_m: Vec<DVec3>,
    pub(super) contact: RestingContact,
}

impl Stage {
    /// The stage entered from the configuration `before`, with contact as it was there; and the configuration to begin with.
    pub(super) fn enter(
        model: TetModel<'_>,
        goal: &Goal<'_>,
        fraction: f64,
        before: &[DVec3],
        contact: &RestingContact,
    ) -> (Self, Vec<DVec3>) {
        let load_factors: Vec<f64> = goal.load_factors.iter().map(|factor| factor * fraction).collect();
        let gravity = model.environment.gravity_m_per_s2 * fraction;
        let mut dead_n: Vec<DVec3> = model.body.mass_kg().iter().map(|mass| gravity * *mass).collect();
        dead_n.resize(before.len(), DVec3::ZERO);
        for (load, &factor) in model.environment.loads.iter().zip(&load_factors) {
            let follows = matches!(load, LoadSpec::Pressure { follower: true, .. });
            if factor != 0.0 && !follows {
                let rest = model.body.rest_positions_m();
                let at = loads::LoadPositions { rest_m: rest, deformed_m: rest };
                loads::add_load_n(load, factor, &model.environment.surface, at, &mut dead_n);
            }
        }
        let start = model.environment.tools.iter().map(|tool| tool.start_position_m);
        let devices_m: Vec<DVec3> = start.zip(goal.tools).map(|(s, tool)| s.lerp(tool.position_m, fraction)).collect();
        let mut begin = before.to_vec();
        for (tool, device) in devices_m.iter().enumerate() {
            if model.environment.contact.spring(tool).is_none() {
                begin[model.body.mass_kg().len() + tool] = *device;
            }
        }
        let contact = contact.arrive(&model.environment.contact, before, &begin);
        (Self { fraction, load_factors, dead_n, devices_m, contact }, begin)
    }

    /// Where prescribed axes are to be, the rest as in the configuration.
    pub(super) fn prescribed(&self, model: TetModel<'_>, goal: &Goal<'_>, configuration: &[DVec3]) -> Vec<DVec3> {
        let mut wanted = configuration.to_vec();
        for (set, displacement) in model.environment.prescribed.iter().zip(goal.prescribed_displacements_m) {
            for node in set.nodes.iter().map(|&n| n as usize) {
                let rest = model.body.rest_positions_m()[node];
                for axis in (0..3).filter(|&axis| set.axes[axis]) {
                    wanted[node][axis] = rest[axis] + displacement[axis] * self.fraction;
                }
            }
        }
        wanted
    }

    /// Coupled tools: index in the configuration, spring and its stretch `d − c` (m).
    fn springs<'a>(
        &'a self,
        model: TetModel<'a>,
        configuration: &'a [DVec3],
    ) -> impl Iterator<Item = (usize, SaturatingSpring, DVec3)> + 'a {
        let nodes = model.body.mass_kg().len();
        self.devices_m.iter().enumerate().filter_map(move |(tool, device)| {
            let spring = model.environment.contact.spring(tool)?;
            Some((nodes + tool, spring, *device - configuration[nodes + tool]))
        })
    }

    /// Calls `add(i, j, block)` with the stiffness (N/m) of contact and couplings; see [`RestingContact::for_each_block`].
    pub(super) fn for_each_block(
        &self,
        model: TetModel<'_>,
        configuration: &[DVec3],
        definite: bool,
        mut add: impl FnMut(u32, u32, &DMat3),
    ) {
        self.contact.for_each_block(&model.environment.contact, configuration, definite, &mut add);
        for (index, spring, stretch_m) in self.springs(model, configuration) {
            add(index as u32, index as u32, &spring.hessian_n_per_m(stretch_m, definite));
        }
    }

    /// The tools in a configuration with these forces.
    pub(super) fn tools_at_rest(
        &self,
        model: TetModel<'_>,
        forces: &Forces,
        configuration: &[DVec3],
    ) -> Vec<ToolAtRest> {
        let centres = &configuration[model.body.mass_kg().len()..];
        let at_rest = |(tool, pressing): (usize, &Pressing)| {
            let (device_m, centre_m) = (self.devices_m[tool], centres[tool]);
            let spring_n = model.environment.contact.spring(tool).map(|spring| spring.force_n(device_m - centre_m));
            ToolAtRest::pressing(device_m, centre_m, pressing, spring_n)
        };
        forces.tools.iter().enumerate().map(at_rest).collect()
    }

    /// Potential (J) of contact and couplings.
    fn tools_j(&self, model: TetModel<'_>, configuration: &[DVec3]) -> f64 {
        let springs: f64 =
            self.springs(model, configuration).map(|(_, spring, stretch)| spring.energy_j(stretch)).sum();
        self.contact.potential_j(&model.environment.contact, configuration) + springs
    }
}

/// Forces (N) on nodes and tools in a configuration.
#[derive(Debug, Clone)]
pub(super) struct Forces {
    /// Elastic.
    pub(super) internal_n: Vec<DVec3>,
    /// Gravity, loads, contact, couplings.
    pub(super) external_n: Vec<DVec3>,
    /// How each tool presses the body.
    pub(super) tools: Vec<Pressing>,
}

impl Forces {
    pub(super) fn at(model: TetModel<'_>, stage: &Stage, configuration: &[DVec3]) -> Self {
        let mut external_n = stage.dead_n.clone();
        for (triangles, pressure_pa) in follower::active(model.environment, &stage.load_factors) {
            loads::add_pressure_n(&model.environment.surface, triangles, pressure_pa, configuration, &mut external_n);
        }
        let tools = stage.contact.add_forces_n(&model.environment.contact, configuration, &mut external_n);
        for (index, spring, stretch_m) in stage.springs(model, configuration) {
            external_n[index] += spring.force_n(stretch_m);
        }
        Self { internal_n: elastic_n(model, configuration), external_n, tools }
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

    /// `‖f_free‖₂` (N), and the same over `max(‖f_internal‖₂, ‖f_external‖₂)`, prescribed axes included.
    pub(super) fn residual(&self, free: &[f64]) -> (f64, f64) {
        let residual_n = free.iter().map(|r| r * r).sum::<f64>().sqrt();
        let reference_n = self.reference_n();
        // Nothing left of nothing is converged; a reference that is not finite is none.
        let nothing = residual_n == 0.0 && reference_n == 0.0;
        let relative = if nothing { 0.0 } else { residual_n / reference_n };
        (residual_n, if reference_n.is_finite() { relative } else { f64::NAN })
    }
}

fn norm(nodal: &[DVec3]) -> f64 {
    nodal.iter().map(|v| v.length_squared()).sum::<f64>().sqrt()
}

/// Elastic nodal forces (N), element by element in f64.
fn elastic_n(model: TetModel<'_>, x: &[DVec3]) -> Vec<DVec3> {
    let mut forces = vec![DVec3::ZERO; x.len()];
    for point in model.body.points().iter() {
        point.add_forces_n(&point.material.piola(&point.gradient_of(x)), &mut forces);
    }
    forces
}

/// Elastic energy (J) of every integration point.
fn elastic_j(model: TetModel<'_>, x: &[DVec3]) -> Vec<f64> {
    model.body.points().iter().map(|point| point.energy_j(x)).collect()
}

/// The line `x + αd`, and the potential along it.
pub(super) struct Line<'a> {
    model: TetModel<'a>,
    stage: &'a Stage,
    x: &'a [DVec3],
    d: &'a [DVec3],
    elastic_j: Vec<f64>,
    tools_j: f64,
    /// `Σ V (λ + 2µ)` (J): the terms that cancel in `Ψ` are of this size, however small the strain.
    cancelling_j: f64,
    dead_slope_w: f64,
}

impl<'a> Line<'a> {
    pub(super) fn new(model: TetModel<'a>, stage: &'a Stage, x: &'a [DVec3], d: &'a [DVec3]) -> Self {
        let elastic_j = elastic_j(model, x);
        let modulus = |point: IntegrationPoint<'_>| point.volume_m3 * point.material.lame.p_wave_modulus_pa();
        let cancelling_j = model.body.points().iter().map(modulus).sum();
        let tools_j = stage.tools_j(model, x);
        Self { model, stage, x, d, elastic_j, tools_j, cancelling_j, dead_slope_w: dot(&stage.dead_n, d) }
    }

    pub(super) fn at(&self, alpha: f64) -> Vec<DVec3> {
        self.x.iter().zip(self.d).map(|(x, d)| *x + *d * alpha).collect()
    }

    /// Change of potential (J) from 0 to `alpha`, and the size of the rounding in it:
    /// `ΔΠ = Σ V ΔΨ + ΔΦ_contact + ΔΨ_spring − α (m g + f_dead)·d − ∫₀^α f_follower(x + td)·d dt`.
    ///
    /// A follower pressure need not have a potential, but its work along a straight line is a number: the integrand is
    /// quadratic in `t`, so Simpson's rule gives it exactly, and `dΔΠ/dα = −f·d` holds for all loads.
    pub(super) fn potential_change_j(&self, alpha: f64) -> (f64, f64) {
        let x = self.at(alpha);
        let after = elastic_j(self.model, &x);
        let tools = self.stage.tools_j(self.model, &x) - self.tools_j;
        let elastic: f64 = after.iter().zip(&self.elastic_j).map(|(b, a)| b - a).sum();
        let size: f64 = after.iter().zip(&self.elastic_j).map(|(b, a)| b.abs() + a.abs()).sum();
        let follower_work = if follower::active(self.model.environment, &self.stage.load_factors).next().is_some() {
            let power = |t: f64| self.follower_power(t);
            alpha / 6.0 * (power(0.0) + 4.0 * power(0.5 * alpha) + power(alpha))
        } else {
            0.0
        };
        let dead_work = alpha * self.dead_slope_w;
        let terms = self.cancelling_j + size + self.tools_j + dead_work.abs() + follower_work.abs();
        (elastic + tools - dead_work - follower_work, f64::EPSILON * terms)
    }

    fn follower_power(&self, t: f64) -> f64 {
        let mut forces = vec![DVec3::ZERO; self.x.len()];
        let x = self.at(t);
        for (triangles, pressure_pa) in follower::active(self.model.environment, &self.stage.load_factors) {
            loads::add_pressure_n(&self.model.environment.surface, triangles, pressure_pa, &x, &mut forces);
        }
        dot(&forces, self.d)
    }
}

pub(super) fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}
