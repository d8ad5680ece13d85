//! Loads on nodes and on the boundary, each with its potential or its power known to the ledger.
use crate::{mesh::Surface, settings::LoadSpec};
use glam::DVec3;

/// Positions (m) of all nodes that loads act at.
#[derive(Debug, Clone, Copy)]
pub struct LoadPositions<'a> {
    /// At rest: dead loads act here.
    pub rest_m: &'a [DVec3],
    /// Of the deformed body: follower loads act here.
    pub deformed_m: &'a [DVec3],
}

/// Adds the nodal forces (N) of a load scaled by `factor`.
pub fn add_load_n(
    load: &LoadSpec,
    factor: f64,
    surface: &Surface,
    LoadPositions { rest_m, deformed_m }: LoadPositions<'_>,
    forces_n: &mut [DVec3],
) {
    match load {
        LoadSpec::NodalForces(forces) => {
            for &(node, force_n) in forces {
                forces_n[node as usize] += force_n * factor;
            }
        }
        LoadSpec::Traction { triangles, traction_pa } => {
            add_traction_n(surface, triangles, *traction_pa * factor, rest_m, forces_n);
        }
        LoadSpec::Pressure { triangles, pressure_pa, follower } => {
            let positions_m = if *follower { deformed_m } else { rest_m };
            add_pressure_n(surface, triangles, pressure_pa * factor, positions_m, forces_n);
        }
    }
}

/// Adds the nodal forces of a pressure `p` (Pa, positive pushes inwards) on boundary triangles:
/// each triangle gives `−p A n / 3` to its corners, `A n = ½ (x1−x0)×(x2−x0)`.
///
/// With the rest positions it is a dead load, with the deformed ones a follower load.
pub fn add_pressure_n(
    surface: &Surface,
    triangles: &[u32],
    pressure_pa: f64,
    positions_m: &[DVec3],
    forces_n: &mut [DVec3],
) {
    for &triangle in triangles {
        let nodes = surface.triangle_nodes(triangle as usize).map(|n| n as usize);
        let [a, b, c] = nodes.map(|n| positions_m[n]);
        let third = (b - a).cross(c - a) * (-pressure_pa / 6.0);
        for node in nodes {
            forces_n[node] += third;
        }
    }
}

/// Adds a dead traction (Pa, world) on boundary triangles: `t A₀ / 3` to each corner.
pub fn add_traction_n(
    surface: &Surface,
    triangles: &[u32],
    traction_pa: DVec3,
    rest_positions_m: &[DVec3],
    forces_n: &mut [DVec3],
) {
    for &triangle in triangles {
        let nodes = surface.triangle_nodes(triangle as usize).map(|n| n as usize);
        let [a, b, c] = nodes.map(|n| rest_positions_m[n]);
        let third = traction_pa * ((b - a).cross(c - a).length() / 6.0);
        for node in nodes {
            forces_n[node] += third;
        }
    }
}
