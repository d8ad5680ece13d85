//! What an equilibrium of a hybrid body balances, at a fraction of the goal: forces, their tangent, and the change of
//! potential along a line.
use super::awakened::Awakened;
use crate::{
    contact::{Pressing, RestingContact, SaturatingSpring},
    elements::loads,
    settings::LoadSpec,
    statics::{
        ToolAtRest,
        equilibrium::{Goal, dot},
        follower,
    },
};
use glam::{DMat3, DVec3};
use std::collections::BTreeMap;

/// The goal, scaled to a fraction of it.
#[derive(Debug, Clone)]
pub(super) struct Stage {
    pub(super) fraction: f64,
    load_factors: Vec<f64>,
    /// Gravity and dead loads (N) on the unknowns.
    dead_n: Vec<DVec3>,
    /// Positions (m) of the tools' devices.
    devices_m: Vec<DVec3>,
    pub(super) contact: RestingContact,
}

/// Forces (N) on the unknowns.
pub(super) struct Forces {
    pub(super) elastic_n: Vec<DVec3>,
    pub(super) external_n: Vec<DVec3>,
    pub(super) tools: Vec<Pressing>,
}

/// The stiffness (N/m) of what acts on skin and tools.
pub(super) struct Outer {
    /// Entries of a configuration.
    entries: Vec<u32>,
    /// The unknowns that each entry moves with, and their weights.
    carriers: Vec<Vec<(u32, f64)>>,
    /// Blocks `∂(−f_i)/∂y_j`, `i` and `j` by their numbers in `entries`; of a pair only one block is kept.
    blocks: BTreeMap<[u32; 2], DMat3>,
}

impl Stage {
    /// Enters a stage from the unknowns `before`, where contact was `contact`; returns the stage, and the unknowns to
    /// begin with.
    pub(super) fn enter(
        awakened: &Awakened<'_>,
        goal: &Goal<'_>,
        fraction: f64,
        before: &[DVec3],
        contact: &RestingContact,
    ) -> (Self, Vec<DVec3>) {
        let environment = awakened.environment;
        let load_factors: Vec<f64> = goal.load_factors.iter().map(|factor| factor * fraction).collect();
        let skin_m = awakened.body.skin_rest_m();
        let tools = environment.tools.len();
        let mut on_skin_n = vec![DVec3::ZERO; awakened.vertices() + tools];
        for (load, &factor) in environment.loads.iter().zip(&load_factors) {
            let follows = matches!(load, LoadSpec::Pressure { follower: true, .. });
            if factor != 0.0 && !follows {
                let at = loads::LoadPositions { rest_m: skin_m, deformed_m: skin_m };
                loads::add_load_n(load, factor, &environment.surface, at, &mut on_skin_n);
            }
        }
        let mut dead_n: Vec<DVec3> = awakened.weight_n.iter().map(|weight| *weight * fraction).collect();
        dead_n.resize(before.len(), DVec3::ZERO);
        awakened.push(&on_skin_n, &mut dead_n);
        let start = environment.tools.iter().map(|tool| tool.start_position_m);
        let devices_m: Vec<DVec3> = start.zip(goal.tools).map(|(s, tool)| s.lerp(tool.position_m, fraction)).collect();
        let mut begin = before.to_vec();
        for (tool, device) in devices_m.iter().enumerate() {
            if environment.contact.spring(tool).is_none() {
                begin[awakened.entries() + tool] = *device;
            }
        }
        let [was, is] = [before, &begin].map(|unknowns| awakened.configuration(unknowns));
        let contact = contact.arrive(&environment.contact, &was, &is);
        (Self { fraction, load_factors, dead_n, devices_m, contact }, begin)
    }

    /// Returns the coupled tools, each with the number of its unknown, its spring, and the spring's stretch `d − c`
    /// (m).
    fn springs<'a>(
        &'a self,
        awakened: &'a Awakened<'_>,
        unknowns: &'a [DVec3],
    ) -> impl Iterator<Item = (usize, SaturatingSpring, DVec3)> + 'a {
        self.devices_m.iter().enumerate().filter_map(move |(tool, device)| {
            let (entry, spring) = (awakened.entries() + tool, awakened.environment.contact.spring(tool)?);
            Some((entry, spring, *device - unknowns[entry]))
        })
    }

    fn has_followers(&self, awakened: &Awakened<'_>) -> bool {
        follower::active(awakened.environment, &self.load_factors).next().is_some()
    }

    /// Adds follower pressures (N) at a configuration.
    fn add_followers_n(&self, awakened: &Awakened<'_>, configuration: &[DVec3], forces_n: &mut [DVec3]) {
        for (triangles, pressure_pa) in follower::active(awakened.environment, &self.load_factors) {
            loads::add_pressure_n(&awakened.environment.surface, triangles, pressure_pa, configuration, forces_n);
        }
    }

    /// Computes all forces.
    pub(super) fn forces(&self, awakened: &Awakened<'_>, unknowns: &[DVec3]) -> Forces {
        let configuration = awakened.configuration(unknowns);
        let mut outer_n = vec![DVec3::ZERO; configuration.len()];
        self.add_followers_n(awakened, &configuration, &mut outer_n);
        let tools = self.contact.add_forces_n(&awakened.environment.contact, &configuration, &mut outer_n);
        let mut external_n = self.dead_n.clone();
        awakened.push(&outer_n, &mut external_n);
        for (entry, spring, stretch_m) in self.springs(awakened, unknowns) {
            external_n[entry] += spring.force_n(stretch_m);
        }
        Forces { elastic_n: awakened.elastic_n(unknowns), external_n, tools }
    }

    /// Computes the stiffness of contact, couplings and follower pressures; of the latter its symmetric part.
    pub(super) fn outer(&self, awakened: &Awakened<'_>, unknowns: &[DVec3]) -> Outer {
        let configuration = awakened.configuration(unknowns);
        let mut blocks: BTreeMap<[u32; 2], DMat3> = BTreeMap::new();
        let mut add = |i: u32, j: u32, block: &DMat3| {
            let (pair, block) = if i <= j { ([i, j], *block) } else { ([j, i], block.transpose()) };
            *blocks.entry(pair).or_insert(DMat3::ZERO) += block;
        };
        self.contact.for_each_block(&awakened.environment.contact, &configuration, false, &mut add);
        for (entry, spring, stretch_m) in self.springs(awakened, unknowns) {
            let own = (entry - awakened.entries() + awakened.vertices()) as u32;
            add(own, own, &spring.hessian_n_per_m(stretch_m, false));
        }
        follower::for_each_block(awakened.environment, &self.load_factors, &configuration, &mut add);
        Outer::new(awakened, blocks)
    }

    /// Returns the potential (J) of contact and couplings.
    fn tools_j(&self, awakened: &Awakened<'_>, unknowns: &[DVec3]) -> f64 {
        let springs: f64 = self.springs(awakened, unknowns).map(|(_, spring, stretch)| spring.energy_j(stretch)).sum();
        self.contact.potential_j(&awakened.environment.contact, &awakened.configuration(unknowns)) + springs
    }

    /// Returns the tools at rest, with these forces.
    pub(super) fn tools_at_rest(
        &self,
        awakened: &Awakened<'_>,
        forces: &Forces,
        unknowns: &[DVec3],
    ) -> Vec<ToolAtRest> {
        let at_rest = |(tool, pressing): (usize, &Pressing)| {
            let (device_m, centre_m) = (self.devices_m[tool], unknowns[awakened.entries() + tool]);
            let spring_n = awakened.environment.contact.spring(tool).map(|spring| spring.force_n(device_m - centre_m));
            ToolAtRest::pressing(device_m, centre_m, pressing, spring_n)
        };
        forces.tools.iter().enumerate().map(at_rest).collect()
    }
}

impl Forces {
    pub(super) fn total_n(&self) -> Vec<DVec3> {
        self.elastic_n.iter().zip(&self.external_n).map(|(a, b)| *a + *b).collect()
    }

    /// Returns `max(‖f_elastic‖₂, ‖f_external‖₂)` (N), prescribed axes included.
    pub(super) fn reference_n(&self) -> f64 {
        dot(&self.elastic_n, &self.elastic_n).max(dot(&self.external_n, &self.external_n)).sqrt()
    }

    /// Returns the total force (N) along the axes that may move, its size, and the size over [`Self::reference_n`].
    pub(super) fn residual(&self, awakened: &Awakened<'_>) -> (Vec<DVec3>, f64, f64) {
        let totals = self.total_n();
        let free: Vec<DVec3> =
            totals.iter().zip(&awakened.free).map(|(f, free)| DVec3::select(*free, *f, DVec3::ZERO)).collect();
        let (residual_n, reference_n) = (dot(&free, &free).sqrt(), self.reference_n());
        let relative = if residual_n == 0.0 && reference_n == 0.0 { 0.0 } else { residual_n / reference_n };
        (free, residual_n, if reference_n.is_finite() { relative } else { f64::NAN })
    }
}

impl Outer {
    fn new(awakened: &Awakened<'_>, of_configuration: BTreeMap<[u32; 2], DMat3>) -> Self {
        let mut entries: Vec<u32> = of_configuration.keys().flatten().copied().collect();
        entries.sort_unstable();
        entries.dedup();
        let number = |entry: u32| entries.partition_point(|&e| e < entry) as u32;
        let blocks = of_configuration.into_iter().map(|([i, j], block)| ([number(i), number(j)], block)).collect();
        let carriers = entries.iter().map(|&entry| awakened.carriers(entry)).collect();
        Self { entries, carriers, blocks }
    }

    /// Adds `K a` to `out`.
    pub(super) fn add_products_n(&self, a: &[DVec3], out: &mut [DVec3]) {
        let of = |carriers: &Vec<(u32, f64)>| carriers.iter().map(|&(e, w)| a[e as usize] * w).sum();
        let moved: Vec<DVec3> = self.carriers.iter().map(of).collect();
        let mut products = vec![DVec3::ZERO; self.entries.len()];
        for ([i, j], block) in &self.blocks {
            products[*i as usize] += *block * moved[*j as usize];
            if i != j {
                products[*j as usize] += block.transpose() * moved[*i as usize];
            }
        }
        for (carriers, product) in self.carriers.iter().zip(products) {
            for &(entry, weight) in carriers {
                out[entry as usize] += product * weight;
            }
        }
    }

    /// Adds the diagonal blocks (N/m) of the unknowns.
    pub(super) fn add_diagonal_n_per_m(&self, diagonal: &mut [DMat3]) {
        for ([i, j], block) in &self.blocks {
            let both = if i == j { *block } else { *block + block.transpose() };
            let others = &self.carriers[*j as usize];
            for &(entry, w) in &self.carriers[*i as usize] {
                if let Ok(at) = others.binary_search_by_key(&entry, |(e, _)| *e) {
                    diagonal[entry as usize] += both * (w * others[at].1);
                }
            }
        }
    }
}

/// The line `x + αd`, and the potential along it.
pub(super) struct Line<'a> {
    awakened: &'a Awakened<'a>,
    stage: &'a Stage,
    x: &'a [DVec3],
    d: &'a [DVec3],
    elastic_j: f64,
    tools_j: f64,
    /// `Σ V (λ + 2µ)` (J): the terms that cancel in `Ψ` are of this size, however small the strain.
    cancelling_j: f64,
    dead_slope_w: f64,
}

impl<'a> Line<'a> {
    pub(super) fn new(awakened: &'a Awakened<'a>, stage: &'a Stage, x: &'a [DVec3], d: &'a [DVec3]) -> Self {
        let body = awakened.body;
        let modulus = body.materials().materials.iter().map(|m| m.lame.p_wave_modulus_pa()).fold(0.0, f64::max);
        Self {
            elastic_j: awakened.elastic_j(x),
            tools_j: stage.tools_j(awakened, x),
            cancelling_j: modulus * body.partition().volume_m3(),
            dead_slope_w: dot(&stage.dead_n, d),
            awakened,
            stage,
            x,
            d,
        }
    }

    pub(super) fn at(&self, alpha: f64) -> Vec<DVec3> {
        self.x.iter().zip(self.d).map(|(x, d)| *x + *d * alpha).collect()
    }

    /// Returns the change of potential (J) from 0 to `alpha`, and the size of the rounding in it; the work of follower
    /// pressures is computed by Simpson's rule, which is exact.
    pub(super) fn potential_change_j(&self, alpha: f64) -> (f64, f64) {
        let x = self.at(alpha);
        let elastic = self.awakened.elastic_j(&x) - self.elastic_j;
        let tools = self.stage.tools_j(self.awakened, &x) - self.tools_j;
        let follower_work = if self.stage.has_followers(self.awakened) {
            alpha / 6.0
                * (self.follower_power(0.0) + 4.0 * self.follower_power(0.5 * alpha) + self.follower_power(alpha))
        } else {
            0.0
        };
        let dead_work = alpha * self.dead_slope_w;
        let size = 2.0 * (self.elastic_j.abs() + self.tools_j) + elastic.abs() + tools.abs();
        let terms = self.cancelling_j + size + dead_work.abs() + follower_work.abs();
        (elastic + tools - dead_work - follower_work, f64::EPSILON * terms)
    }

    fn follower_power(&self, t: f64) -> f64 {
        let configuration = self.awakened.configuration(&self.at(t));
        let mut forces_n = vec![DVec3::ZERO; configuration.len()];
        self.stage.add_followers_n(self.awakened, &configuration, &mut forces_n);
        dot(&forces_n, &self.awakened.directions(self.d))
    }
}
