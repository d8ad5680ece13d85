//! Energy, forces and stiffness of mesh and anchor springs, written plainly. This is the oracle of the running springs.
use super::{
    anchor::AnchorLaw,
    triangulation::{Triangulation, TriangulationError},
};
use glam::DVec3;

/// A mesh spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spring {
    /// Its ends.
    pub nodes: [u32; 2],
    /// Rest length `r` (m).
    pub rest_length_m: f64,
    /// Stiffness `K_m` (N/m).
    pub stiffness_n_per_m: f64,
}

/// Nodes that are connected by springs.
#[derive(Debug, Clone, PartialEq)]
pub struct Net {
    /// Rest positions `X` (m) of the nodes.
    pub rest_m: Vec<DVec3>,
    /// Mesh springs, along edges.
    pub springs: Vec<Spring>,
    /// Stiffness `K_h` (N/m) of every node's anchor spring.
    pub anchor_n_per_m: Vec<f64>,
    /// Law `g` of the anchor springs.
    pub anchor_law: AnchorLaw,
}

impl Net {
    /// Returns springs along all edges of a surface and anchor springs at all of its vertices, with the same constants
    /// (N/m) everywhere.
    pub fn uniform(surface: &Triangulation, mesh_n_per_m: f64, anchor_n_per_m: f64) -> Self {
        let spring = |nodes: [u32; 2]| {
            let [a, b] = nodes.map(|node| surface.positions_m()[node as usize]);
            Spring { nodes, rest_length_m: a.distance(b), stiffness_n_per_m: mesh_n_per_m }
        };
        Self {
            rest_m: surface.positions_m().to_vec(),
            springs: surface.edges().iter().map(|edge| spring(edge.nodes)).collect(),
            anchor_n_per_m: vec![anchor_n_per_m; surface.positions_m().len()],
            anchor_law: AnchorLaw::Linear,
        }
    }

    /// Returns the energy `U = Σ ½ K_m (|l| − r)² + Σ K_h G(|u|)` (J) at the positions `x_m` (m).
    pub fn energy_j(&self, x_m: &[DVec3]) -> f64 {
        let of_spring = |spring: &Spring| {
            let longer_m = spring.along(x_m).0 - spring.rest_length_m;
            0.5 * spring.stiffness_n_per_m * longer_m * longer_m
        };
        let of_anchor = |(node, stiffness): (usize, &f64)| {
            stiffness * self.anchor_law.at((x_m[node] - self.rest_m[node]).length()).integral_m2
        };
        let springs: f64 = self.springs.iter().map(of_spring).sum();
        springs + self.anchor_n_per_m.iter().enumerate().map(of_anchor).sum::<f64>()
    }

    /// Returns the forces `f = −∂U/∂x` (N) at the positions `x_m` (m).
    pub fn forces_n(&self, x_m: &[DVec3]) -> Vec<DVec3> {
        let mut forces: Vec<DVec3> = (0..x_m.len()).map(|node| self.anchor_force_n(node, x_m[node])).collect();
        for spring in &self.springs {
            let (length_m, direction) = spring.along(x_m);
            let pull = direction * (spring.stiffness_n_per_m * (length_m - spring.rest_length_m));
            let [a, b] = spring.nodes.map(|node| node as usize);
            forces[a] += pull;
            forces[b] -= pull;
        }
        forces
    }

    fn anchor_force_n(&self, node: usize, x_m: DVec3) -> DVec3 {
        let u = x_m - self.rest_m[node];
        let (direction, distance_m) = unit(u);
        direction * (-self.anchor_n_per_m[node] * self.anchor_law.at(distance_m).g_m)
    }

    /// Writes `Σ ∂²U/∂x∂x p` (N) of a displacement `p` (m) into `out_n`. The stiffness of a mesh spring along `n` and
    /// of an anchor spring along `û` is
    /// ```text
    /// k (n nᵀ + (1 − r/|l|) (I − n nᵀ)),   K_h (g′ û ûᵀ + (g/u) (I − û ûᵀ))
    /// ```
    pub fn stiffness_times_n(&self, x_m: &[DVec3], p_m: &[DVec3], out_n: &mut Vec<DVec3>) {
        out_n.clear();
        out_n.extend((0..x_m.len()).map(|node| {
            let (direction, distance_m) = unit(x_m[node] - self.rest_m[node]);
            let law = self.anchor_law.at(distance_m);
            let across = if distance_m > 0.0 { law.g_m / distance_m } else { law.slope };
            let along = direction * direction.dot(p_m[node]);
            (along * law.slope + (p_m[node] - along) * across) * self.anchor_n_per_m[node]
        }));
        for spring in &self.springs {
            let [a, b] = spring.nodes.map(|node| node as usize);
            let (length_m, n) = spring.along(x_m);
            let p = p_m[b] - p_m[a];
            let along = n * n.dot(p);
            let across = if length_m > 0.0 { 1.0 - spring.rest_length_m / length_m } else { 0.0 };
            let force = (along + (p - along) * across) * spring.stiffness_n_per_m;
            out_n[b] += force;
            out_n[a] -= force;
        }
    }

    /// Returns an upper bound (N/m) of the stiffness' diagonal at any positions: `K_h + Σ K_m` over a node's springs.
    pub fn diagonal_n_per_m(&self) -> Vec<f64> {
        let mut diagonal = self.anchor_n_per_m.clone();
        for spring in &self.springs {
            spring.nodes.iter().for_each(|&node| diagonal[node as usize] += spring.stiffness_n_per_m);
        }
        diagonal
    }
}

impl Spring {
    /// Returns the length (m) and the direction from the first end to the second, which is zero where the ends
    /// coincide.
    pub fn along(&self, x_m: &[DVec3]) -> (f64, DVec3) {
        let [a, b] = self.nodes.map(|node| x_m[node as usize]);
        let (direction, length_m) = unit(b - a);
        (length_m, direction)
    }
}

fn unit(v: DVec3) -> (DVec3, f64) {
    let length = v.length();
    if length > 0.0 { (v / length, length) } else { (DVec3::ZERO, 0.0) }
}

/// Returns a flat patch of equilateral triangles of edge `edge_m` (m) in the plane z = 0: all vertices within `rings`
/// rings about vertex 0.
///
/// # Errors
/// There is no ring, or the edge is not finite and positive: the surface would have no triangles or no area.
pub fn hexagonal_patch(rings: i32, edge_m: f64) -> Result<Triangulation, TriangulationError> {
    let within = |q: i32, r: i32| q.abs().max(r.abs()).max((q + r).abs()) <= rings;
    let all = (-rings..=rings).flat_map(|q| (-rings..=rings).map(move |r| (q, r))).filter(|&(q, r)| within(q, r));
    let mut cells: Vec<(i32, i32)> = all.collect();
    cells.sort_by_key(|&(q, r)| (q.abs().max(r.abs()).max((q + r).abs()), q, r));
    let number: std::collections::BTreeMap<(i32, i32), u32> = cells.iter().copied().zip(0..).collect();
    let half_height = 0.5 * 3.0_f64.sqrt();
    let place =
        |&(q, r): &(i32, i32)| DVec3::new(f64::from(q) + 0.5 * f64::from(r), half_height * f64::from(r), 0.0) * edge_m;
    let triangle = |corners: [(i32, i32); 3]| {
        let [a, b, c] = corners.map(|cell| number.get(&cell).copied());
        Some([a?, b?, c?])
    };
    let of_cell = |&(q, r): &(i32, i32)| {
        let up = triangle([(q, r), (q + 1, r), (q, r + 1)]);
        let down = triangle([(q, r), (q, r + 1), (q - 1, r + 1)]);
        [up, down].into_iter().flatten()
    };
    Triangulation::new(cells.iter().map(place).collect(), cells.iter().flat_map(of_cell).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::mass_spring::anchor::Layer;
    use crate::bodies::mass_spring::testing::hexagon;
    use glam::Vec3Swizzles;

    fn shaken(net: &Net) -> Vec<DVec3> {
        let wave = |node: usize, phase: f64| (1.7 * node as f64 + phase).sin();
        let offset = |node: usize| DVec3::new(wave(node, 0.0), wave(node, 1.0), wave(node, 2.0)) * 4e-3;
        net.rest_m.iter().enumerate().map(|(node, rest)| *rest + offset(node)).collect()
    }

    #[test]
    fn forces_and_stiffness_are_derivatives_of_the_energy() {
        let layers =
            [Layer { thickness_m: 3e-3, stiffness_ratio: 1.0 }, Layer { thickness_m: 1.0, stiffness_ratio: 5.0 }];
        for law in [AnchorLaw::Linear, AnchorLaw::cubic(1e4).unwrap(), AnchorLaw::layers(&layers).unwrap()] {
            let net = Net { anchor_law: law, ..Net::uniform(&hexagon(2, 0.03), 60.0, 40.0) };
            let x = shaken(&net);
            let p: Vec<DVec3> = shaken(&net).iter().zip(&net.rest_m).map(|(x, rest)| (*x - *rest).yzx()).collect();
            let moved = |t: f64| -> Vec<DVec3> { x.iter().zip(&p).map(|(x, p)| *x + *p * t).collect() };
            let d = 1e-5;
            let power: f64 = net.forces_n(&x).iter().zip(&p).map(|(f, p)| f.dot(*p)).sum();
            let slope = (net.energy_j(&moved(d)) - net.energy_j(&moved(-d))) / (2.0 * d);
            assert!((power + slope).abs() < 1e-8 * slope.abs(), "{power} {slope}");
            let mut times = Vec::new();
            net.stiffness_times_n(&x, &p, &mut times);
            let [more, less] = [d, -d].map(|t| net.forces_n(&moved(t)));
            let scale = times.iter().map(|f| f.length()).fold(0.0, f64::max);
            for (node, force) in times.iter().enumerate() {
                let differ = (less[node] - more[node]) / (2.0 * d) - *force;
                assert!(differ.length() < 1e-6 * scale, "{node}: {differ}");
            }
        }
    }

    #[test]
    fn at_rest_there_is_no_force_and_springs_alone_keep_momentum() {
        let mut net = Net::uniform(&hexagon(3, 0.03), 60.0, 60.0);
        assert!(net.forces_n(&net.rest_m).iter().all(|f| f.length() < 1e-13));
        net.anchor_n_per_m.fill(0.0);
        let x = shaken(&net);
        let forces = net.forces_n(&x);
        let largest = forces.iter().map(|f| f.length()).fold(0.0, f64::max);
        let couple: DVec3 = x.iter().zip(&forces).map(|(x, f)| x.cross(*f)).sum();
        assert!(forces.iter().sum::<DVec3>().length() < 1e-13 * largest);
        assert!(couple.length() < 1e-13 * largest);
    }

    /// A node that is pulled out of the sheet while all others stay is met by the force
    /// `K_h x + 6 K_m (√(L² + x²) − L) x/√(L² + x²)`.
    #[test]
    fn neighbours_held_fixed_answer_by_the_formula() {
        let (edge, k) = (0.03, 60.0);
        let net = Net::uniform(&hexagon(3, edge), k, k);
        for part in [0.01, 0.3, 1.0] {
            let lift = part * edge;
            let mut x = net.rest_m.clone();
            x[0].z += lift;
            let slant = edge.hypot(lift);
            let expected = k * lift + 6.0 * k * (slant - edge) * lift / slant;
            let force = -net.forces_n(&x)[0].z;
            assert!((force / expected - 1.0).abs() < 1e-9, "{part}: {force} {expected}");
            if part == 1.0 {
                assert!((force - 4.9632).abs() < 5e-5, "{force}");
            }
        }
    }
}
