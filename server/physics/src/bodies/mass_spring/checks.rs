//! The running springs and the motion of a surface, compared with the plain springs.
use super::AnchorLaw;
use super::{
    blend::{Added, Levels},
    model::SpringModel,
    motion::{AwakeNodes, SpringMotion, SpringScratch, Wanted},
    net::{Net, Spring},
    region::{Constants, Region},
    testing::{hexagon, sphere, spring_spec},
};
use glam::DVec3;

/// A tie: its node, the ends of the node's edge, and its stiffness (N/m).
type Tie = ([u32; 3], f64);

/// Returns all springs and all ties on the nodes of the surface refined everywhere.
fn oracle(model: &SpringModel, levels: &Levels, fine: &Constants) -> (Net, Vec<Tie>) {
    let rest_m = model.rest_m().to_vec();
    let coarse = &model.spec().coarse;
    let spring = |nodes: [u32; 2]| {
        let [a, b] = nodes.map(|node| rest_m[node as usize]);
        Spring { nodes, rest_length_m: a.distance(b), stiffness_n_per_m: coarse.mesh_n_per_m }
    };
    let mut springs: Vec<Spring> = model.surface().edges().iter().map(|edge| spring(edge.nodes)).collect();
    let mut anchor_n_per_m = vec![0.0; rest_m.len()];
    anchor_n_per_m[..model.vertices() as usize].fill(coarse.anchor_n_per_m);
    let mut ties = Vec::new();
    levels.for_each_added(model.surface(), model.rest_m(), coarse, fine, |added| match added {
        Added::Spring { nodes, rest_length_m, stiffness_n_per_m } => {
            springs.push(Spring { nodes, rest_length_m, stiffness_n_per_m });
        }
        Added::Anchor { node, stiffness_n_per_m } => anchor_n_per_m[node as usize] += stiffness_n_per_m,
        Added::Tie { nodes, stiffness_n_per_m } => ties.push((nodes, stiffness_n_per_m)),
    });
    (Net { rest_m, springs, anchor_n_per_m, anchor_law: model.spec().anchor_law.clone() }, ties)
}

/// Returns `u_e − ½ (u_a + u_b)` (m).
fn off_m(net: &Net, nodes: [u32; 3], x_m: &[DVec3]) -> DVec3 {
    let [own, a, b] = nodes.map(|node| x_m[node as usize] - net.rest_m[node as usize]);
    own - (a + b) * 0.5
}

/// Returns the energy (J) of springs and ties.
fn energy_j((net, ties): &(Net, Vec<Tie>), x_m: &[DVec3]) -> f64 {
    let of_ties = ties.iter().map(|(nodes, stiffness)| 0.5 * stiffness * off_m(net, *nodes, x_m).length_squared());
    net.energy_j(x_m) + of_ties.sum::<f64>()
}

/// Returns the forces (N) of springs and ties.
fn forces_n((net, ties): &(Net, Vec<Tie>), x_m: &[DVec3]) -> Vec<DVec3> {
    let mut forces = net.forces_n(x_m);
    for (nodes, stiffness) in ties {
        let pull = off_m(net, *nodes, x_m) * *stiffness;
        for (node, part) in nodes.iter().zip([-1.0, 0.5, 0.5]) {
            forces[*node as usize] += pull * part;
        }
    }
    forces
}

/// A surface in motion.
struct Moving {
    model: SpringModel,
    motion: SpringMotion,
    scratch: SpringScratch,
    x: Vec<DVec3>,
    v: Vec<DVec3>,
    awake: Vec<u32>,
}

impl Moving {
    fn new(model: SpringModel, awake: Vec<u32>) -> Self {
        let motion = SpringMotion::at_rest(&model, awake.iter().copied());
        let x = awake.iter().map(|&id| model.rest_m()[id as usize]).collect();
        let v = vec![DVec3::ZERO; awake.len()];
        let scratch = SpringScratch::new(&model);
        let mut own = Self { model, motion, scratch, x, v, awake };
        own.advance(&[], 0.0);
        own
    }

    fn advance(&mut self, refined: &[u32], step: f64) -> [f64; 2] {
        let wanted = Wanted { refined, step, fine: self.model.spec().fine, awake: &self.awake };
        let nodes = AwakeNodes { x_m: &mut self.x, v_m_per_s: &mut self.v };
        let changed = self.scratch.advance(&self.model, &mut self.motion, nodes, &wanted);
        changed.map_or([0.0; 2], |changed| [changed.elastic_j, changed.kinetic_j])
    }

    /// Returns the positions of all nodes, at rest where they are not awake.
    fn all_m(&self) -> Vec<DVec3> {
        let mut all = self.model.rest_m().to_vec();
        for (id, x) in self.motion.ids.iter().zip(&self.x) {
            all[*id as usize] = *x;
        }
        all
    }

    fn oracle(&self) -> (Net, Vec<Tie>) {
        oracle(&self.model, &self.motion.levels, &self.motion.fine)
    }

    fn energy_j(&self) -> f64 {
        let masses = self.scratch.mass_kg().iter().zip(&self.v);
        let kinetic: f64 = masses.map(|(mass, v)| 0.5 * mass * v.length_squared()).sum();
        kinetic + energy_j(&self.oracle(), &self.all_m())
    }

    fn momentum(&self) -> DVec3 {
        self.scratch.mass_kg().iter().zip(&self.v).map(|(mass, v)| *v * *mass).sum()
    }

    fn forces_n(&mut self) -> Vec<DVec3> {
        let mut forces = vec![DVec3::ZERO; self.x.len()];
        self.scratch.add_forces_n(&self.model, &self.motion, &self.x, &mut forces);
        forces
    }

    /// Takes a step of leapfrog, half a kick first.
    fn step(&mut self, h_s: f64) {
        for part in 0..2 {
            let forces = self.forces_n();
            for ((v, force), mass) in self.v.iter_mut().zip(&forces).zip(self.scratch.mass_kg()) {
                *v += *force * (0.5 * h_s / mass);
            }
            if part == 0 {
                self.x.iter_mut().zip(&self.v).for_each(|(x, v)| *x += *v * h_s);
            }
        }
    }

    fn shake(&mut self, size_m: f64) {
        let ids = self.motion.ids.clone();
        for ((x, v), id) in self.x.iter_mut().zip(&mut self.v).zip(ids) {
            let wave = |phase: f64| (2.3 * f64::from(id) + phase).sin();
            *x += DVec3::new(wave(0.0), wave(1.0), wave(2.0)) * size_m;
            *v += DVec3::new(wave(3.0), wave(4.0), wave(5.0)) * (20.0 * size_m);
        }
    }
}

fn region(model: &SpringModel, centres: &[u32], rings: u32) -> Vec<u32> {
    Region::rings(model.surface(), centres, rings).triangles().iter().copied().collect()
}

fn ball(law: AnchorLaw) -> SpringModel {
    SpringModel::build(crate::bodies::mass_spring::SpringSpec { anchor_law: law, ..spring_spec(sphere(3, 0.05)) })
        .unwrap()
}

/// The whole surface is awake or a part of it, at any levels.
#[test]
fn forces_are_those_of_the_plain_springs() {
    for (law, awake) in [(AnchorLaw::Linear, 258), (AnchorLaw::cubic(1e5).unwrap(), 258), (AnchorLaw::Linear, 90)] {
        let model = ball(law);
        let (one, other) = (region(&model, &[0], 2), region(&model, &[40], 1));
        let mut moving = Moving::new(model, (0..awake).collect());
        for (refined, ticks) in [(&one, 7), (&one, 20), (&other, 5)] {
            for _ in 0..ticks {
                moving.advance(refined, 0.07);
            }
            moving.shake(1e-3);
            let expected = forces_n(&moving.oracle(), &moving.all_m());
            let scale = expected.iter().map(|f| f.length()).fold(0.0, f64::max);
            let ids = moving.motion.ids.clone();
            assert!(ids.len() > awake as usize);
            for (id, force) in ids.iter().zip(moving.forces_n()) {
                assert!(
                    force.distance(expected[*id as usize]) < 1e-13 * scale,
                    "{id}: {force} {}",
                    expected[*id as usize]
                );
            }
        }
    }
}

/// Nodes that enter and leave, and levels that change, change the energy by what is returned; nodes that enter and
/// leave conserve momentum and take kinetic energy, and never give any.
#[test]
fn energy_is_told_and_momentum_kept_while_a_shaken_ball_is_refined_here_and_there() {
    let model = ball(AnchorLaw::cubic(1e5).unwrap());
    let regions: Vec<Vec<u32>> =
        [0, 3, 40, 41].iter().map(|&centre| region(&model, &[centre], 1 + centre % 2)).collect();
    let mut moving = Moving::new(model, (0..258).collect());
    moving.shake(5e-4);
    let (start, mut told, mut largest) = (moving.energy_j(), 0.0, 0.0_f64);
    let h_s = 0.2 / moving.model.frequency_rad_per_s();
    for tick in 0..2000 {
        let (energy, momentum) = (moving.energy_j(), moving.momentum());
        let [elastic, kinetic] = moving.advance(&regions[tick / 37 % 4], 0.05);
        assert!(kinetic <= 1e-15 * start, "tick {tick}: {kinetic}");
        let change = moving.energy_j() - energy;
        assert!((change - elastic - kinetic).abs() < 1e-12 * start, "tick {tick}: {change} {elastic} {kinetic}");
        let mass: f64 = moving.scratch.mass_kg().iter().sum();
        let whole: f64 = moving.model.spec().mass_kg.iter().sum();
        assert!((mass / whole - 1.0).abs() < 1e-13, "tick {tick}: {mass} {whole}");
        assert!(moving.momentum().distance(momentum) < 1e-13 * (2.0 * whole * start).sqrt(), "tick {tick}");
        told += elastic + kinetic;
        largest = largest.max(moving.motion.levels.triangles().len() as f64);
        moving.step(h_s);
    }
    let balance = moving.energy_j() - start - told;
    assert!(largest > 24.0 && balance.abs() < 1e-3 * start, "{balance} of {start}, {largest} triangles");
}

/// Vertices fall asleep and wake at their rest positions: the energy they had is returned, and springs to them are
/// those of the oracle.
#[test]
fn what_falls_asleep_leaves_its_energy() {
    let mut moving = Moving::new(ball(AnchorLaw::Linear), (0..258).collect());
    let refined = region(&moving.model, &[0], 1);
    for _ in 0..25 {
        moving.advance(&refined, 0.07);
    }
    moving.shake(1e-3);
    moving.awake = (0..258).filter(|id| id % 3 != 1).collect();
    let before = moving.energy_j();
    let told: f64 = moving.advance(&refined, 0.07).iter().sum();
    let change = moving.energy_j() - before;
    assert!(moving.motion.ids.len() < 258 && change < -0.1 * before, "{before} {change}");
    assert!((change - told).abs() < 1e-13 * before, "{change} {told}");
    moving.awake = (0..258).collect();
    let before = moving.energy_j();
    let told: f64 = moving.advance(&refined, 0.07).iter().sum();
    assert!(told.abs() < 1e-13 * before && (moving.energy_j() - before).abs() < 1e-13 * before);
}

/// A motion that is put back, as from a snapshot, goes on with the same bits in buffers that were laid out for another
/// one.
#[test]
fn a_motion_put_back_goes_on_with_the_same_bits() {
    let mut moving = Moving::new(ball(AnchorLaw::Linear), (0..258).collect());
    let refined = region(&moving.model, &[0], 2);
    let on = |moving: &mut Moving, refined: &[u32]| {
        moving.advance(refined, 0.07);
        moving.step(1e-4);
    };
    moving.shake(1e-3);
    (0..9).for_each(|_| on(&mut moving, &refined));
    let kept = (moving.motion.clone(), moving.x.clone(), moving.v.clone());
    (0..30).for_each(|_| on(&mut moving, &[]));
    let ends = (moving.motion.clone(), moving.x.clone(), moving.v.clone());
    assert_ne!(ends.0, kept.0);
    (moving.motion, moving.x, moving.v) = kept;
    (0..30).for_each(|_| on(&mut moving, &[]));
    assert_eq!((moving.motion, moving.x, moving.v), ends);
}

/// The bound holds at any levels and however far springs are stretched, and it is not much too large.
#[test]
fn no_frequency_is_above_the_bound() {
    for surface in [hexagon(4, 0.03), sphere(2, 0.05)] {
        let model = SpringModel::build(spring_spec(surface)).unwrap();
        let all: Vec<u32> = (0..model.vertices()).collect();
        let refined = region(&model, &[0, 12], 2);
        let mut moving = Moving::new(model, all);
        let mut highest = 0.0_f64;
        for _ in 0..21 {
            moving.shake(3e-3);
            let (springs, x, ids) = (moving.oracle(), moving.all_m(), moving.motion.ids.clone());
            let mut p: Vec<DVec3> = x.iter().enumerate().map(|(n, _)| DVec3::splat((n as f64 * 9.1).sin())).collect();
            let mut omega_sq = 0.0;
            for _ in 0..300 {
                // K p by central differences.
                let d_m = 1e-6 / p.iter().map(|p| p.length()).fold(0.0, f64::max);
                let at = |d_m: f64| x.iter().zip(&p).map(|(x, p)| *x + *p * d_m).collect::<Vec<_>>();
                let [more, less] = [d_m, -d_m].map(|d_m| forces_n(&springs, &at(d_m)));
                p.fill(DVec3::ZERO);
                for (id, mass) in ids.iter().zip(moving.scratch.mass_kg()) {
                    p[*id as usize] = (less[*id as usize] - more[*id as usize]) / (2.0 * d_m * *mass);
                }
                omega_sq = p.iter().map(|p| p.length_squared()).sum::<f64>().sqrt();
                for p in &mut p {
                    *p /= omega_sq;
                }
            }
            highest = highest.max(omega_sq.sqrt());
            moving.advance(&refined, 0.1);
        }
        let bound = moving.model.frequency_rad_per_s();
        assert!(highest < bound && highest > 0.5 * bound, "{highest} {bound}");
    }
}
