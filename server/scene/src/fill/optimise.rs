//! Moves nodes to improve the worst tets: surface nodes along their surface, rim nodes along their rim.
use super::prisms::cost_of_ratio;
use glam::DVec3;
use palpate_physics::mesh::quality::volume_length_ratio;

/// Only nodes with a tet below this volume-length ratio are moved.
const GOOD_ENOUGH: f64 = 0.6;
/// First step of a line search, as part of the mean edge at the node; halved this many times.
const FIRST_STEP: f64 = 0.2;
const HALVINGS: usize = 5;
/// Step of the finite differences, as part of the mean edge.
const DIFFERENCE: f64 = 1e-4;

/// Improves positions in `sweeps` Gauss-Seidel passes over the nodes. `project(node, p)` returns the admissible place
/// next to `p`, or None for a node that must not move.
pub(crate) fn improve(
    positions: &mut [DVec3],
    tets: &[[u32; 4]],
    sweeps: usize,
    project: impl Fn(usize, DVec3) -> Option<DVec3>,
) {
    let mut around = vec![Vec::with_capacity(24); positions.len()];
    for (t, tet) in tets.iter().enumerate() {
        for &n in tet {
            around[n as usize].push(t as u32);
        }
    }
    for _ in 0..sweeps {
        let mut moved = false;
        for node in 0..positions.len() {
            let star = Star { node: node as u32, positions, tets, around: &around[node] };
            if star.worst() < GOOD_ENOUGH
                && let Some(better) = star.improved(|p| project(node, p))
            {
                positions[node] = better;
                moved = true;
            }
        }
        if !moved {
            break;
        }
    }
}

/// The tets around a node.
struct Star<'a> {
    node: u32,
    positions: &'a [DVec3],
    tets: &'a [[u32; 4]],
    around: &'a [u32],
}

impl Star<'_> {
    fn ratios(&self, at: DVec3) -> impl Iterator<Item = f64> + '_ {
        self.around.iter().map(move |&t| {
            let corner = |n: u32| if n == self.node { at } else { self.positions[n as usize] };
            volume_length_ratio(self.tets[t as usize].map(corner))
        })
    }

    fn here(&self) -> DVec3 {
        self.positions[self.node as usize]
    }

    fn worst(&self) -> f64 {
        self.ratios(self.here()).fold(f64::INFINITY, f64::min)
    }

    fn cost(&self, at: DVec3) -> f64 {
        self.ratios(at).map(cost_of_ratio).sum()
    }

    fn mean_edge(&self) -> f64 {
        let ends = self.around.iter().flat_map(|&t| self.tets[t as usize]).filter(|&n| n != self.node);
        let (sum, count) = ends
            .fold((0.0, 0.0), |(sum, count), n| (sum + self.positions[n as usize].distance(self.here()), count + 1.0));
        sum / f64::max(count, 1.0)
    }

    /// A step down the gradient that lowers the cost, if there is one.
    fn improved(&self, project: impl Fn(DVec3) -> Option<DVec3>) -> Option<DVec3> {
        let here = self.here();
        project(here)?;
        let edge = self.mean_edge();
        let delta = DIFFERENCE * edge;
        let slope = |axis: DVec3| self.cost(here + axis * delta) - self.cost(here - axis * delta);
        let gradient = DVec3::new(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z)).normalize_or_zero();
        let cost = self.cost(here);
        (0..HALVINGS).find_map(|halving| {
            let step = FIRST_STEP * edge * 0.5f64.powi(halving as i32);
            let candidate = project(here - gradient * step)?;
            (self.cost(candidate) < cost * (1.0 - 1e-6)).then_some(candidate)
        })
    }
}
